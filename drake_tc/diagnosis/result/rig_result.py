"""What `close-loop` knows of a rig when it is done; plain data, read by the report and written to report.json."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.notes import Note
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.residual.unexplained import Verdict
from drake_tc.diagnosis.result.closed_loop import ClosedLoop
from drake_tc.diagnosis.result.export_trial import ExportTrial
from drake_tc.diagnosis.result.joint_result import INTERVAL_COLUMNS, JointResult
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.diagnosis.result.set_up import SetUpCheck, is_wrong
from drake_tc.diagnosis.result.shown import Shown
from drake_tc.errors import DrakeTcError
from drake_tc.logs.rig import Rig

if TYPE_CHECKING:
    import pandas as pd

    from drake_tc.actuation.model import ActuatorModel


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
