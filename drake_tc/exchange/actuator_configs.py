"""Isaac Lab: a Python file with one actuator configuration a joint.

`ImplicitActuatorCfg`, `IdealPDActuatorCfg` and `DelayedPDActuatorCfg` take stiffness [N m/rad], damping [N m s/rad],
armature [kg m^2], friction and dynamic_friction [N m], viscous_friction [N m s/rad] and a limit of torque [N m]:
joint_effort_limit of the implicit actuator, which the physics engine applies to the servo of the joint, and
actuator_effort_limit of the others, which compute their torque themselves. An implicit actuator passes efforts on
without a limit, so that a drive with a limit whose command is an effort is an `IdealPDActuatorCfg`. Delays are whole
physics steps. Names of joints are regular expressions.

A drive on a voltage of known torque constant kt and limit U is a `DCMotorCfg`. Its efforts are torques, which it clips
to saturation_effort (+-1 - v/actuator_velocity_limit) and to +-actuator_effort_limit. The first is
kt/R (+-U - kt v) with

    saturation_effort = kt U/R,   actuator_velocity_limit = U/kt,   viscous_friction without the back-EMF

The motor brakes with up to kt/R (U + kt |v|), so that actuator_effort_limit is twice the saturation_effort: the line
of torque over speed alone limits the torque up to the actuator_velocity_limit. With a delay, or without a known torque
constant, the efforts are kt/R V and the back-EMF is a part of viscous_friction: that is the same torque, in an actuator
without this line.

Source: Isaac Lab 3.0.0, `isaaclab.actuators`. Isaac Lab 2.3 has the names effort_limit, effort_limit_sim and
velocity_limit, which 3.0 deprecates. PhysX has all three frictions as torques from Isaac Sim 5.0 on; Newton has no
dynamic friction and warns.

Isaac Lab's BAM servo: a Python file with one `BamActuatorCfg` a joint.

The drive of `BamActuatorCfg` is a voltage behind a proportional position loop in the servo's firmware:

    duty = clip(kp_fw error_gain (q_d - q), -max_pwm, max_pwm)
    tau = kt/R vin duty - kt^2/R v - friction_viscous v,   |friction| <= F
    F = friction_base + load_friction_external |tau_ext| + friction_stribeck exp(-|v / dtheta_stribeck|^alpha)

with tau_ext the load on the gear. Logs of voltage and motion give kt/R, the friction and a limit of the voltage. The
torque constant kt, the supply vin and the gain of the position loop P = kp_fw error_gain vin are settings of the servo,
which the user states. `kp_fw` is written as 1, so that `error_gain` is P / vin.

Isaac Lab also limits the torque, to that of the stalled motor, kt vin / R, where actuator_effort_limit is not given. A
motor that brakes has up to kt/R (vin + kt |v|), so that actuator_effort_limit is twice the torque of the stalled motor:
it does not act up to the no-load speed vin / kt.

Source: Isaac Lab's development branch (commit 0120677), `isaaclab.actuators.BamActuatorCfg` and `BamMotorCfg`, which
the releases on PyPI (up to 3.0.0) do not have; it needs Newton's MJWarp solver with `use_newton_actuators=True`.

mjlab: a Python file with one actuator configuration a joint.

`BuiltinPositionActuatorCfg` takes stiffness [N m/rad] and damping [N m s/rad] of a servo and a limit of kp e - kv v
as a whole [N m]; `BuiltinMotorActuatorCfg` takes a gear, the torque for one unit of the effort command, and a limit in
this unit, which it needs. Both have armature [kg m^2], frictionloss [N m] and viscous_damping [N m s/rad] of the joint,
and a delay of the command in whole physics steps.

A drive on a voltage of known torque constant is a `BuiltinDcMotorActuatorCfg`, MuJoCo's `<dcmotor>`, whose command is
the voltage:

    torque = kt/R (V - kt v) + cogging - lugre,   armature current behind a time constant L/R

MuJoCo 3.11, which mjlab 1.6.0 needs, does not apply `voltage_limit` to a command that is a voltage.

Source: mjlab 1.6.0, `mjlab.actuator`.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from drake_tc.config.joint_units import JointType, in_units_of
from drake_tc.errors import ParamsError
from drake_tc.exchange.bam import bam_friction, voltage_motor
from drake_tc.exchange.mjcf import DcMotor, cogging_of, dc_motor, lugre_of
from drake_tc.exchange.projection import PHYSICS_STEP, Loss, Projection
from drake_tc.exchange.xml_text import number
from drake_tc.simulator_files.terms import Terms


def to_isaaclab(projections: Sequence[Projection]) -> str:
    """The text of a Python module whose ACTUATORS goes into an ArticulationCfg."""
    names = {_kind(projection.terms) for projection in projections}
    return _module("isaaclab", names, [_entry(each.joint, each.terms, each.joint_type) for each in projections])


_MODULES = {
    "isaaclab": ("isaaclab.actuators", "an ArticulationCfg", "{}"),
    "mjlab": ("mjlab.actuator", "an EntityArticulationInfoCfg", "()"),
}
"""Simulator to the module of its configurations, where ACTUATORS go, and the brackets around them."""


def _module(simulator: str, names: Iterable[str], entries: Sequence[Sequence[str]]) -> str:
    """The text of a Python module with ACTUATORS, which imports these configurations and has each joint's lines."""
    module, owner, brackets = _MODULES[simulator]
    lines = [
        f'"""Actuators identified by drake-tc: actuators=ACTUATORS in {owner}."""',
        "",
        f"from {module} import {', '.join(sorted(names))}",
        "",
        f"PHYSICS_STEP = {PHYSICS_STEP}  # [s], in which delays are counted",
        "",
        f"ACTUATORS = {brackets[0]}",
        *(line for entry in entries for line in entry),
        brackets[1],
    ]
    return "\n".join(lines) + "\n"


def _decimal(value: float) -> str:
    """A number as text of a Python float that reads back within 1e-10."""
    return repr(float(number(value)))


def _joint_pattern(joint: str) -> str:
    """joint_names_expr as text: a list of one regular expression, which matches this joint alone."""
    return f"[{re.escape(joint)!r}]"


def _delay_fields(terms: Terms) -> dict[str, str]:
    """min_delay and max_delay in physics steps; empty without a delay."""
    steps = str(round(terms.delay / PHYSICS_STEP))
    return {"min_delay": steps, "max_delay": steps} if terms.delay else {}


def _kind(terms: Terms) -> str:
    if terms.delay:
        return "DelayedPDActuatorCfg"
    if terms.drive == "position_servo" or terms.torque_limit is None:
        return "ImplicitActuatorCfg"
    return "IdealPDActuatorCfg" if dc_motor(terms) is None else "DCMotorCfg"


def _entry(joint: str, terms: Terms, joint_type: JointType = "revolute") -> list[str]:
    servo, kind, motor = terms.drive == "position_servo", _kind(terms), dc_motor(terms)
    fields = {
        "joint_names_expr": _joint_pattern(joint),
        "stiffness": _decimal(terms.kp if servo else 0.0),
        "damping": _decimal(terms.derivative_gain if servo else 0.0),
        "armature": _decimal(terms.armature),
        "friction": _decimal(terms.frictionloss),
        "dynamic_friction": _decimal(terms.frictionloss),
        "viscous_friction": _decimal(terms.damping - (terms.derivative_gain if servo else 0.0)),
    }
    if terms.torque_limit is not None:
        explicit = kind != "ImplicitActuatorCfg"
        fields["actuator_effort_limit" if explicit else "joint_effort_limit"] = _decimal(terms.torque_limit)
        if kind == "DCMotorCfg" and motor is not None:
            voltage = terms.torque_limit / terms.kp
            fields["actuator_effort_limit"] = _decimal(2.0 * terms.torque_limit)
            fields["saturation_effort"] = _decimal(terms.torque_limit)
            fields["actuator_velocity_limit"] = _decimal(voltage / motor.torque_constant)
            fields["viscous_friction"] = _decimal(motor.damping)
    fields |= _delay_fields(terms)
    efforts = f"{number(terms.kp)} N m for one unit of the drive's command"
    if kind == "DCMotorCfg" and motor is not None:
        efforts = f"{number(terms.kp)} (V - {number(motor.torque_constant)} v) N m at the voltage V and the velocity v"
    told = in_units_of(joint_type, f"    # efforts are torques: {efforts}")
    note = [] if servo else [told.replace("torques", "forces") if joint_type == "prismatic" else told]
    return [*note, f"    {joint!r}: {kind}(", *(f"        {k}={v}," for k, v in fields.items()), "    ),"]


@dataclass(frozen=True)
class ServoSettings:
    """What the logs of a drive on a voltage do not tell of its servo.

    Attributes:
        supply_voltage: vin [V].
        position_gain: P of the voltage P (q_d - q) [V/rad].

    Raises:
        ParamsError: a number that is not finite or not positive.
    """

    supply_voltage: float
    position_gain: float

    def __post_init__(self) -> None:
        """Check."""
        options = (("--supply-voltage", self.supply_voltage, "V"), ("--position-gain", self.position_gain, "V/rad"))
        for option, value, unit in options:
            if not 0.0 < value < math.inf:
                raise ParamsError(f"export: {option}: expected a positive number [{unit}], got {value:g}")


def limited_by_supply(projection: Projection, settings: ServoSettings) -> Projection:
    """The projection with the loss of a limit of the voltage that the supply does not reach."""
    terms = projection.terms
    if terms.torque_limit is None or terms.torque_limit <= terms.kp * settings.supply_voltage:
        return projection
    limits = f"{settings.supply_voltage:.6g} V, the model to {terms.torque_limit / terms.kp:.6g} V"
    lost = Loss("saturation", f"the supply limits the voltage to {limits}", partly=True)
    return replace(projection, losses=(*projection.losses, lost))


def to_isaaclab_bam(projections: Sequence[Projection], settings: ServoSettings) -> str:
    """The text of a Python module whose ACTUATORS goes into an ArticulationCfg, with the settings of all servos.

    Raises:
        ParamsError: another drive than a voltage, or no torque constant (`with_torque_constant`).
    """
    entries = [_bam_entry(projection, settings) for projection in projections]
    return _module("isaaclab", ("BamActuatorCfg", "BamMotorCfg"), entries)


def _bam_entry(projection: Projection, settings: ServoSettings) -> list[str]:
    terms, joint = projection.terms, projection.joint
    motor = voltage_motor(projection, "isaaclab-bam")
    model, friction = bam_friction(terms, motor)
    supply = settings.supply_voltage
    duty = 1.0 if terms.torque_limit is None else min(1.0, terms.torque_limit / terms.kp / supply)
    fit = {
        "model": repr(model),
        "kt": _decimal(motor.torque_constant),
        "resistance": _decimal(motor.resistance),
        "error_gain": _decimal(settings.position_gain / supply),
        "max_pwm": _decimal(duty),
        "max_current": "0.0",
        **{name: _decimal(value) for name, value in friction.items()},
    }
    fields = {
        "actuator_effort_limit": _decimal(2.0 * motor.torque_constant * supply / motor.resistance),
        "kp_fw": "1.0",
        "vin": _decimal(supply),
        "armature": _decimal(terms.armature),
        **_delay_fields(terms),
    }
    return [
        f"    {joint!r}: BamActuatorCfg(",
        f"        joint_names_expr={_joint_pattern(joint)},",
        "        motor=BamMotorCfg(",
        *(f"            {name}={value}," for name, value in fit.items()),
        "        ),",
        *(f"        {name}={value}," for name, value in fields.items()),
        "    ),",
    ]


NO_LIMIT = 1e6
"""Limit of a command of a motor that has none: the configuration needs a number."""


def to_mjlab_actuators(projections: Sequence[Projection]) -> str:
    """The text of a Python module whose ACTUATORS go into an EntityArticulationInfoCfg."""
    names = {name for each in projections for name in _names(each.terms)}
    return _module("mjlab", names, [_mjlab_entry(each) for each in projections])


def _names(terms: Terms) -> tuple[str, ...]:
    if terms.drive == "position_servo":
        return ("BuiltinPositionActuatorCfg",)
    if dc_motor(terms) is None:
        return ("BuiltinMotorActuatorCfg",)
    return "BuiltinDcMotorActuatorCfg", "DcMotorInputMode", "DcMotorPhysicalParams"


def _mjlab_entry(projection: Projection) -> list[str]:
    terms, motor = projection.terms, dc_motor(projection.terms)
    fields = {
        "target_names_expr": f"({re.escape(projection.joint)!r},)",
        "armature": _decimal(terms.armature),
        "frictionloss": _decimal(terms.frictionloss),
        "viscous_damping": _decimal(terms.damping),
    }
    if terms.delay:
        steps = str(round(terms.delay / PHYSICS_STEP))
        fields |= {"delay_min_lag": steps, "delay_max_lag": steps}
    note = []
    if terms.drive == "position_servo":
        limit = {} if terms.torque_limit is None else {"effort_limit": _decimal(terms.torque_limit)}
        fields["viscous_damping"] = _decimal(terms.damping - terms.derivative_gain)
        fields |= {"stiffness": _decimal(terms.kp), "damping": _decimal(terms.derivative_gain), **limit}
    elif motor is None:
        bound = NO_LIMIT if terms.torque_limit is None else terms.torque_limit / terms.kp
        fields |= {"gear": _decimal(terms.kp), "effort_limit": _decimal(bound)}
        told = in_units_of(projection.joint_type, f"    # efforts are commands: {number(terms.kp)} N m for one unit")
        note = [told]
    else:
        fields |= _motor_fields(terms, motor)
        note = ["    # efforts are voltages"]
    return [*note, f"    {_names(terms)[0]}(", *(f"        {key}={value}," for key, value in fields.items()), "    ),"]


def _motor_fields(terms: Terms, motor: DcMotor) -> dict[str, str]:
    kt, resistance = _decimal(motor.torque_constant), _decimal(motor.resistance)
    fields = {
        "motor_params": f"DcMotorPhysicalParams(kt={kt}, ke={kt}, resistance={resistance})",
        "mode": "DcMotorInputMode.VOLTAGE",
        "viscous_damping": _decimal(motor.damping),
    }
    if terms.torque_limit is not None:
        fields["voltage_limit"] = _decimal(terms.torque_limit / terms.kp)
    if terms.lag:
        fields["electrical_time_constant"] = _decimal(terms.lag)
    if terms.stribeck is not None:
        fields |= {"lugre": _tuple(lugre_of(terms)), "frictionloss": "0.0"}
    if terms.ripple is not None:
        fields["cogging"] = _tuple(cogging_of(terms.ripple))
    return fields


def _tuple(numbers: Sequence[float]) -> str:
    return f"({', '.join(map(_decimal, numbers))})"
