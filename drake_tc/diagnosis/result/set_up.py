"""What the logs of an arm say against its rig file and robot file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

SetUpErrorKind = Literal[
    "joint_reversed",
    "position_reversed",
    "effort_reversed",
    "columns_exchanged",
    "efforts_exchanged",
    "zero",
    "drive_gain",
    "gravity",
    "coupled",
    "payload",
]
SET_UP_ERRORS: tuple[SetUpErrorKind, ...] = get_args(SetUpErrorKind)
"""What is tried, in the order in which errors that explain as much are preferred."""


@dataclass(frozen=True)
class SetUpError:
    """One error.

    Attributes:
        kind: What.
        joints: Which; the two whose columns or efforts are exchanged; the one whose motor also turns with the other
            one, and that other one; empty for gravity.
        units: Entries of the rig file's `units` that mend it, for what is reversed.
        gains: By joint, the drive gain that the logs ask for, and the declared one [effort/(N m)].
        zero: Reading of the joint's column at the zero of the URDF [rad].
        gravity: Direction in which gravity acts, by the axes of the robot's base.
        turns: Of the first joint's motor for one turn of the second joint.
        mass: Of a payload [kg]. carrier: The link that carries it. runs: In which; empty for all of them.
        held_out: Whether these are held-out runs. links_fitted: whether the rig file has fitted links.
    """

    kind: SetUpErrorKind
    joints: tuple[str, ...] = ()
    units: Mapping[str, str | float] = field(default_factory=dict)
    gains: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    zero: float = 0.0
    gravity: tuple[float, float, float] = (0.0, 0.0, -1.0)
    turns: float = 0.0
    mass: float = 0.0
    carrier: str = ""
    runs: tuple[str, ...] = ()
    held_out: bool = False
    links_fitted: bool = True


@dataclass(frozen=True)
class SetUpCheck:
    """What came of looking at the set-up because the declared model leaves much of an effort.

    Attributes:
        errors: All of them together explain what is left; empty where none of those that were tried does.
        alternatives: To the last one: they explain as much.
        before, after: By joint, RMS of what the declared model leaves of the effort, as a share of the effort's, with
            the set-up as declared and without the errors.
    """

    errors: tuple[SetUpError, ...]
    alternatives: tuple[SetUpError, ...]
    before: Mapping[str, float]
    after: Mapping[str, float]


def is_wrong(check: SetUpCheck | None) -> bool:
    """Whether errors of the set-up were found."""
    return check is not None and bool(check.errors)
