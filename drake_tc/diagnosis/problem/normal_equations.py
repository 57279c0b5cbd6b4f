"""`Normal`: the normal equations of a set of terms, by fold."""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.bounded import Prior
from drake_tc.types import FloatArray, IntArray

FOLDS = 5


def fold_of(block: IntArray) -> IntArray:
    """Blocks dealt to folds in pairs, so that neighbours mostly share a fold."""
    return np.asarray((block // 2) % FOLDS)


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of one set of terms by fold, from cached products of columns.

    Attributes:
        grams: (FOLDS, m, m) X'X. moments: (FOLDS, m) X'z. squares: (FOLDS,) z'z.
        prior: What is known of the coefficients beforehand.
    """

    grams: FloatArray
    moments: FloatArray
    squares: FloatArray
    prior: Prior
