"""Margins of a sampled loop, from the frequency response L of the loop cut open at one point.

The loop is closed by negative feedback: it is stable at the critical point 1 + L = 0 of Nyquist.

    gain margin       1/|L| where arg L = -180 deg: the factor on L at which the loop comes to the border
    phase margin      pi + arg L where |L| = 1
    delay margin      (pi + arg L)/omega, the angle taken in (0, 2 pi]: the delay at which it does
    sensitivity peak  max |1/(1 + L)| = 1/(smallest distance of L from -1)
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray, IntArray

ComplexArray: TypeAlias = NDArray[np.complex128]
Response: TypeAlias = Callable[[FloatArray], ComplexArray]
"""omega (W,) [rad/s] to L (W,)."""

POINTS = 1200
"""Of the grid on which crossings are looked for."""
SLOWEST = 1e-2
"""Where the grid begins [rad/s]."""
NEAR = 1.0
"""Of the logarithm of a gain margin: how far the grid may be off."""


@dataclass(frozen=True)
class Margins:
    """Margins of one open loop; they mean something where the closed loop is stable.

    Attributes:
        gain_margin: Factor on L nearest to 1 (as a ratio) that brings the loop to its border; infinite for none.
        phase_margin: Smallest in absolute value [rad]; infinite where |L| is never 1.
        delay_margin: [s]; infinite where |L| is never 1.
        sensitivity_peak: [-].
        crossover: Where |L| = 1 at the phase margin [rad/s]; NaN for none.
        phase_crossover: Where arg L = -180 deg at the gain margin [rad/s]; NaN for none.
    """

    gain_margin: float
    phase_margin: float
    delay_margin: float
    sensitivity_peak: float
    crossover: float
    phase_crossover: float


def margins(open_loop: Response, dt: float, grid: FloatArray | None = None) -> Margins:
    """Margins of the loop that passes where it was cut; `loop_margins` gives those of all its channels.

    Crossings are bracketed on a grid and refined to 1e-13 of the bracket; two crossings within one step of the grid are
    not seen.

    Args:
        open_loop: L, negative feedback.
        dt: Sampling period [s].
        grid: (W,) rising frequencies up to pi/dt [rad/s]; None: `frequency_grid`.

    Raises:
        ParamsError: a period that is not positive, or a response that is not finite.

    Example:
        >>> found = margins(lambda w: 0.1 / (np.exp(0.01j * w) - 1.0), dt=0.01)
        >>> round(found.gain_margin, 2)
        20.0
    """
    if not (np.isfinite(dt) and dt > 0.0):
        raise ParamsError(f"margins: expected a positive period [s], got {dt!r}")
    omega = frequency_grid(dt) if grid is None else np.asarray(grid, dtype=np.float64)
    values = np.asarray(open_loop(omega))
    if values.shape != omega.shape or not np.all(np.isfinite(values)):
        raise ParamsError(f"margins: expected a finite response of shape {omega.shape}, got shape {values.shape}")

    @cache
    def at(frequency: float) -> complex:
        return complex(open_loop(np.array([frequency]))[0])

    unity = [_root(lambda w: abs(at(w)) - 1.0, omega, i) for i in sign_changes(np.abs(values) - 1.0).tolist()]
    angles = np.array([np.angle(-at(w)) for w in unity])  # pi + arg L in (-pi, pi]
    gain, turning = _gain_margin(at, omega, values)
    phase, crossover, late = np.inf, np.nan, np.inf
    if unity:
        nearest = int(np.argmin(np.abs(angles)))
        phase, crossover = float(angles[nearest]), float(unity[nearest])
        late = float(np.min(np.where(angles > 0.0, angles, angles + 2.0 * np.pi) / np.array(unity)))
    return Margins(float(gain), phase, late, _sensitivity_peak(at, omega, values), crossover, float(turning))


def _gain_margin(at: Callable[[float], complex], omega: FloatArray, values: ComplexArray) -> tuple[float, float]:
    """(factor on L nearest to 1 that brings it to -1, where); of the crossings of the real axis only those that may be
    the nearest are refined, by where the straight line between points of the grid crosses it.
    """
    found = [(np.inf, np.nan)]
    if abs(values[-1].imag) < 1e-9 * abs(values[-1]) and values[-1].real < 0.0:  # L is real at pi/dt
        found.append((-1.0 / values[-1].real, float(omega[-1])))
    before = sign_changes(np.where(values.imag == 0.0, 0.0, values.imag))  # 0 and -0 are no crossing
    here, there = values[before], values[before + 1]
    share = here.imag / (here.imag - there.imag)
    about = here.real + share * (there.real - here.real)
    distance = np.where(about < 0.0, np.abs(np.log(np.maximum(-about, np.finfo(float).tiny))), NEAR)
    for i in np.argsort(distance, kind="stable").tolist():
        if distance[i] > min(abs(np.log(factor)) for factor, _ in found) + NEAR:
            break
        w = _root(lambda w: at(w).imag, omega, int(before[i]))
        if at(w).real < 0.0:
            found.append((-1.0 / at(w).real, w))
    return min(found, key=lambda pair: float(abs(np.log(pair[0]))))


def frequency_grid(dt: float, slowest: float = SLOWEST, points: int = POINTS) -> FloatArray:
    """(points,) frequencies from `slowest` to pi/dt [rad/s], evenly by their logarithm."""
    return np.geomspace(min(slowest, 1e-3 * np.pi / dt), np.pi / dt, points)


def sign_changes(values: FloatArray) -> IntArray:
    """Places i at which values[i] and values[i + 1] differ in sign."""
    return np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))


def _root(function: Callable[[float], float], omega: FloatArray, index: int) -> float:
    low, high = float(omega[index]), float(omega[index + 1])
    if function(low) == 0.0 or function(low) * function(high) > 0.0:
        return low
    return float(brentq(function, low, high, xtol=1e-13 * high, rtol=1e-14))


def _sensitivity_peak(at: Callable[[float], complex], omega: FloatArray, values: ComplexArray) -> float:
    """1/min |1 + L|, refined around the grid's lowest points."""
    distance = np.abs(1.0 + values)
    smallest = float(distance.min())
    around = np.pad(distance, 1, constant_values=np.inf)
    lowest = np.flatnonzero((distance <= around[:-2]) & (distance <= around[2:]) & (distance <= 1.05 * smallest))
    for best in lowest.tolist():
        low, high = float(omega[max(best - 1, 0)]), float(omega[min(best + 1, omega.size - 1)])
        options = {"xatol": 1e-9 * high}
        found = minimize_scalar(lambda w: abs(1.0 + at(w)), bounds=(low, high), method="bounded", options=options)
        smallest = min(smallest, float(found.fun))
    return 1.0 / smallest if smallest > 0.0 else np.inf
