"""What is known of a robot when it is diagnosed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.diagnosis.result.rig_result import SetUpCheck, SharedEffect
from drake_tc.logs.record import Run


@dataclass(frozen=True)
class RobotResult:
    """What was found on a robot.

    Attributes:
        joints: By name; errors and models "before" are those of loads without the sensors' errors within tolerance.
        shared: Causes that no single joint owns, by held-out gain.
        held: Held-out runs with the loads of the model before.
        held_after: The same without the shared causes. train_after: training runs without them.
        robot_gains: (joint, effect key) to the effect's held-out gain of the whole robot, which compares with
            `SharedEffect.heldout_gain`.
        links: The links' parameters where they were fitted.
        set_up: Of a robot with a fixed base, where the declared model leaves much of an effort.
    """

    joints: Mapping[str, JointResult]
    shared: tuple[SharedEffect, ...]
    held: Sequence[Run] = field(default=())
    held_after: Sequence[Run] = field(default=())
    train_after: Sequence[Run] = field(default=())
    robot_gains: Mapping[tuple[str, str], float] = field(default_factory=dict)
    links: FittedLinks | None = None
    set_up: SetUpCheck | None = None
