"""What `close-loop` knows of a rig when it is done; plain data, read by the report and written to report.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, get_args

from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.notes import Note
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.residual.unexplained import Verdict
from drake_tc.diagnosis.result.applications import ClosedLoop, ExportTrial
from drake_tc.diagnosis.result.joint_result import INTERVAL_COLUMNS, JointResult, Shown
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.errors import DrakeTcError
from drake_tc.logs.rig import Rig

if TYPE_CHECKING:
    import pandas as pd

    from drake_tc.actuation.model import ActuatorModel

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


@dataclass(frozen=True)
class SharedEffect:
    """A cause that no single joint owns, found on all joints together.

    Attributes:
        id, where: What, and on which link or sensor. title: in words.
        parameters: By name.
        heldout_gain: 1 - held-out error of all joints with it / without it, each joint weighted by its noise.
        stability: Posterior probability of the robot with it, against the same robot without it.
        joints: Joint to the same gain of that joint alone.
        indistinguishable: (id, where) of causes that fit as well: these logs cannot tell them apart.
    """

    id: str
    where: str
    title: str
    parameters: Mapping[str, Estimate]
    heldout_gain: float
    stability: float
    joints: Mapping[str, float]
    indistinguishable: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, repr=False)
class CloseLoopResult(Shown):
    """The whole call: joints by name, verdict, seconds; causes that no single joint owns; what the loop makes of it.

    Its `repr` is the verdict and a table of each joint; a notebook shows the residuals too. `result["knee"]` is the
    result of one joint.

    `links` are the links' inertial parameters where the rig asks for them to be fitted.
    `set_up` is what the logs of a robot whose links are fitted say against its rig file and robot file, where the
    declared model leaves much of an effort; with `set_up.errors`, no effects were looked for.
    `rig` is what the owner said of it, with what a file of another simulator declares.
    `export` is the trial of the model in another simulator, where one was asked for.
    `hints` call for a change of the rig file or a log: a column that may have been forgotten in the rig file, a wrong
    sign, or an encoder that lost its zero; they are among the joints' notes too.
    `notes` hold for all joints and are not among the joints' own.
    """

    joints: Mapping[str, JointResult]
    verdict: Verdict
    seconds: float
    train_files: tuple[str, ...]
    heldout_files: tuple[str, ...]
    rig_file: str
    model_before_yaml: str = ""
    model_after_yaml: str = ""
    shared: tuple[SharedEffect, ...] = ()
    closed_loop: ClosedLoop | None = None
    uncertainty: TorqueUncertainty | None = None
    links: FittedLinks | None = None
    hints: tuple[str, ...] = ()
    rig: Rig | None = None
    export: ExportTrial | None = None
    set_up: SetUpCheck | None = None
    notes: tuple[Note, ...] = ()

    def __getitem__(self, joint: str) -> JointResult:
        """The result of one joint.

        Raises:
            DrakeTcError: No joint of this name; lists those that there are.
        """
        if joint not in self.joints:
            raise DrakeTcError(f"no joint {joint!r}; joints here: {', '.join(self.joints)}")
        return self.joints[joint]

    @property
    def models(self) -> "dict[str, ActuatorModel]":
        """The models after, by joint, as model_after.yaml holds them."""
        return {name: joint.model for name, joint in self.joints.items()}

    @property
    def intervals(self) -> "pd.DataFrame":
        """`JointResult.intervals` of all joints, with a first column `joint`."""
        import pandas as pd

        return pd.concat(
            [joint.intervals.assign(joint=name) for name, joint in self.joints.items()], ignore_index=True
        )[["joint", *INTERVAL_COLUMNS]]

    @property
    def has_wrong_set_up(self) -> bool:
        """Whether the logs contradict the rig file or the robot file."""
        return is_wrong(self.set_up)
