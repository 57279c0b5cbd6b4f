"""Which columns of a regressor the data can tell apart."""

import numpy as np
from scipy.linalg import qr

from drake_tc.types import FloatArray, IntArray


def independent_columns(matrix: FloatArray, tolerance: float = 1e-5) -> IntArray:
    """Indices, ascending, of a largest set of columns of A (N, p) that is numerically independent.

    Rank-revealing QR of A with columns scaled to unit length, A P = Q R: the leading columns, as many as there are
    |R_ii| > tolerance |R_00|. The base parameters belong to them; a column left out is a combination of these.

    Source: Gautier, Numerical calculation of the base inertial parameters of robots (1991).
    """
    scale = np.linalg.norm(matrix, axis=0)
    live = np.flatnonzero(scale > 1e-8 * max(float(scale.max(initial=0.0)), 1e-300))
    if live.size == 0:
        return live
    r, order = qr(matrix[:, live] / scale[live], mode="r", pivoting=True)
    size = np.abs(np.diag(r))
    return np.asarray(np.sort(live[order[: int(np.sum(size > tolerance * size[0]))]]))
