"""Shape parameters of an effect: which points of a long grid are worth a fit, and refinement from the best one."""

from collections.abc import Sequence

import numpy as np

from drake_tc.effects.base import Effect, Signals
from drake_tc.types import FloatArray

MOST_SCREENED = 6000
"""Samples on which a long grid is screened."""


class ShapeScreen:
    """Which shapes of a long grid have the unfiltered columns that correlate most with a residual.

    score(shape) = m' (X'X)^+ m,   m = X'r,   X: columns of the shape about their means, r: residual

    The columns of a grid are computed once and kept as long as the screen: a search asks for every parent model.
    """

    def __init__(self, signals: Signals) -> None:
        """A screen over the signals (N,) at the rows of the residuals."""
        self._step = max(1, len(signals) // MOST_SCREENED)
        self._signals = signals.take(slice(None, None, self._step))
        self._kept: dict[tuple[object, ...], tuple[FloatArray, FloatArray]] = {}

    def best(
        self, effect: Effect, residual: FloatArray, grid: Sequence[dict[str, float]], keep: int
    ) -> list[dict[str, float]]:
        """The `keep` best shapes for a residual (N,), best first; the whole grid when it is short."""
        if len(grid) <= 3 * keep:
            return list(grid)
        columns, inverse = self._columns(effect, grid)
        moment = (columns.reshape(-1, columns.shape[-1]) @ residual[:: self._step]).reshape(columns.shape[:2])
        scores = np.einsum("si,sij,sj->s", moment, inverse, moment)
        return [grid[int(i)] for i in np.argsort(-scores)[:keep]]

    def _columns(self, effect: Effect, grid: Sequence[dict[str, float]]) -> tuple[FloatArray, FloatArray]:
        """X' (S, k, n) of every shape and (X'X)^+ (S, k, k)."""
        key = (effect.key, *(tuple(shape.values()) for shape in grid))
        if key not in self._kept:
            columns = np.stack([effect.columns(self._signals, shape).T for shape in grid])
            columns -= columns.mean(axis=-1, keepdims=True)
            gram = columns @ columns.transpose(0, 2, 1) + 1e-9 * np.eye(columns.shape[1])
            inverse = np.linalg.pinv(gram, rcond=gram.shape[1] * np.finfo(float).eps, hermitian=True)
            self._kept[key] = columns, np.asarray(inverse, dtype=np.float64)
        return self._kept[key]
