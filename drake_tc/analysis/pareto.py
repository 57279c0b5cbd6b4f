"""Pareto front: the choices that no other one beats in everything."""

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray, IntArray


def pareto_front(costs: FloatArray) -> IntArray:
    """Rows of `costs` (N, m) that no other row is at most equal to everywhere and below somewhere, by the first cost.

    Of equal rows the first stays. Rows that are not finite never are on the front.

    Raises:
        ParamsError: anything but two dimensions.
    """
    if costs.ndim != 2:
        raise ParamsError(f"pareto_front: expected costs of shape (N, m), got {costs.shape}")
    finite = np.flatnonzero(np.all(np.isfinite(costs), axis=1))
    order = finite[np.lexsort(costs[finite].T[::-1])]
    kept: list[int] = []
    for row in order.tolist():
        if not kept or not np.any(np.all(costs[kept] <= costs[row], axis=1)):
            kept.append(row)
    return np.array(kept, dtype=np.int64)
