"""Least squares in a box from normal equations, and whether their columns can be told apart."""

import numpy as np

from drake_tc.types import FloatArray


def solve_bounded(gram: FloatArray, moment: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Argmin beta' G beta / 2 - m' beta in a box, by an active set that only grows (few bounds are ever active)."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    g = gram / np.outer(scale, scale)
    g = g + 1e-12 * np.eye(g.shape[0])
    m = moment / scale
    low, high = lower * scale, upper * scale
    beta = np.zeros(m.size)
    fixed = np.zeros(m.size, dtype=bool)
    for _ in range(m.size + 1):
        free = ~fixed
        beta[free] = np.linalg.solve(g[np.ix_(free, free)], m[free] - g[np.ix_(free, fixed)] @ beta[fixed])
        outside = free & ((beta < low - 1e-12) | (beta > high + 1e-12))
        if not outside.any():
            break
        beta[outside] = np.clip(beta[outside], low[outside], high[outside])
        fixed |= outside
    return np.asarray(beta / scale)


def cross_validated(
    grams: FloatArray, moments: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least squares in a box of all folds, and without each of them.

    Args:
        grams: (F, m, m) X'X by fold.
        moments: (F, m) X'z by fold.
        lower: (m,) bounds.
        upper: (m,).

    Returns:
        beta (m,), and (F, m) fitted without each fold.
    """
    gram, moment = grams.sum(0), moments.sum(0)
    without = [solve_bounded(gram - g, moment - m, lower, upper) for g, m in zip(grams, moments, strict=True)]
    return solve_bounded(gram, moment, lower, upper), np.array(without)


def collinear(gram: FloatArray) -> bool:
    """Whether columns, dead ones aside, cannot be told apart: scaled to unit length their condition exceeds 10^4.5."""
    scale = np.sqrt(np.diag(gram))
    live = scale > 1e-9 * scale.max()
    unit = gram[np.ix_(live, live)] / np.outer(scale[live], scale[live])
    return bool(np.linalg.cond(unit) > 1e9)
