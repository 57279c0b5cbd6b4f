"""Limit cycles: found in a recording, and predicted by describing functions where that is cheap.

A dead zone, dry friction or a limit can hold a loop that is unstable near rest (or stable near rest, unstable beyond)
in a steady oscillation, which no eigenvalue shows.

    describing function N(A): the gain of a nonlinearity to a sine of amplitude A, its harmonics left out
    balance                   1 + N(A) L(j omega) = 0, L the loop (negative feedback) without the nonlinearity

N is real here, so the balance holds where L is real and negative, L = -1/N(A).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from drake_tc.control.stability_margins import Response, frequency_grid, sign_changes
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

FEWEST = 3.0
"""Periods that a recording must hold."""


@dataclass(frozen=True)
class LimitCycle:
    """A steady oscillation.

    Attributes:
        period: [s].
        amplitude: Half the peak-to-peak swing [unit of the signal].
        confidence: From 0 to 1: how well the signal repeats itself after a period, times how steady its swing is.
    """

    period: float
    amplitude: float
    confidence: float


def find_limit_cycle(signal: FloatArray, dt: float, floor: float = 0.0) -> LimitCycle | None:
    """The steady oscillation that a recording ends in, evaluated from its second half; None where there is none.

    The period is the first high peak of the autocorrelation; confidence is that peak times the ratio of the smaller to
    the larger swing of the two quarters, so that a decaying or growing oscillation gets little.

    Args:
        signal: (T,) uniform and finite.
        dt: Sampling period [s].
        floor: Swings below this amplitude count as rest [unit of the signal].

    Raises:
        ParamsError: a recording of fewer than 16 samples, or one that is not finite.

    Example:
        >>> time = np.arange(400) * 0.01
        >>> found = find_limit_cycle(np.sin(2.0 * np.pi * 2.0 * time), 0.01)
        >>> round(float(found.period), 2)
        0.5
    """
    x = np.asarray(signal, dtype=np.float64)
    if x.ndim != 1 or x.size < 16 or not np.all(np.isfinite(x)):
        raise ParamsError(f"limit cycle: expected at least 16 finite samples in one row, got shape {x.shape}")
    late = x[x.size // 2 :]
    late = late - np.polyval(np.polyfit(np.arange(late.size), late, 1), np.arange(late.size))
    amplitude = 0.5 * float(np.ptp(late))
    if amplitude <= floor or amplitude == 0.0:
        return None
    spectrum = np.abs(np.fft.rfft(late, 2 * late.size)) ** 2
    power = np.fft.irfft(spectrum)[: late.size]
    correlation = power / power[0] * late.size / np.arange(late.size, 0, -1)  # unbiased
    lag = _first_peak(correlation[: int(late.size / FEWEST) + 1])
    if lag is None:
        return None
    halves = [0.5 * float(np.ptp(half)) for half in np.array_split(late, 2)]
    steady = min(halves) / max(halves)
    return LimitCycle(lag[0] * dt, amplitude, float(np.clip(lag[1], 0.0, 1.0) * steady**2))


def _first_peak(correlation: FloatArray) -> tuple[float, float] | None:
    """(lag, height) of the first maximum within a tenth of the highest one behind the first zero; refined."""
    below = np.flatnonzero(correlation <= 0.0)
    if not below.size or below[0] >= correlation.size - 2:
        return None
    start = int(below[0])
    inner = correlation[start:]
    peaks = start + 1 + np.flatnonzero((inner[1:-1] >= inner[:-2]) & (inner[1:-1] > inner[2:]))
    if not peaks.size:
        return None
    at = int(peaks[np.argmax(correlation[peaks] >= 0.9 * correlation[peaks].max())])
    a, b, c = correlation[at - 1 : at + 2]
    curve = a - 2.0 * b + c
    return (at + 0.5 * (a - c) / curve if curve else float(at)), float(b)


def deadzone_gain(amplitude: FloatArray, half_width: float) -> FloatArray:
    """N(A) of sign(x) max(|x| - w, 0): from 0 at A = w to 1.

    N = 1 - 2/pi (asin(w/A) + w/A sqrt(1 - (w/A)^2)). Source: Gelb and Vander Velde (1968).

    Example:
        >>> deadzone_gain(np.array([0.5, 1e9]), half_width=1.0).round(6)
        array([0., 1.])
    """
    share = np.minimum(half_width / np.asarray(amplitude, dtype=np.float64), 1.0)
    return np.asarray(1.0 - 2.0 / np.pi * (np.arcsin(share) + share * np.sqrt(1.0 - share**2)))


def saturation_gain(amplitude: FloatArray, limit: float) -> FloatArray:
    """N(A) of clip(x, -l, l): 1 up to A = l, then less.

    Example:
        >>> saturation_gain(np.array([0.5]), limit=1.0)
        array([1.])
    """
    return np.asarray(1.0 - deadzone_gain(amplitude, limit))


def coulomb_gain(amplitude: FloatArray, level: float) -> FloatArray:
    """N(A) of level sign(x): 4 level/(pi A), the damping that dry friction amounts to at a speed amplitude A.

    Example:
        >>> coulomb_gain(np.array([4.0 / np.pi]), level=2.0)
        array([2.])
    """
    return np.asarray(4.0 * level / (np.pi * np.asarray(amplitude, dtype=np.float64)))


def predicted_limit_cycles(
    open_loop: Response,
    dt: float,
    gain: Callable[[FloatArray], FloatArray],
    amplitudes: FloatArray,
) -> list[LimitCycle]:
    """Where 1 + N(A) L = 0: amplitude at the nonlinearity's input, and period.

    Balances of both kinds are listed, those that an oscillation is drawn to and those it is driven from; the latter
    bound what a loop forgives. Confidence is 1 less the share that the loop passes of the third harmonic.

    Args:
        open_loop: L without the nonlinearity, negative feedback.
        dt: Period [s].
        gain: N(A) for A (K,).
        amplitudes: (K,) rising; balances are looked for between neighbours.

    Raises:
        ParamsError: amplitudes that do not rise from above zero.

    Example:
        >>> late = lambda w: 3000.0 * np.exp(-0.01j * w) / (1j * w * (1j * w + 10.0))
        >>> found = predicted_limit_cycles(late, 1e-3, lambda a: saturation_gain(a, 0.1), np.linspace(0.1, 2.0, 50))
        >>> [round(cycle.period, 2) for cycle in found]
        [0.2]
    """
    grid_a = np.asarray(amplitudes, dtype=np.float64)
    if grid_a.ndim != 1 or grid_a.size < 2 or not (grid_a[0] > 0.0 and np.all(np.diff(grid_a) > 0.0)):
        raise ParamsError("limit cycle: expected at least two rising amplitudes > 0")
    omega = frequency_grid(dt)
    values = open_loop(omega)

    def at(frequency: float) -> complex:
        return complex(open_loop(np.array([frequency]))[0])

    found = []
    for i in sign_changes(values.imag).tolist():
        if at(omega[i]).imag * at(omega[i + 1]).imag >= 0.0:
            continue
        w = float(brentq(lambda f: at(f).imag, omega[i], omega[i + 1], rtol=1e-13))
        level = at(w).real
        if level >= 0.0:
            continue
        excess = gain(grid_a) + 1.0 / level
        third = min(3.0 * w, np.pi / dt)
        purity = max(0.0, 1.0 - abs(at(third)) / abs(level) / 3.0)
        for k in sign_changes(excess).tolist():
            amplitude = _balance(gain, -1.0 / level, grid_a[k], grid_a[k + 1])
            found.append(LimitCycle(2.0 * np.pi / w, amplitude, float(purity)))
    return found


def _balance(gain: Callable[[FloatArray], FloatArray], level: float, low: float, high: float) -> float:
    return float(brentq(lambda a: float(gain(np.array([a]))[0]) - level, low, high))
