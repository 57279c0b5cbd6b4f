"""A local search that needs no gradient, for a criterion that is judged with sharp friction.

The solver climbs a smooth criterion, whose best point is rarely that of the sharp one. From the best point found,

    x' = x + s m o n,   n ~ N(0, I),   m: a random third of the functions

is kept where the sharp criterion is larger; s grows by half after a success and shrinks after a failure, so that about
one trial in five succeeds (Rechenberg, 1973). A step that has become too small begins anew.
"""

from collections.abc import Callable

import numpy as np

from drake_tc.types import FloatArray

TRIALS = 400
FIRST_STEP, LEAST_STEP = 0.1, 1e-3
"""Steps s, over the amplitude that the limits allow each function alone."""
GROWTH = 1.5
SHARE = 1.0 / 3.0
"""Of the functions that are changed together."""


def refined(
    value: Callable[[FloatArray], tuple[float, FloatArray]],
    best: tuple[float, FloatArray],
    rng: np.random.Generator,
    trials: int = TRIALS,
) -> tuple[float, FloatArray]:
    """The best (value, x (n,)) after a number of trials; never less than that of `best`.

    Args:
        value: (criterion, the motion within limits) of a motion (n,).
        best: From which the search begins.
        rng: Of the trials.
        trials: Their number.
    """
    found, x = best
    step = FIRST_STEP
    for _ in range(trials):
        moved = rng.random(x.size) < SHARE
        tried, at = value(x + step * moved * rng.normal(size=x.size))
        if tried > found:
            found, x, step = tried, at, step * GROWTH
        else:
            step *= GROWTH**-0.25
        if step < LEAST_STEP:
            step = FIRST_STEP
    return found, x
