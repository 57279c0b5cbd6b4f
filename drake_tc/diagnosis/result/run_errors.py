"""Errors of the model equation run by run."""

from collections.abc import Iterator, Sequence

import numpy as np

from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.result.joint_result import RunErrors
from drake_tc.types import FloatArray


def run_errors(splits: Sequence[DataSplit]) -> Iterator[RunErrors]:
    """Errors of every run, training runs first."""
    for split, heldout in zip(splits, (False, True), strict=True):
        for number, name in enumerate(split.samples.runs):
            mine = split.samples.run == number
            if mine.any():
                before, after = split.before[mine], split.after[mine]
                absolute = [float(np.mean(np.abs(x))) for x in (before, after)]
                yield RunErrors(name, heldout, int(mine.sum()), _rms(before), _rms(after), *absolute)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
