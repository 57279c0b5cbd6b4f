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
MOST_SCREENED = 6000
"""Samples on which a long grid is screened."""


def screened(
    effect: Effect, signals: Signals, residual: FloatArray, grid: Sequence[dict[str, float]], keep: int
) -> list[dict[str, float]]:
    """The `keep` shapes whose unfiltered columns correlate most with a residual; all when the grid is short.

    Args:
        effect: Which.
        signals: (N,) at the rows of the residual.
        residual: (N,).
        grid: Shapes.
        keep: How many.
    """
    if len(grid) <= 3 * keep:
        return list(grid)
    step = max(1, residual.size // MOST_SCREENED)
    at, r = signals.take(np.arange(0, residual.size, step)), residual[::step]
    scores = np.empty(len(grid))
    for i, shape in enumerate(grid):
        x = effect.columns(at, shape)
        x = x - x.mean(axis=0)
        moment = x.T @ r
        projection, *_ = np.linalg.lstsq(x.T @ x + 1e-9 * np.eye(x.shape[1]), moment, rcond=None)
        scores[i] = float(projection @ moment)
    return [grid[int(i)] for i in np.argsort(-scores)[:keep]]


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
    zero = np.zeros(start.size)
    minimize(
        lambda x: cost(np.clip(start * np.exp(steps * x), lower, upper)),
        zero,
        method="Nelder-Mead",
        options={
            "maxfev": evaluations * start.size,
            "xatol": 0.02,
            "fatol": 1e-4,
            "initial_simplex": np.vstack([zero, np.eye(start.size)]),
        },
    )
