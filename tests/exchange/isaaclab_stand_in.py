"""Isaac Lab's actuator configurations without Isaac Lab: the fields, their types and their defaults.

ActuatorBaseCfg and its classes are those of the package isaaclab 3.0.0 on PyPI, which has no BAM, without its
deprecated names of limits. BamMotorCfg and BamActuatorCfg are those of the development branch (commit 0120677).

A field that the class does not have, one of another type than annotated (an int is no float), and one that is left out
although it has no default are errors.
"""

from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, get_args, get_origin

PerJoint = dict | float | None


@dataclass(kw_only=True)
class Checked:
    def __post_init__(self):
        for each in fields(self):
            value, place = getattr(self, each.name), f"{type(self).__name__}.{each.name}"
            assert value is not MISSING, f"{place} is missing"
            options = get_args(each.type) or (each.type,)
            found = value if get_origin(each.type) is Literal else type(value)
            assert each.type is Any or found in options, f"{place}: expected {each.type}, got {value!r}"


@dataclass(kw_only=True)
class ActuatorBaseCfg(Checked):
    class_type: Any = MISSING
    joint_names_expr: list = MISSING
    actuator_effort_limit: PerJoint = None
    actuator_velocity_limit: PerJoint = None
    joint_effort_limit: PerJoint = None
    joint_velocity_limit: PerJoint = None
    stiffness: PerJoint = MISSING
    damping: PerJoint = MISSING
    armature: PerJoint = None
    friction: PerJoint = None
    dynamic_friction: PerJoint = None
    viscous_friction: PerJoint = None


@dataclass(kw_only=True)
class ImplicitActuatorCfg(ActuatorBaseCfg):
    class_type: Any = "ImplicitActuator"


@dataclass(kw_only=True)
class IdealPDActuatorCfg(ActuatorBaseCfg):
    class_type: Any = "IdealPDActuator"


@dataclass(kw_only=True)
class DCMotorCfg(IdealPDActuatorCfg):
    class_type: Any = "DCMotor"
    saturation_effort: float = MISSING


@dataclass(kw_only=True)
class DelayedPDActuatorCfg(IdealPDActuatorCfg):
    class_type: Any = "DelayedPDActuator"
    min_delay: int = 0
    max_delay: int = 0


@dataclass(kw_only=True)
class BamMotorCfg(Checked):
    model: Literal["m1", "m2", "m5", "m6"] = MISSING
    kt: float = MISSING
    resistance: float = MISSING
    error_gain: float = MISSING
    max_pwm: float = 1.0
    max_current: float = MISSING
    friction_base: float = MISSING
    friction_viscous: float = MISSING
    friction_stribeck: float = 0.0
    dtheta_stribeck: float = 1.0
    alpha: float = 1.0
    load_friction_motor: float = 0.0
    load_friction_external: float = 0.0
    load_friction_motor_stribeck: float = 0.0
    load_friction_external_stribeck: float = 0.0
    load_friction_motor_quad: float = 0.0
    load_friction_external_quad: float = 0.0


@dataclass(kw_only=True)
class BamActuatorCfg(ActuatorBaseCfg):
    class_type: Any = None
    stiffness: PerJoint = None
    damping: PerJoint = None
    motor: BamMotorCfg = MISSING
    kp_fw: float = MISSING
    vin: float = MISSING
    vin_range: tuple | None = None
    vin_drop_gain_range: tuple | None = None
    vin_min: float | None = None
    min_delay: int = 0
    max_delay: int = 0
    delay_hold_prob: float = 0.0
    delay_update_period: int = 0
    stiff_frictionloss: bool = True


EXPORTED = (ImplicitActuatorCfg, IdealPDActuatorCfg, DCMotorCfg, DelayedPDActuatorCfg, BamActuatorCfg, BamMotorCfg)


def actuators(text: str) -> dict:
    """ACTUATORS of a module that imports its classes from isaaclab.actuators."""
    scope = {each.__name__: each for each in EXPORTED}
    line = next(line for line in text.splitlines() if line.startswith("from isaaclab.actuators import "))
    names = line.removeprefix("from isaaclab.actuators import ").split(", ")
    exec(compile(text.replace(line, ""), "cfg", "exec"), {name: scope[name] for name in names}, found := {})
    return found["ACTUATORS"]
