"""The recorded channels of one joint: the usable stretches of all runs, end to end at one period.

A command or effort acts later than its sample where it is held until the next one, and earlier where it is recorded
late: `aged` shifts it. A drive whose report has a dead zone reports no effort while the joint moves: `silent_effort`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from drake_tc.diagnosis.notes import LogRemark, RunNote, SilentEffort
from drake_tc.errors import IdentificationError
from drake_tc.logs.channels import at_common_period, grid_step
from drake_tc.logs.record import Run, concerns
from drake_tc.types import BoolArray, FloatArray, IntArray

SHORTEST = 40
"""A usable stretch has more samples than this."""
HELD = 0.5
"""Age of an effort that is held until the next sample [sampling periods]: the mean over one period."""
SILENT = 0.3
"""Share of the samples in motion, from which on exact zeros are no coincidence of a current that changes its sign."""


@dataclass(frozen=True)
class Channels:
    """The usable stretches of all runs, end to end.

    One filter pass goes over all of them: what leaks across a joint stays inside the margins that no row uses.
    """

    joint: str
    pieces: tuple[tuple[int, Run, slice], ...]
    period: float

    @property
    def segments(self) -> tuple[slice, ...]:
        """Where each stretch lies in the joined arrays."""
        lengths = [s.stop - s.start for _, _, s in self.pieces]
        return tuple(slice(int(e - n), int(e)) for e, n in zip(np.cumsum(lengths), lengths, strict=True))

    @property
    def run_of_sample(self) -> IntArray:
        """(T,) index of the run."""
        return np.repeat([i for i, _, _ in self.pieces], [s.stop - s.start for _, _, s in self.pieces])

    @property
    def time(self) -> FloatArray:
        """(T,) since the start of each run [s]."""
        return np.concatenate([run.time[s] - run.time[0] for _, run, s in self.pieces])

    @property
    def speed_only(self) -> bool:
        """Whether the position is the integral of the recorded velocity."""
        return any(self.joint in run.speed_only for _, run, _ in self.pieces)

    def step(self, name: str) -> float:
        """Step of the recorded values of `<joint>/name`, the median of the runs'; 0 where they lie on no grid."""
        column = f"{self.joint}/{name}"
        runs = {id(run): run for _, run, _ in self.pieces if column in run.columns}
        found = [
            grid_step(run.columns[column]) if run.source is None else run.steps.get(column, 0.0)
            for run in runs.values()
        ]
        return float(np.median(found)) if found else 0.0

    def slowest(self, names: Sequence[str]) -> float:
        """Longest period [s] at which one of the columns was sampled; at least that of the log."""
        sampled = [run.slower.get(name, self.period) for _, run, _ in self.pieces for name in names]
        return max(self.period, *sampled)

    def ratios(self, name: str) -> list[float]:
        """Of each stretch, the period at which `<joint>/name` was sampled over that of the log, at least 1."""
        column = f"{self.joint}/{name}"
        return [max(run.slower.get(column, self.period) / self.period, 1.0) for _, run, _ in self.pieces]

    def notes(self, runs: Sequence[Run]) -> tuple[LogRemark, ...]:
        """What was done to the runs as they came and at the common period."""
        both = (LogRemark(run.name, note) for run in (*runs, *(run for _, run, _ in self.pieces)) for note in run.notes)
        return tuple(dict.fromkeys(both))

    def raw(self, name: str) -> FloatArray:
        """(T,) of `<joint>/name`, NaN in runs that did not record it."""
        column = f"{self.joint}/{name}"
        return np.concatenate(
            [
                np.asarray(run.columns[column][s], float)
                if column in run.columns
                else np.full(s.stop - s.start, np.nan)
                for _, run, s in self.pieces
            ]
        )


def channels_of(runs: Sequence[Run], joint: str) -> Channels:
    """The runs' usable stretches at one period.

    Raises:
        IdentificationError: there is none.
    """
    even = at_common_period(runs)
    pieces = tuple((i, run, s) for i, run in enumerate(even) for s in run.segments() if s.stop - s.start > SHORTEST)
    if not pieces:
        names = ", ".join(r.name for r in runs)
        raise IdentificationError(f"joint {joint}: no stretch of more than {SHORTEST} usable samples in {names}")
    return Channels(joint, pieces, float(np.median([r.period for r in even])))


def notes_of_joint(notes: Sequence[RunNote], joint: str, joints: Sequence[str]) -> tuple[RunNote, ...]:
    """The notes without the remarks of a log's reader that concern other joints alone."""
    return tuple(n for n in notes if not isinstance(n, LogRemark) or concerns(n.statement, joint, joints))


def aged(effort: FloatArray, segments: Sequence[slice], age: float) -> FloatArray:
    """Command or effort (T,) that is `age` sampling periods older.

    One that is older is held for a period (`_mean_over_hold`): one that is held from its sample to the next is `HELD`,
    half a period, old, and one that was written before or after its sample is older or less old than that. One that
    acted before it was recorded has a negative age and is shifted (`delayed`).

    Args:
        effort: (T,) of all segments, end to end.
        segments: Uniform stretches of at least two samples.
        age: [sampling periods].
    """
    return _mean_over_hold(effort, segments, age) if age > 0.0 else delayed(effort, segments, age)


def delayed(values: FloatArray, segments: Sequence[slice], periods: float) -> FloatArray:
    """Values (T,) of so many sampling periods before, on the cubic spline through the samples of each segment.

    Constant beyond the ends of a segment. A straight line between two samples would pass a frequency w at half a period
    with cos(wT/2) = 1 - (wT)^2/8: at 50 Hz, a sine of 2 Hz would be 0.8 % too small, and with it an inertia.
    """
    out = values.copy()
    if periods == 0.0:
        return out
    for s in segments:
        at = np.arange(s.stop - s.start, dtype=float)
        out[s] = CubicSpline(at, values[s])(np.clip(at - periods, 0.0, at[-1]))
    return out


def _mean_over_hold(effort: FloatArray, segments: Sequence[slice], age: float) -> FloatArray:
    """Mean (T,) over one sampling period of the cubic spline through the samples, which is `age` periods old.

    It lets a frequency w pass as a hold of one sampling period T does, with sin(wT/2)/(wT/2) = 1 - (wT)^2/24. The mean
    of two samples would pass cos(wT/2) = 1 - (wT)^2/8, and a stiffness K would make an inertia of K T^2/12 of the
    difference. Beyond the ends of a segment the spline is constant.
    """
    out = effort.copy()
    for s in segments:
        at = np.arange(s.stop - s.start, dtype=float)
        spline = CubicSpline(at, effort[s])
        integral = spline.antiderivative()
        ends = [at - age + HELD, at - age - HELD]  # of the period
        inside = [np.clip(end, 0.0, at[-1]) for end in ends]
        until = [
            integral(held) + np.where(end < held, effort[s][0], effort[s][-1]) * (end - held)
            for end, held in zip(ends, inside, strict=True)
        ]
        out[s] = until[0] - until[1]
    return out


def silent_effort(channels: Channels, column: str, effort: FloatArray, moving: BoolArray) -> tuple[SilentEffort, ...]:
    """A note on each run whose effort is exactly 0 in much of the motion: the drive's report has a dead zone."""
    if column.rpartition("/")[2] not in ("current", "torque_command"):
        return ()
    out = []
    for index in np.unique(channels.run_of_sample[moving]):
        own = moving & (channels.run_of_sample == index)
        share = float(np.mean(effort[own] == 0.0))
        if share >= SILENT:
            name = next(run.name for i, run, _ in channels.pieces if i == index)
            out.append(SilentEffort(name, column, share))
    return tuple(out)
