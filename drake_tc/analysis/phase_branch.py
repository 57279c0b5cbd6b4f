"""On which turn a phase is: followed from near 0 Hz on a grid that is refined until no step turns far."""

from collections.abc import Callable

import numpy as np

from drake_tc.analysis.stability_margins import ComplexArray
from drake_tc.types import FloatArray

EVEN, BY_RATIO = 400, 60
"""Points of the first grid: evenly spaced, for delays, and by their logarithm, for what happens at low frequencies."""
LARGEST_STEP = np.pi / 4.0
"""Between neighbours [rad]."""
ROUNDS = 12
"""Of halving where a step is larger: as narrow as 1/4000 of the first grid's."""


def continuous_phase(response: Callable[[FloatArray], ComplexArray], frequency_hz: FloatArray) -> FloatArray:
    """(F,) arg H [rad] without jumps from a thousandth of the lowest frequency on, where it is in [-pi, pi).

    Args:
        response: H (G,) at frequencies (G,) [Hz].
        frequency_hz: (F,) > 0 [Hz].
    """
    low, top = 1e-3 * float(frequency_hz.min()), float(frequency_hz.max())
    grid = np.unique(np.concatenate([np.linspace(low, top, EVEN), np.geomspace(low, top, BY_RATIO), frequency_hz]))
    h = response(grid)
    for _ in range(ROUNDS):
        wide = np.flatnonzero(np.abs(np.angle(h[1:] * np.conj(h[:-1]))) > LARGEST_STEP)
        if not wide.size:
            break
        middle = 0.5 * (grid[wide] + grid[wide + 1])
        h = np.insert(h, wide + 1, response(middle))
        grid = np.insert(grid, wide + 1, middle)
    phase = np.unwrap(np.angle(h))
    if phase[0] > np.pi - 1e-9:
        phase = phase - 2.0 * np.pi
    return np.asarray(phase[np.searchsorted(grid, frequency_hz)])


def nearest_turn(phase: FloatArray, reference: FloatArray) -> FloatArray:
    """The same angles [rad], by whole turns as near as can be to a reference; one that is NaN changes nothing."""
    turns = np.round((reference - phase) / (2.0 * np.pi))
    return np.asarray(phase + 2.0 * np.pi * np.where(np.isfinite(turns), turns, 0.0))
