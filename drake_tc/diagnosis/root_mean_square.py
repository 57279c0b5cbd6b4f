"""Root mean square, by which errors are told throughout, and the mean magnitude beside it."""

import numpy as np

from drake_tc.types import FloatArray


def rms(values: FloatArray) -> float:
    """Root mean square of values (N,); 0 of none."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
