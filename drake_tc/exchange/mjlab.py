"""mjlab: a Python file with one actuator configuration a joint.

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

import re
from collections.abc import Sequence
from pathlib import Path

from drake_tc.config.joint_units import in_units_of
from drake_tc.errors import ParamsError
from drake_tc.exchange.isaaclab import decimal
from drake_tc.exchange.mjcf_actuator import DcMotor, cogging_of, dc_motor, lugre_of
from drake_tc.exchange.projection import Projection
from drake_tc.exchange.targets import PHYSICS_STEP
from drake_tc.exchange.xml_text import number
from drake_tc.simulator_files.terms import Terms

NO_LIMIT = 1e6
"""Limit of a command of a motor that has none: the configuration needs a number."""


def to_mjlab_actuators(projections: Sequence[Projection], into: Path | None = None) -> str:
    """The text of a Python module whose ACTUATORS go into an EntityArticulationInfoCfg.

    Args:
        projections: One a joint.
        into: Not possible: a configuration is a program.

    Raises:
        ParamsError: `into` is given.
    """
    if into is not None:
        raise ParamsError("--into: an mjlab configuration is a program; write a file and import ACTUATORS from it")
    names = {name for each in projections for name in _names(each.terms)}
    return "\n".join(
        [
            '"""Actuators identified by drake-tc: actuators=ACTUATORS in an EntityArticulationInfoCfg."""',
            "",
            f"from mjlab.actuator import {', '.join(sorted(names))}",
            "",
            f"PHYSICS_STEP = {PHYSICS_STEP}  # [s], in which delays are counted",
            "",
            "ACTUATORS = (",
            *(line for each in projections for line in _entry(each)),
            ")",
            "",
        ]
    )


def _names(terms: Terms) -> tuple[str, ...]:
    if terms.drive == "position_servo":
        return ("BuiltinPositionActuatorCfg",)
    if dc_motor(terms) is None:
        return ("BuiltinMotorActuatorCfg",)
    return "BuiltinDcMotorActuatorCfg", "DcMotorInputMode", "DcMotorPhysicalParams"


def _entry(projection: Projection) -> list[str]:
    terms, motor = projection.terms, dc_motor(projection.terms)
    fields = {
        "target_names_expr": f"({re.escape(projection.joint)!r},)",
        "armature": decimal(terms.armature),
        "frictionloss": decimal(terms.frictionloss),
        "viscous_damping": decimal(terms.damping),
    }
    if terms.delay:
        steps = str(round(terms.delay / PHYSICS_STEP))
        fields |= {"delay_min_lag": steps, "delay_max_lag": steps}
    note = []
    if terms.drive == "position_servo":
        limit = {} if terms.torque_limit is None else {"effort_limit": decimal(terms.torque_limit)}
        fields["viscous_damping"] = decimal(terms.damping - terms.derivative_gain)
        fields |= {"stiffness": decimal(terms.kp), "damping": decimal(terms.derivative_gain), **limit}
    elif motor is None:
        bound = NO_LIMIT if terms.torque_limit is None else terms.torque_limit / terms.kp
        fields |= {"gear": decimal(terms.kp), "effort_limit": decimal(bound)}
        told = in_units_of(projection.joint_type, f"    # efforts are commands: {number(terms.kp)} N m for one unit")
        note = [told]
    else:
        fields |= _motor_fields(terms, motor)
        note = ["    # efforts are voltages"]
    return [*note, f"    {_names(terms)[0]}(", *(f"        {key}={value}," for key, value in fields.items()), "    ),"]


def _motor_fields(terms: Terms, motor: DcMotor) -> dict[str, str]:
    kt, resistance = decimal(motor.torque_constant), decimal(motor.resistance)
    fields = {
        "motor_params": f"DcMotorPhysicalParams(kt={kt}, ke={kt}, resistance={resistance})",
        "mode": "DcMotorInputMode.VOLTAGE",
        "viscous_damping": decimal(motor.damping),
    }
    if terms.torque_limit is not None:
        fields["voltage_limit"] = decimal(terms.torque_limit / terms.kp)
    if terms.lag:
        fields["electrical_time_constant"] = decimal(terms.lag)
    if terms.stribeck is not None:
        fields |= {"lugre": _tuple(lugre_of(terms)), "frictionloss": "0.0"}
    if terms.ripple is not None:
        fields["cogging"] = _tuple(cogging_of(terms.ripple))
    return fields


def _tuple(numbers: Sequence[float]) -> str:
    return f"({', '.join(map(decimal, numbers))})"
