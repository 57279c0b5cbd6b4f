"""What is left of a residual, as data, and the next experiment: what to record to tell its causes apart.

`drake_tc.report.notes` makes the sentences.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.types import FloatArray

Verdict = Literal["effects_found", "no_missing_effect", "unexplained_structure", "unexplained_residual", "cannot_tell"]


EXPLAINED = 0.5
"""Share of the residual from which on a line of its spectrum is attributed to the signals that explain it."""
SEVERITY: tuple[Verdict, ...] = (
    "unexplained_structure",
    "unexplained_residual",
    "effects_found",
    "cannot_tell",
    "no_missing_effect",
)
"""Verdicts; that of a whole rig is the first of these that one of its joints has."""


@dataclass(frozen=True)
class DataSplit:
    """Rows of the training or the held-out runs: signals, residual before and after [effort], by one drive gain.

    Attributes:
        weight: By which both residuals were multiplied (`equal_noise`), (N,) or one for all rows.
        of_runs: (N,) what friction that differs from run to run adds to `after`, or 0.
    """

    samples: Samples
    before: FloatArray
    after: FloatArray
    weight: FloatArray | float = 1.0
    of_runs: FloatArray | float = 0.0


@dataclass(frozen=True)
class SharedBand:
    """The band in which the model explains at least half of the effort's power, and what is left in it.

    Attributes:
        limit_hz: End of the band [Hz]; 0 where there is no such band.
        train, heldout: RMS of the residual after, below the limit [effort]; NaN where there is no such band.
    """

    limit_hz: float
    train: float
    heldout: float


@dataclass(frozen=True)
class TimeStretch:
    """A stretch of one run in which the residual stands out: run, start and end since its start [s]."""

    run: str
    start: float
    end: float


@dataclass(frozen=True)
class BeyondTraining:
    """Nearly all of the held-out residual lies where a signal goes beyond its range in the training runs.

    Attributes:
        signal: Name of the signal, one of `structure.FEATURES` or "effort".
        runs: Held-out runs in which it goes beyond this range.
        trained, reached: Smallest and largest value in the training runs and in the held-out runs.
        share: Share of the held-out residual's energy outside the range of the training runs.
        unit: Unit of the effort, which drive and type of joint decide; empty for other signals.
    """

    signal: str
    runs: tuple[str, ...]
    trained: tuple[float, float]
    reached: tuple[float, float]
    share: float
    unit: str = ""


@dataclass(frozen=True)
class Unexplained:
    """What is left in the residual.

    Attributes:
        floors: RMS of the held-out residual in noise floors.
        floors_anywhere: The largest of that, of the training runs', and of any held-out run's by itself.
        excess: Whether that is more than the noise floor explains.
        share_of_signal: RMS of the held-out residual over that of the effort.
        fraction: Share of its variance that some function of the recorded signals could still explain.
        structured: Whether that, or its confinement in time, is more than noise leaves.
        depends_on: The signals that function needs, most important first; "time" for what only time explains.
        confined_to: Stretches that hold most of it.
        period_hz: Frequency of a line in its spectrum, or None.
        explainable_rms: RMS that would be left if that function were known [effort].
        beyond: The signal beyond whose training range nearly all of it lies, or None.
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
    beyond: BeyondTraining | None = None


@dataclass(frozen=True)
class TellApart:
    """Show each of two effects alone, by id: these logs cannot tell them apart."""

    first: str
    second: str


@dataclass(frozen=True)
class RepeatRun:
    """Repeat a run: between `start` and `end` [s] something acted that the log does not show."""

    run: str
    start: float
    end: float


@dataclass(frozen=True)
class CoverRange:
    """Record a training run that covers the whole range of a signal: outside the trained range, effects extrapolate."""

    beyond: BeyondTraining


@dataclass(frozen=True)
class FindPeriodicSource:
    """Look for what acts on the joint at this frequency.

    Attributes:
        frequency_hz: Of the line. among_joints: whether the robot has other joints, which may move at this frequency.
    """

    frequency_hz: float
    among_joints: bool = False


@dataclass(frozen=True)
class VarySignals:
    """Vary the signals, by name, on which what is left depends: each alone, the others unchanged."""

    signals: tuple[str, ...]


@dataclass(frozen=True)
class RepeatUnchanged:
    """Repeat one run unchanged: what is left has structure that depends on no recorded signal."""


NextExperiment = TellApart | CoverRange | RepeatRun | FindPeriodicSource | VarySignals | RepeatUnchanged


def next_experiment(
    alternatives: Sequence[tuple[str, str]],
    unexplained: Unexplained,
    *,
    among_joints: bool = False,
) -> NextExperiment | None:
    """What to do first; None when nothing is open."""
    if alternatives:
        return TellApart(*alternatives[0])
    if unexplained.beyond is not None:
        return CoverRange(unexplained.beyond)
    if unexplained.confined_to:
        stretch = unexplained.confined_to[0]
        return RepeatRun(stretch.run, stretch.start, stretch.end)
    signals = tuple(name for name in unexplained.depends_on if name != "time")
    if unexplained.period_hz is not None and not (signals and unexplained.fraction >= EXPLAINED):
        return FindPeriodicSource(unexplained.period_hz, among_joints)
    if unexplained.structured:
        return VarySignals(signals) if signals else RepeatUnchanged()
    return None
