"""Shape parameters of an effect: which points of a long grid are worth a fit, and refinement from the best one."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import minimize

from drake_tc.effects.base import Effect, Parameter, Signals
from drake_tc.types import FloatArray

PERIOD = "cycles_per_turn"
"""The shape parameter whose fit has many maxima next to each other: it is moved in small steps."""
STEP, STEP_OF_PERIOD = 0.15, 0.004
"""First steps of the logarithm of a shape parameter."""
LARGEST_COST = 1e100
"""Stands for the infinite cost of a model that cannot be fitted."""
MOST_SEARCHES = 4
"""Searches of one refinement that end on a bound. LEAST_FALL: of the cost, for which another one is begun."""
LEAST_FALL = 0.01
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


def refine_values(
    parameters: Sequence[Parameter], start: FloatArray, cost: Callable[[FloatArray], float], evaluations: int
) -> None:
    """Nelder-Mead on the logarithms of shape parameters; `cost` remembers the best it has seen.

    Args:
        parameters: (k,) with their bounds.
        start: (k,) values.
        cost: Of values (k,) within the bounds.
        evaluations: At most so many for each parameter.
    """
    lower, upper = (np.array([getattr(p, side) for p in parameters]) for side in ("lower", "upper"))
    steps = np.array([STEP_OF_PERIOD if p.name == PERIOD else STEP for p in parameters])
    values, least = start, np.inf
    for _ in range(MOST_SEARCHES):
        inwards = np.where(values * np.exp(steps) > upper, -steps, steps)
        values, reached = _simplex_search(cost, values, inwards, (lower, upper), evaluations * start.size)
        if reached > least - LEAST_FALL or not np.any((values <= lower) | (values >= upper)):
            return
        least = reached


def _simplex_search(
    cost: Callable[[FloatArray], float],
    start: FloatArray,
    steps: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    most: int,
) -> tuple[FloatArray, float]:
    """The values (k,) where Nelder-Mead ends, and their cost; `steps` (k,) are those of its first simplex."""

    def within(x: FloatArray) -> FloatArray:
        return np.clip(start * np.exp(steps * x), *bounds)

    zero = np.zeros(start.size)
    found = minimize(
        lambda x: min(cost(within(x)), LARGEST_COST),  # the simplex subtracts costs
        zero,
        method="Nelder-Mead",
        options={
            "maxfev": most,
            "xatol": 0.02,
            "fatol": 1e-4,
            "initial_simplex": np.vstack([zero, np.eye(start.size)]),
        },
    )
    return within(found.x), float(found.fun)
