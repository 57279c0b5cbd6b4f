"""Errors of the model equation and of the free runs, run by run."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.notes import RunsWithoutMotion
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import JointResult, RunErrors
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.types import FloatArray

MODELS = ("before", "after", "refined")
"""Models whose free runs there may be."""


def run_errors(splits: Sequence[DataSplit]) -> Iterator[RunErrors]:
    """Errors of every run, training runs first."""
    for split, heldout in zip(splits, (False, True), strict=True):
        for number, name in enumerate(split.samples.runs):
            mine = split.samples.run == number
            if mine.any():
                before, after = split.before[mine], split.after[mine]
                absolute = [float(np.mean(np.abs(x))) for x in (before, after)]
                yield RunErrors(name, heldout, int(mine.sum()), rms(before), rms(after), *absolute)


def mean_absolute_errors(joint: JointResult) -> dict[str, dict[str, float | None]]:
    """Mean absolute errors of the models before and after, under the names that their RMS has in `Errors`."""
    out: dict[str, dict[str, float | None]] = {}
    for name in ("before", "after"):
        traces = [trace for trace in joint.free_run.values() if name in trace]
        free = float(np.mean(np.concatenate([np.abs(t[name] - t["recorded"]) for t in traces]))) if traces else np.nan
        out[name] = {
            "train": float(np.mean(np.abs(getattr(joint.train, name)))),
            "heldout": float(np.mean(np.abs(getattr(joint.heldout, name)))),
            "free_run_heldout": free if np.isfinite(free) else None,
        }
    return out


def position_errors(trace: Mapping[str, FloatArray], name: str) -> tuple[float, float] | None:
    """(RMS, mean absolute) position error [rad] of the free run `name`; None without it, NaN where it has diverged."""
    if name not in trace:
        return None
    error = trace[name] - trace["recorded"]
    return rms(error), float(np.mean(np.abs(error)))


def without_rows(parts: Sequence[Samples]) -> tuple[RunsWithoutMotion, ...]:
    """A note on the runs that say nothing; of one that is held out, no verdict is about it.

    Args:
        parts: Of the training runs and of the held-out runs.
    """
    silent = [
        name for samples in parts for number, name in enumerate(samples.runs) if not (samples.run == number).any()
    ]
    if not silent:
        return ()
    return (RunsWithoutMotion(tuple(silent), parts[0].kernel.actual_width_s),)
