"""Measured and modelled effort and position of each run over time, thinned to what a screen shows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.run_errors import MODELS
from drake_tc.report.decimation import extreme_samples
from drake_tc.types import FloatArray, IntArray

GAP_ROWS = 1.5
"""Distance between neighbouring rows, in typical distances, beyond which the line is broken."""
FARTHEST = 10.0
"""A simulated position is drawn up to this many times the recorded range away from the recorded one."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One quantity of one run.

    Attributes:
        run: Name. heldout: whether the run took no part in fitting.
        time: (T,) since the start of the run [s].
        measured: (T,) NaN where the line is broken.
        errors: (T,) modelled minus measured, by model: "before", "after" or "refined", those that were computed.
    """

    run: str
    heldout: bool
    time: FloatArray
    measured: FloatArray
    errors: Mapping[str, FloatArray]

    def thinned(self, most: int) -> "Trace":
        """The same with at most about `most` samples; extremes of all lines and the widest breaks stay."""
        lines = [self.measured, *self.errors.values(), *(self.measured + e for e in self.errors.values())]
        kept = np.unique(np.concatenate([extreme_samples(lines, most), self._breaks(most // 4)]))
        errors = {name: e[kept] for name, e in self.errors.items()}
        return Trace(self.run, self.heldout, self.time[kept], self.measured[kept], errors)

    def _breaks(self, most: int) -> IntArray:
        """Indices of at most `most` breaks, the widest ones."""
        breaks = np.flatnonzero(np.isnan(self.measured[1:-1])) + 1
        width = self.time[breaks + 1] - self.time[breaks - 1]
        return np.sort(breaks[np.argsort(-width, kind="stable")[:most]]).astype(np.int64)


def effort_traces(joint: JointResult) -> Sequence[Trace]:
    """Effort of every run on the rows of the regression [effort], training runs first.

    The modelled effort is the one that the balance needs for the recorded motion and load. It is the measured effort
    plus the residual, and all of them have passed the filters of the regression.
    """
    return [*_effort(joint.train, heldout=False), *_effort(joint.heldout, heldout=True)]


def _effort(split: DataSplit, *, heldout: bool) -> Sequence[Trace]:
    samples = split.samples
    measured = samples.reduce(samples.signals.effort)
    time = samples.signals.time[samples.rows]
    out = []
    for k, run in enumerate(samples.runs):
        mine = samples.run == k
        if mine.any():
            lines = (time[mine], measured[mine], split.before[mine], split.after[mine])
            clock, effort, before, after = _with_breaks(*lines)
            out.append(Trace(run, heldout, clock, effort, {"before": before, "after": after}))
    return out


def _with_breaks(time: FloatArray, *lines: FloatArray) -> tuple[FloatArray, ...]:
    """Time and lines with one NaN sample in each gap between the rows."""
    step = np.diff(time)
    typical = float(np.median(step)) if step.size else 0.0
    gaps = np.flatnonzero(step > GAP_ROWS * typical) + 1
    clock = np.insert(time, gaps, 0.5 * (time[gaps - 1] + time[gaps]))
    return clock, *(np.insert(line, gaps, np.nan) for line in lines)


def position_traces(free_run: Mapping[str, Mapping[str, FloatArray]], heldout: Sequence[str]) -> Sequence[Trace]:
    """Position [rad] of every run that was simulated from the recorded command alone."""
    out = []
    for run, trace in free_run.items():
        recorded = trace["recorded"]
        far = FARTHEST * max(float(np.ptp(recorded)), 1e-9)
        errors = {name: np.clip(trace[name] - recorded, -far, far) for name in MODELS if name in trace}
        out.append(Trace(run, run in heldout, trace["time"], recorded, errors))
    return out
