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


def base_combinations(matrix: FloatArray, tolerance: float = 1e-5) -> tuple[IntArray, FloatArray]:
    """The base parameters of a regressor A (N, p), as combinations of its parameters: A pi = A_b (M pi).

    Args:
        matrix: A.
        tolerance: As in `independent_columns`.

    Returns:
        Indices (b,) of the independent columns A_b, and M (b, p): the identity in those columns, and in each other one
        the factors with which it is made of them.
    """
    chosen = independent_columns(matrix, tolerance)
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = matrix / scale
    mix = np.linalg.lstsq(unit[:, chosen], unit, rcond=None)[0] * (scale / scale[chosen][:, None])
    mix[np.abs(mix) < 1e-6] = 0.0
    return chosen, np.asarray(mix)
