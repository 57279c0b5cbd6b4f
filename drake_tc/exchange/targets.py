"""What each target can express, and what to do about the rest."""

from collections.abc import Mapping
from types import MappingProxyType

from drake_tc.exchange.projection import Vocabulary

PHYSICS_STEP = 0.005
"""Of Isaac Lab's examples [s], in which its delays are counted."""
_NO_DELAY = "delay the commands in your controller's loop instead"
_NO_BACKLASH = "the gear has no play there"

TARGETS: Mapping[str, Vocabulary] = MappingProxyType(
    {
        "mjcf": Vocabulary(
            "MuJoCo (MJCF)",
            frozenset({"armature", "frictionloss", "quadratic", "torque_limit", "delay", "backlash"}),
            {},
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
        ),
        "drake-urdf": Vocabulary(
            "Drake (URDF)",
            frozenset({"armature", "torque_limit"}),
            {
                "frictionloss": "Drake's joints have none that is dry; put an ActuatorPlant in front of the plant",
                "delay": "put drake_tc's ActuatorPlant in front of the plant",
                "backlash": "put drake_tc's ActuatorPlant in front of the plant",
            },
            drives=frozenset({"position_servo"}),
        ),
        "sdf": Vocabulary(
            "SDFormat",
            frozenset({"frictionloss", "torque_limit"}),
            {
                "armature": "add it to the link's inertia about the axis by hand",
                "delay": _NO_DELAY,
                "backlash": _NO_BACKLASH,
            },
        ),
        "isaaclab": Vocabulary(
            "Isaac Lab",
            frozenset({"armature", "frictionloss", "torque_limit", "delay"}),
            {"backlash": _NO_BACKLASH},
            drives=frozenset({"position_servo"}),
            delay_step=PHYSICS_STEP,
        ),
        "isaaclab-bam": Vocabulary(
            "Isaac Lab (BAM)",
            frozenset({"armature", "frictionloss", "stribeck", "load_friction", "torque_limit", "delay"}),
            {"backlash": "BamBacklashActuatorCfg has it where the USD has a hinge passive_NAME_backlash"},
            drives=frozenset({"voltage"}),
            inexact={
                "load_friction": "the load is that of the solver's last step",
                "delay": "the position command is delayed there, the position that the servo measures is not",
            },
            delay_step=PHYSICS_STEP,
        ),
        "bam": Vocabulary(
            "BAM",
            frozenset({"armature", "frictionloss", "stribeck", "load_friction", "delay"}),
            {"backlash": _NO_BACKLASH, "torque_limit": "BAM limits the voltage by the supply"},
            drives=frozenset({"voltage"}),
            inexact={"load_friction": "the load is gravity and what is outside there, without the link's inertia"},
        ),
    }
)
"""Name on the command line to vocabulary."""
