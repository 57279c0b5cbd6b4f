"""All joints of a robot with their declared models, which a cause of the whole robot is held against."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import StackedFit
from drake_tc.diagnosis.selection.comparison import compared
from drake_tc.diagnosis.thresholds import SAME_ERROR, SearchThresholds
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False)
class AllJoints:
    """All joints with their declared models.

    Attributes:
        prepared: Joints.
        rows: Training rows of all joints.
        held: Held-out rows of all joints.
        fitted: To `rows`, without the cause.
    """

    prepared: Mapping[str, Prepared]
    rows: Sequence[JointRows]
    held: Sequence[JointRows]
    fitted: StackedFit

    @property
    def counts(self) -> FloatArray:
        """(n,) training rows of each joint."""
        return np.array([rows.target.size for rows in self.rows], dtype=np.float64)

    def error(self, fitted: StackedFit) -> float:
        """Mean logarithm of the joints' cross-validated errors, weighted by their rows."""
        return float(self.counts @ np.log(fitted.cv_rms) / self.counts.sum())

    def is_better(self, large: StackedFit, small: StackedFit, thresholds: SearchThresholds) -> bool:
        """Whether the model with one parameter more is a real improvement, and no joint's error grows."""
        before, after = small.cv_rms, large.cv_rms
        if (after > (1.0 + SAME_ERROR) * before).any():
            return False
        floor = np.array([p.floor for p in self.prepared.values()])
        over = compared(before, after, large.effective * self.counts, 1, 1.0)
        return over.is_real(floor, np.zeros(before.size), thresholds)
