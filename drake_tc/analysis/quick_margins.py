"""Margins of a `JointLoop` at a fraction of a millisecond, on a grid of frequencies: for searches over many gains.

With A the plant's polynomial (and the integrator's) in 1/z and X the characteristic one, 1 + L = X/A at the drive's
effort, so two Fourier transforms of coefficients give L on a uniform grid up to the Nyquist frequency. X has no root
outside the unit circle when its phase comes back to where it was from z = 1 to z = -1 (argument principle).
"""

import numpy as np

from drake_tc.analysis.joint_loop import JointLoop
from drake_tc.analysis.stability_margins import ComplexArray, Margins, sign_changes
from drake_tc.types import FloatArray

POINTS = 8192
"""Of the transform: at h = 1 ms, a frequency every 0.77 rad/s."""


def quick_margins(loop: JointLoop) -> Margins | None:
    """Margins of `JointLoop.margins`, to the grid's resolution; None where the closed loop is unstable."""
    closed = np.fft.rfft(loop.characteristic(), POINTS)[1:]
    if abs(np.unwrap(np.angle(closed))[-1] - np.angle(closed[0])) > 0.5 * np.pi:
        return None
    plant = np.fft.rfft(np.convolve(loop.plant, loop.integrator), POINTS)[1:]
    opened = closed / plant - 1.0
    omega: FloatArray = np.arange(1.0, opened.size + 1.0) * (2.0 * np.pi / (POINTS * loop.dt))
    peak = float(np.max(np.abs(plant / closed)))
    phase, late, crossover = _unity(opened, omega)
    gain, turning = _real(opened, omega)
    return Margins(gain, phase, late, peak, crossover, turning)


def _unity(opened: ComplexArray, omega: FloatArray) -> tuple[float, float, float]:
    """(phase margin, delay margin, crossover) where |L| = 1, between grid points by a straight line."""
    size = np.log(np.abs(opened))
    at = sign_changes(size)
    if not at.size:
        return np.inf, np.inf, np.nan
    share = size[at] / (size[at] - size[at + 1])
    value = opened[at] + share * (opened[at + 1] - opened[at])
    where = omega[at] + share * (omega[at + 1] - omega[at])
    angle = np.angle(-value)
    nearest = int(np.argmin(np.abs(angle)))
    late = float(np.min(np.where(angle > 0.0, angle, angle + 2.0 * np.pi) / where))
    return float(angle[nearest]), late, float(where[nearest])


def _real(opened: ComplexArray, omega: FloatArray) -> tuple[float, float]:
    """(gain margin, its frequency): the factor nearest to 1 that brings L to -1."""
    imaginary, real = opened.imag, opened.real
    at = sign_changes(imaginary)
    share = imaginary[at] / (imaginary[at] - imaginary[at + 1])
    value = real[at] + share * (real[at + 1] - real[at])
    where = omega[at] + share * (omega[at + 1] - omega[at])
    value, where = np.append(value, real[-1]), np.append(where, omega[-1])  # L is real at the Nyquist frequency
    behind = value < 0.0
    if not behind.any():
        return np.inf, np.nan
    factor, where = -1.0 / value[behind], where[behind]
    nearest = int(np.argmin(np.abs(np.log(factor))))
    return float(factor[nearest]), float(where[nearest])
