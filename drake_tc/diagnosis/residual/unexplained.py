"""What is left of a residual, as data, and the next experiment: what to record to tell its causes apart.

`drake_tc.report.notes` makes the sentences.

**Equal noise.** Where the sampling instants scatter, fast motion is loud although nothing acts on the joint, and
held-out runs that are faster than the training runs leave more. Jumps of a torque on a slower clock are loud too
(`data.clocks`). The tests of what is left compare rows, stretches and runs with each other. They therefore get the
residual times

    w_i = L/sqrt(b^2 + t_i^2)

with t_i what scatter and jumps leave in row i, b what all other noise leaves, and L the RMS of sqrt(b^2 + t_i^2) over
the training rows, which is the noise floor of all weighted rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from drake_tc.diagnosis.data.noise_colour import left_by_effort_noise
from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.problem.regression import Fit
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
        weight: By which both residuals were multiplied, for equal noise, (N,) or one for all rows.
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


LEAST_OTHER_NOISE = 0.01
"""Of the noise floor, that all other noise is taken to leave at least."""
QUIET = 1.0 / 3.0
"""Share of the rows, those in which scatter and jumps leave least, that show the noise of the effort."""

AT_A_SAMPLE = 3.0
"""Variance of what jumps leave that all lie at a sample, over that of jumps anywhere between: (T/2)^2 over T^2/12."""


@dataclass(frozen=True)
class EqualNoise:
    """Both splits under equal noise.

    Attributes:
        splits: Training and held-out rows, weighted where noise grows with the speed.
        floors: Noise floor of each weighted split [effort].
        heldout: Noise floor of the held-out rows as they are [effort].
        by_effort: That floor over the same without noise of the recorded effort.
    """

    splits: tuple[DataSplit, DataSplit]
    floors: tuple[float, float]
    heldout: float
    by_effort: float

    def unweighted_floor(self, level: float) -> float:
        """Noise floor of the held-out rows as they are, where that of the weighted ones is `level` [effort]."""
        return self.heldout / self.floors[1] * level

    def unweighted(self, left: Unexplained, held: DataSplit, level: float) -> Unexplained:
        """What is left, with the figures of the held-out rows as they are.

        Args:
            left: Of the weighted rows.
            held: Held-out rows as they are.
            level: Noise floor of the weighted rows [effort].
        """
        if self.splits[1] is held:
            return left
        ratio = rms(held.after) / max(rms(self.splits[1].after), 1e-300)
        floors = rms(held.after) / self.unweighted_floor(level)
        return replace(left, floors=floors, explainable_rms=ratio * left.explainable_rms)


def with_equal_noise(splits: tuple[DataSplit, DataSplit], chosen: Fit, floor: float) -> EqualNoise:
    """The splits under equal noise; the splits themselves where it is the same in all rows.

    Args:
        splits: Training and held-out rows.
        chosen: The final model.
        floor: What the noise of encoder, torque sensor and sampling instants leaves on the training rows [effort].
    """
    scatter = [_of_scatter(each, chosen) for each in splits]
    timing = [own + _of_jumps(each, chosen, floor) for each, own in zip(splits, scatter, strict=True)]
    if not any(each.any() for each in timing):
        first, second = (float(np.hypot(floor, left_by_effort_noise(s.samples, s.after, floor))) for s in splits)
        return EqualNoise(splits, (first, second), second, second / floor)
    other = max(floor**2 - float(np.mean(scatter[0])), (LEAST_OTHER_NOISE * floor) ** 2)
    efforts = [_effort_in_quiet_rows(each, own, other) for each, own in zip(splits, timing, strict=True)]
    levels = [np.sqrt(other + each**2 + own) for each, own in zip(efforts, timing, strict=True)]
    level, heldout = rms(levels[0]), rms(levels[1])
    train, held = (
        replace(split, before=weight * split.before, after=weight * split.after, weight=weight)
        for split, weight in zip(splits, (level / own for own in levels), strict=True)
    )
    sensors = float(np.sqrt(other + np.mean(timing[1])))
    return EqualNoise((train, held), (level, level), heldout, heldout / sensors)


def _effort_in_quiet_rows(split: DataSplit, timing: FloatArray, other: float) -> float:
    """What noise of the recorded effort leaves [effort], as the rows show it in which scatter and jumps leave least."""
    quiet, samples = timing <= np.quantile(timing, QUIET), split.samples
    rows = replace(samples, rows=samples.rows[quiet], run=samples.run[quiet])
    return left_by_effort_noise(rows, split.after[quiet], float(np.sqrt(other + np.mean(timing[quiet]))))


def _of_scatter(split: DataSplit, chosen: Fit) -> FloatArray:
    """(N,) variances [effort^2] that scatter of the sampling instants leaves on the rows; the floor has them."""
    samples = split.samples
    if samples.timing is None:
        return np.zeros(split.after.size)
    known = BalanceCoefficients.of(chosen.terms, chosen.beta, samples.signals.rotor_inertia)
    return chosen.gain**2 * samples.floor.timing_variance(known.viscous, known.inertia, samples.timing)


def _of_jumps(split: DataSplit, chosen: Fit, floor: float) -> FloatArray:
    """(N,) variances [effort^2] that jumps of a torque on a slower clock leave (`between_samples`).

    Jumps that recur may all lie at the same place between the samples. They then leave all more or all less than
    jumps at any place, and the rows beside them show how much.
    """
    between = split.samples.between
    if between is None:
        return np.zeros(split.after.size)
    found = chosen.gain**2 * between
    beside = found > floor**2
    if not beside.any():
        return found
    shown = (float(np.mean(split.after[beside] ** 2)) - floor**2) / float(np.mean(found[beside]))
    return found * float(np.clip(shown, 0.0, AT_A_SAMPLE))
