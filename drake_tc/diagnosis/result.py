"""What `close-loop` knows of a joint when it is done; plain data, read by the report and written to report.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.closed_loop import ClosedLoop
from drake_tc.diagnosis.design import Fit
from drake_tc.diagnosis.samples import Samples
from drake_tc.effects.base import DriveKind
from drake_tc.types import FloatArray

Verdict = Literal["effects_found", "no_missing_effect", "unexplained_structure"]


@dataclass(frozen=True)
class Errors:
    """RMS of the model equation [effort] on rows in motion, and of the free-running diagram's position [rad]."""

    train: float
    heldout: float
    free_run_heldout: float | None


@dataclass(frozen=True)
class Estimate:
    """One parameter: value, unit, 95 % interval that accounts for autocorrelation, and whether it rests on a bound."""

    value: float
    unit: str
    ci95: tuple[float, float]
    at_bound: bool


@dataclass(frozen=True)
class FoundEffect:
    """An effect that the model lacked.

    Attributes:
        heldout_gain: 1 - held-out error with it / without it (the other effects refitted).
        stability: Share of block resamples of the training runs in which it belongs to the best set of this size.
        contribution: RMS of what it adds, on held-out rows [effort].
    """

    key: str
    id: str
    title: str
    parameters: Mapping[str, Estimate]
    heldout_gain: float
    stability: float
    contribution: float


@dataclass(frozen=True)
class RejectedEffect:
    """An effect that was tried on top of the final model and not added."""

    key: str
    id: str
    heldout_gain: float
    train_gain: float
    why: str


@dataclass(frozen=True)
class TimeStretch:
    """A stretch of one run in which the residual stands out: run, start and end since its start [s]."""

    run: str
    start: float
    end: float


@dataclass(frozen=True)
class Unexplained:
    """What is left in the held-out residual.

    Attributes:
        fraction: Share of its variance that some function of the measured signals could still explain.
        structured: Whether that, or its confinement in time, is more than noise leaves.
        depends_on: The signals that function needs, most important first; "time" for what only time explains.
        confined_to: Stretches that hold most of it.
        period_hz: Frequency of a line in its spectrum, or None.
        ceiling: RMS that would be left if that function were known [effort].
    """

    fraction: float
    structured: bool
    depends_on: tuple[str, ...]
    confined_to: tuple[TimeStretch, ...] = ()
    period_hz: float | None = None
    ceiling: float = float("nan")


@dataclass(frozen=True)
class Side:
    """Rows of one side (training or held-out), for plots: signals of the rows, residual before and after [effort]."""

    samples: Samples
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True)
class JointResult:
    """One joint's diagnosis."""

    joint: str
    drive: DriveKind
    unit: str
    baseline: Fit
    final: Fit
    baseline_parameters: Mapping[str, Mapping[str, Estimate]]
    final_parameters: Mapping[str, Mapping[str, Estimate]]
    noise_floor: float
    before: Errors
    after: Errors
    effects: tuple[FoundEffect, ...]
    rejected: tuple[RejectedEffect, ...]
    indistinguishable: tuple[tuple[str, str], ...]
    next_experiment: str | None
    unexplained: Unexplained
    verdict: Verdict
    train: Side
    heldout: Side
    free_run: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class SharedEffect:
    """A cause that no single joint owns, found on all joints together.

    Attributes:
        id, where: What, and on which link or sensor. title: in words.
        parameters: By name.
        heldout_gain: 1 - held-out error of all joints with it / without it, each joint weighted by its noise.
        stability: Share of resamples of the held-out half seconds in which it helps.
        joints: Joint to the same gain of that joint alone.
        ties: (id, where) of causes that fit as well: these logs cannot tell them apart.
    """

    id: str
    where: str
    title: str
    parameters: Mapping[str, Estimate]
    heldout_gain: float
    stability: float
    joints: Mapping[str, float]
    ties: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class CloseLoopResult:
    """The whole call: joints by name, verdict, seconds; causes that no single joint owns; what the loop makes of it."""

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
