"""Least squares in a box from normal equations, and whether their columns can be told apart."""

import numpy as np

from drake_tc.types import BoolArray, FloatArray

LEAST_SIZE = 1e-9
"""Norm of a column over the largest one, below which the column holds rounding errors only."""
LEAST_OUTSIDE_FOLD = 1e-6
"""Norm of a column outside a fold over that in all folds, below which the other folds do not identify it."""
SLACK = 1e-12
"""How far beyond its bound a scaled coefficient may lie."""


def solve_bounded(
    gram: FloatArray, moment: FloatArray, lower: FloatArray, upper: FloatArray, held: BoolArray | None = None
) -> FloatArray:
    """Argmin beta' G beta / 2 - m' beta in a box, by an active set that only grows (few bounds are ever active).

    A column that is zero up to rounding identifies no coefficient: the quotient of two rounding errors may be 1e100.
    Its coefficient is held at the value of the box that is closest to 0.

    Args:
        gram: G (m, m).
        moment: (m,).
        lower: (m,) bounds.
        upper: (m,).
        held: (m,) further coefficients to hold; None for none.

    Returns:
        beta (m,).
    """
    g, m, scale, dead = _scaled(gram, moment)
    low, high = lower * scale, upper * scale
    beta = np.clip(np.zeros(m.size), low, high)
    fixed = dead | (low == high) if held is None else dead | (low == high) | held
    for _ in range(m.size + 1):
        free = ~fixed
        beta[free] = np.linalg.solve(g[np.ix_(free, free)], m[free] - g[np.ix_(free, fixed)] @ beta[fixed])
        outside = free & ((beta < low - SLACK) | (beta > high + SLACK))
        if not outside.any():
            break
        beta[outside] = np.clip(beta[outside], low[outside], high[outside])
        fixed |= outside
    return np.clip(beta / scale, lower, upper)


def _scaled(gram: FloatArray, moment: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Normal equations (..., m, m), (..., m) with columns of unit length and a ridge of 1e-12; the lengths (..., m), 1
    for a column that is zero up to rounding; and which columns (..., m) are.
    """
    norms = np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 0.0))
    dead = np.asarray(norms <= LEAST_SIZE * norms.max(axis=-1, keepdims=True))
    scale = np.where(dead, 1.0, norms)
    g = gram / (scale[..., :, None] * scale[..., None, :])
    return g + 1e-12 * np.eye(g.shape[-1]), moment / scale, scale, dead


def cross_validated(
    grams: FloatArray, moments: FloatArray, lower: FloatArray, upper: FloatArray, precision: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Least squares in a box of all folds, and without each of them.

    Args:
        grams: (F, m, m) X'X by fold.
        moments: (F, m) X'z by fold.
        lower: (m,) bounds.
        upper: (m,).
        precision: (m,) of a prior about 0, which counts in full without each of the folds too.

    Returns:
        beta (m,), and (F, m) fitted without each fold. A coefficient whose column is zero outside a fold is 0 there.
    """
    gram, moment = grams.sum(0), moments.sum(0)
    sums = np.concatenate([gram[None], gram - grams])
    unseen = np.diagonal(sums, axis1=1, axis2=2) <= LEAST_OUTSIDE_FOLD**2 * np.diag(gram)
    unseen[0] = False
    rest = np.concatenate([moment[None], moment - moments])
    known = np.broadcast_to(precision, moment.shape)
    solved = _solve_each(sums + np.diag(known), rest, lower, upper, unseen & (known == 0.0))
    return solved[0], solved[1:]


def _solve_each(
    grams: FloatArray, moments: FloatArray, lower: FloatArray, upper: FloatArray, held: BoolArray
) -> FloatArray:
    """`solve_bounded` of B problems: together, but one by one where a coefficient is held or rests on a bound.

    Coefficients whose bounds are equal are known: the others are solved for on what these leave.
    """
    known = lower == upper
    if known.any():
        free = ~known
        rest = moments[:, free] - grams[:, free][:, :, known] @ lower[known]
        found = np.broadcast_to(lower, moments.shape).copy()
        found[:, free] = _solve_each(grams[:, free][:, :, free], rest, lower[free], upper[free], held[:, free])
        return found
    g, m, scale, dead = _scaled(grams, moments)
    alone = (held | dead).any(axis=1)
    beta = np.zeros_like(m)
    beta[~alone] = np.linalg.solve(g[~alone], m[~alone, :, None])[..., 0]
    outside = (beta < lower * scale - SLACK) | (beta > upper * scale + SLACK)
    beta = beta / scale
    for i in np.flatnonzero(alone | outside.any(axis=1)):
        beta[i] = solve_bounded(grams[i], moments[i], lower, upper, held[i])
    return np.clip(beta, lower, upper)


def collinear(gram: FloatArray) -> bool:
    """Whether columns, dead ones aside, cannot be told apart: scaled to unit length their condition exceeds 10^4.5."""
    scale = np.sqrt(np.diag(gram))
    live = scale > LEAST_SIZE * scale.max()
    unit = gram[np.ix_(live, live)] / np.outer(scale[live], scale[live])
    return bool(np.linalg.cond(unit) > 1e9)
