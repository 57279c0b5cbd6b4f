"""Isaac Lab's BAM servo: a Python file with one `BamActuatorCfg` a joint.

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
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from drake_tc.errors import ParamsError
from drake_tc.exchange.bam import bam_friction, voltage_motor
from drake_tc.exchange.isaaclab import actuators_module, decimal, delay_fields, joint_pattern
from drake_tc.exchange.projection import Loss, Projection
from drake_tc.simulator_files.terms import Terms


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
    """The projection with the loss of a limit of the voltage that the supply does not reach.

    Args:
        projection: Of one joint.
        settings: Of its servo.
    """
    terms = projection.terms
    if terms.torque_limit is None or terms.torque_limit <= terms.kp * settings.supply_voltage:
        return projection
    limits = f"{settings.supply_voltage:.6g} V, the model to {terms.torque_limit / terms.kp:.6g} V"
    lost = Loss("saturation", f"the supply limits the voltage to {limits}", partly=True)
    return replace(projection, losses=(*projection.losses, lost))


def to_isaaclab_bam(projections: Sequence[Projection], into: Path | None, settings: ServoSettings) -> str:
    """The text of a Python module whose ACTUATORS goes into an ArticulationCfg.

    Args:
        projections: One a joint, each on a voltage and with a torque constant (`with_torque_constant`).
        into: Not possible: a configuration is a program.
        settings: Of all servos.

    Raises:
        ParamsError: `into` is given, another drive than a voltage, or no torque constant.
    """
    entries = [_entry(projection, settings) for projection in projections]
    return actuators_module(("BamActuatorCfg", "BamMotorCfg"), entries, into)


def _entry(projection: Projection, settings: ServoSettings) -> list[str]:
    terms, joint = projection.terms, projection.joint
    motor = voltage_motor(projection, "isaaclab-bam")
    model, friction = bam_friction(terms, motor)
    supply = settings.supply_voltage
    fit = {
        "model": repr(model),
        "kt": decimal(motor.torque_constant),
        "resistance": decimal(motor.resistance),
        "error_gain": decimal(settings.position_gain / supply),
        "max_pwm": decimal(_largest_duty(terms, supply)),
        "max_current": "0.0",
        **{name: decimal(value) for name, value in friction.items()},
    }
    fields = {
        "actuator_effort_limit": decimal(2.0 * motor.torque_constant * supply / motor.resistance),
        "kp_fw": "1.0",
        "vin": decimal(supply),
        "armature": decimal(terms.armature),
        **delay_fields(terms),
    }
    return [
        f"    {joint!r}: BamActuatorCfg(",
        f"        joint_names_expr={joint_pattern(joint)},",
        "        motor=BamMotorCfg(",
        *(f"            {name}={value}," for name, value in fit.items()),
        "        ),",
        *(f"        {name}={value}," for name, value in fields.items()),
        "    ),",
    ]


def _largest_duty(terms: Terms, supply: float) -> float:
    """The identified limit of the voltage as a share of the supply; the supply itself where none is known."""
    return 1.0 if terms.torque_limit is None else min(1.0, terms.torque_limit / terms.kp / supply)
