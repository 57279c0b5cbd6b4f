"""What each target can express, and what to do about the rest."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from drake_tc.exchange.projection import Vocabulary
from drake_tc.simulator_files.terms import Terms

PHYSICS_STEP = 0.005
"""Of Isaac Lab's examples [s], in which its delays are counted."""
_NO_DELAY = "delay the commands in your controller's loop instead"
_NO_BACKLASH = "the target's gear has no play"
_REDUCED_MJCF = frozenset(
    {"armature", "frictionloss", "torque_limit", "backlash", "stiffness", "preload", "compliance", "derivative_gain"}
)
"""What readers of MJCF other than MuJoCo itself take."""
_DELAYED_POSITION = "the target delays the position command, and not the position that the servo measures"


def _no_motor(_terms: Terms) -> str:
    return "the back-EMF is a part of the viscous friction in the target"


def _no_motor_of_isaaclab(terms: Terms) -> str:
    """Why a `DCMotorCfg` cannot be written."""
    if terms.delay:
        why = "a delay needs a DelayedPDActuatorCfg, which has no line of torque over speed"
    elif terms.torque_limit is None:
        why = "a DCMotorCfg needs a limit of the voltage, and the model has none"
    else:
        return ""
    return f"{why}; the efforts do not include the back-EMF, which is a part of viscous_friction"


TARGETS: Mapping[str, Vocabulary] = MappingProxyType(
    {
        "mjcf": Vocabulary(
            "MuJoCo (MJCF)",
            frozenset({"armature", "frictionloss", "quadratic", "torque_limit", "delay", "backlash"})
            | {"stiffness", "preload", "lag", "integral_rate", "stribeck", "ripple", "compliance", "derivative_gain"},
            {},
            stribeck_exponent=2.0,
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
        ),
        "mjlab": Vocabulary(
            "mjlab",
            frozenset({"armature", "frictionloss", "torque_limit", "delay", "derivative_gain"}),
            {"backlash": _NO_BACKLASH},
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
            delay_step=PHYSICS_STEP,
        ),
        "playground": Vocabulary(
            "MuJoCo Playground (MJX)",
            _REDUCED_MJCF | {"lag"},
            {"delay": _NO_DELAY},
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
            no_motor=_no_motor,
        ),
        "newton": Vocabulary(
            "Newton",
            _REDUCED_MJCF,
            {"delay": _NO_DELAY},
            drives=frozenset({"position_servo", "current", "voltage", "torque"}),
        ),
        "urdf": Vocabulary(
            "URDF",
            frozenset({"frictionloss", "torque_limit"}),
            {
                "armature": "export to drake-urdf or mjcf, which have it",
                "delay": _NO_DELAY,
                "backlash": _NO_BACKLASH,
            },
            no_motor=_no_motor,
        ),
        "drake-urdf": Vocabulary(
            "Drake (URDF)",
            frozenset({"armature", "torque_limit", "derivative_gain"}),
            {
                "frictionloss": "Drake's joints have none that is dry; put an ActuatorPlant in front of the plant",
                "delay": "put drake_tc's ActuatorPlant in front of the plant",
                "backlash": "put drake_tc's ActuatorPlant in front of the plant",
            },
            drives=frozenset({"position_servo"}),
            no_motor=_no_motor,
        ),
        "sdf": Vocabulary(
            "SDFormat",
            frozenset({"frictionloss", "torque_limit", "stiffness", "preload"}),
            {
                "armature": "add it to the link's inertia about the axis by hand",
                "delay": _NO_DELAY,
                "backlash": _NO_BACKLASH,
            },
            no_motor=_no_motor,
        ),
        "isaaclab": Vocabulary(
            "Isaac Lab",
            frozenset({"armature", "frictionloss", "torque_limit", "delay"}),
            {"backlash": _NO_BACKLASH},
            drives=frozenset({"position_servo"}),
            delay_step=PHYSICS_STEP,
            no_motor=_no_motor_of_isaaclab,
        ),
        "isaaclab-bam": Vocabulary(
            "Isaac Lab (BAM)",
            frozenset({"armature", "frictionloss", "stribeck", "load_friction", "torque_limit", "delay"}),
            {
                "backlash": "add a hinge for the play to the USD and name it: passive_NAME_backlash of a"
                " BamBacklashActuatorCfg, or the field backlash_joint_template of BamActuatorCfg, whichever your"
                " version of Isaac Lab has"
            },
            drives=frozenset({"voltage"}),
            inexact={
                "load_friction": "its load is that of the last step of the solver",
                "delay": _DELAYED_POSITION,
            },
            delay_step=PHYSICS_STEP,
        ),
        "bam": Vocabulary(
            "BAM",
            frozenset({"armature", "frictionloss", "stribeck", "load_friction", "delay"}),
            {"backlash": _NO_BACKLASH, "torque_limit": "BAM limits the voltage by the supply"},
            drives=frozenset({"voltage"}),
            inexact={
                "load_friction": "its load consists of gravity and external forces, without the inertia of the link",
                "delay": _DELAYED_POSITION,
            },
        ),
    }
)
"""Name on the command line to vocabulary."""
MJLAB_MOTOR = replace(
    TARGETS["mjlab"],
    terms=TARGETS["mjlab"].terms | {"stribeck", "ripple", "lag"},
    inexact={"torque_limit": "MuJoCo does not apply the limit of a commanded voltage: clip your commands"},
    stribeck_exponent=2.0,
)
"""mjlab's `BuiltinDcMotorActuatorCfg`, which needs a drive on a voltage and its torque constant."""


def vocabulary(target: str, drive: str, torque_constant: float | None) -> Vocabulary:
    """What a target can express of a drive.

    Args:
        target: Name on the command line.
        drive: Kind of drive.
        torque_constant: Of a data sheet [N m/A]; None: not known.
    """
    if target == "mjlab" and drive == "voltage" and torque_constant is not None:
        return MJLAB_MOTOR
    return TARGETS[target]
