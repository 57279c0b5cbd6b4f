"""What `close-loop` knows of a joint when it is done; plain data, read by the report and written to report.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from drake_tc.control.torque_uncertainty_file import TorqueUncertainty
from drake_tc.diagnosis.closed_loop import ClosedLoop
from drake_tc.diagnosis.regression import Fit
from drake_tc.diagnosis.samples import Samples
from drake_tc.effects.base import DriveKind
from drake_tc.types import FloatArray

Verdict = Literal["effects_found", "no_missing_effect", "unexplained_structure", "unexplained_residual"]
SEVERITY: tuple[Verdict, ...] = (
    "unexplained_structure",
    "unexplained_residual",
    "effects_found",
    "no_missing_effect",
)
"""Verdicts; that of a whole rig is the first of these that one of its joints has."""
Withdrawal = Literal["implausible", "below_resolution", "training_run_against", "heldout_run_against"]
"""Why an effect that the search chose is not part of the model after."""
Rejection = Literal["too_little_gain", "below_floor", "unstable", "imperfect_form", "cannot_be_looked_for", "untested"]
"""Why an effect was tried and not added, or could not be tried."""


@dataclass(frozen=True)
class Errors:
    """RMS of the model equation [effort] on rows in motion, and of the free-running diagram's position [rad]."""

    train: float
    heldout: float
    free_run_heldout: float | None


@dataclass(frozen=True)
class RunErrors:
    """Errors of the model equation on one run [effort].

    Attributes:
        run: Name. heldout: whether it took no part in fitting. rows: number of rows.
        before, after: RMS. mean_absolute_before, mean_absolute_after: mean absolute error.
    """

    run: str
    heldout: bool
    rows: int
    before: float
    after: float
    mean_absolute_before: float
    mean_absolute_after: float


@dataclass(frozen=True)
class SharedBand:
    """The band in which the model explains at least half of the effort's power, and what is left in it.

    Attributes:
        limit_hz: End of the band [Hz].
        train, heldout: RMS of the residual after, below the limit [effort].
    """

    limit_hz: float
    train: float
    heldout: float


@dataclass(frozen=True)
class ParameterByCondition:
    """One coefficient of the final model, refitted in each part of the rows.

    Attributes:
        effect, name: Which; the effect is "drive" for the drive gain.
        by: What parts the rows: "run", "load" or "direction".
        values: Part to (value, lower, upper end of the 95 % interval).
        change: Spread of the values as a share of their mean size.
        probability: Of such differences under one common value.
        moves: Whether the value changes by more than its intervals.
    """

    effect: str
    name: str
    by: str
    values: Mapping[str, tuple[float, float, float]]
    change: float
    probability: float
    moves: bool


@dataclass(frozen=True)
class DidNotHold:
    """An effect that the training runs chose and that is not believed.

    Attributes:
        key, id, title: Of the effect. reason: as a word. why: one sentence with figures.
        heldout_gain: 1 - held-out error with it / without it; None where it was never part of the model.
    """

    key: str
    id: str
    title: str
    reason: Withdrawal
    why: str
    heldout_gain: float | None = None


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
        robot_gain: Of a robot: 1 - held-out error of all joints with it / without it, each joint weighted by its noise,
            which compares with `SharedEffect.heldout_gain`. None for joints whose loads are measured.
    """

    key: str
    id: str
    title: str
    parameters: Mapping[str, Estimate]
    heldout_gain: float
    stability: float
    contribution: float
    robot_gain: float | None = None


@dataclass(frozen=True)
class RejectedEffect:
    """An effect that was tried on top of the final model and not added, or that could not be tried.

    Attributes:
        key, id: Of the effect.
        heldout_gain, train_gain: 1 - error with it / without it, held out and cross-validated; 0 where not tried.
        reason: As a word. obstacle: why it could not be tried, in words; "" where it was.
        share: Of the block resamples in which it helped.
    """

    key: str
    id: str
    heldout_gain: float
    train_gain: float
    reason: Rejection
    obstacle: str = ""
    share: float = 0.0


@dataclass(frozen=True)
class TimeStretch:
    """A stretch of one run in which the residual stands out: run, start and end since its start [s]."""

    run: str
    start: float
    end: float


@dataclass(frozen=True)
class Unexplained:
    """What is left in the residual.

    Attributes:
        floors: RMS of the held-out residual in noise floors. floors_anywhere: the same of the worse of both splits.
        excess: Whether that is more than the noise floor explains.
        share_of_signal: RMS of the held-out residual over that of the effort.
        fraction: Share of its variance that some function of the recorded signals could still explain.
        structured: Whether that, or its confinement in time, is more than noise leaves.
        depends_on: The signals that function needs, most important first; "time" for what only time explains.
        confined_to: Stretches that hold most of it.
        period_hz: Frequency of a line in its spectrum, or None.
        explainable_rms: RMS that would be left if that function were known [effort].
    """

    floors: float
    floors_anywhere: float
    excess: bool
    share_of_signal: float
    fraction: float
    structured: bool
    depends_on: tuple[str, ...]
    confined_to: tuple[TimeStretch, ...] = ()
    period_hz: float | None = None
    explainable_rms: float = float("nan")

    def with_floors(self, heldout: float, anywhere: float, *, excess: bool) -> "Unexplained":
        """The same held against another noise floor."""
        return replace(self, floors=heldout, floors_anywhere=anywhere, excess=excess)


@dataclass(frozen=True)
class DataSplit:
    """Rows of the training or the held-out runs: signals, residual before and after [effort], by one drive gain."""

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
    train: DataSplit
    heldout: DataSplit
    did_not_hold: tuple[DidNotHold, ...] = ()
    runs: tuple[RunErrors, ...] = ()
    consistency: tuple[ParameterByCondition, ...] = ()
    shared_band: SharedBand | None = None
    free_run: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def gain_identified(self) -> bool:
        """Whether the interval of the drive gain is narrower than the gain itself."""
        gain = self.final_parameters["drive"]["gain"]
        return gain.ci95[1] - gain.ci95[0] < abs(gain.value)


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
