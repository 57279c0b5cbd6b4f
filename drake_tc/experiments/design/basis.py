"""Motions that are linear in their parameters: q(t) = q_m + sum_k x_k b_k(t), repeated with a period P.

    fourier:  b_k cosine and sine of the frequencies f_k = n_k/P, n_k whole and spread evenly on a logarithmic scale
    bspline:  b_k periodic B-splines of degree 5 with evenly spaced knots: four continuous derivatives

and in both a constant. Position, velocity, acceleration and jerk at every sample are matrices times x, so that limits
are linear constraints.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.types import FloatArray

BasisKind = Literal["fourier", "bspline"]
DEGREE = 5
MOST_FREQUENCIES = 11


@dataclass(frozen=True, eq=False)
class MotionBasis:
    """Matrices (T, n) of position, velocity, acceleration and jerk of one period.

    Attributes:
        kind: Of the functions.
        period: P [s].
        step: Time between samples [s].
        matrices: (4, T, n) by order of the derivative.
        frequency_hz: (n,) typical frequency of each function [Hz]; 0 for the constant.
        scale: (n,) amplitude [rad] of each function, 1 until `scaled`.
    """

    kind: BasisKind
    period: float
    step: float
    matrices: FloatArray
    frequency_hz: FloatArray
    scale: FloatArray

    @property
    def size(self) -> int:
        """Number n of parameters."""
        return int(self.matrices.shape[2])

    def motion(self, x: FloatArray) -> FloatArray:
        """(4, T) position, velocity, acceleration and jerk for x (n,)."""
        return np.asarray(self.matrices @ x)


def whole_step(period: float, step: float) -> float:
    """The step nearest to `step` [s] of which a period is a multiple, so that the motion closes at its end."""
    return period / max(1, round(period / step))


def scaled(basis: MotionBasis, limits: JointLimits) -> MotionBasis:
    """The same functions, each with the largest amplitude that it may have alone: parameters of the order of 1."""
    omega = 2.0 * np.pi * np.maximum(basis.frequency_hz, 1e-9)
    half = 0.5 * (limits.position[1] - limits.position[0])
    sizes = np.minimum(half, np.minimum(limits.velocity / omega, limits.acceleration / omega**2))
    return replace(basis, matrices=basis.matrices * sizes, scale=basis.scale * sizes)


def motion_basis(
    kind: BasisKind, period: float, step: float, bandwidth_hz: float, most: int = MOST_FREQUENCIES
) -> MotionBasis:
    """The functions of one period.

    Args:
        kind: Of the functions.
        period: P [s].
        step: Time between samples [s]; P is rounded to a whole number of them.
        bandwidth_hz: Highest frequency [Hz].
        most: Frequencies at most.

    Raises:
        ParamsError: A period too short for two frequencies below the bandwidth.
    """
    count = round(period / step)
    time: FloatArray = np.asarray(np.arange(count) * step, dtype=np.float64)
    highest = int(np.floor(bandwidth_hz * period + 1e-9))
    if highest < 2:
        raise ParamsError(
            f"a motion of {period:g} s has fewer than two frequencies below the drive's bandwidth of {bandwidth_hz:g} "
            "Hz; lengthen --duration or raise --bandwidth"
        )
    if kind == "fourier":
        return _fourier(time, period, step, highest, most)
    return _bspline(time, period, step, bandwidth_hz)


def _fourier(time: FloatArray, period: float, step: float, highest: int, most: int) -> MotionBasis:
    numbers = np.unique(np.round(np.geomspace(1, highest, most)).astype(int))
    omega = 2.0 * np.pi * numbers / period
    phase = omega[None, :] * time[:, None]
    blocks = []
    for order in range(4):
        turned = phase + 0.5 * np.pi * order
        scale = omega**order
        constant = np.full((time.size, 1), 1.0 if order == 0 else 0.0)
        blocks.append(np.hstack([constant, scale * np.cos(turned), scale * np.sin(turned)]))
    frequency = numbers / period
    return MotionBasis(
        "fourier",
        period,
        step,
        np.stack(blocks),
        np.concatenate([[0.0], frequency, frequency]),
        np.ones(1 + 2 * omega.size),
    )


def _bspline(time: FloatArray, period: float, step: float, bandwidth_hz: float) -> MotionBasis:
    """Two knots for each half wave of the highest frequency that 30 knots reach, at most the bandwidth."""
    count = int(np.clip(np.ceil(4.0 * bandwidth_hz * period), DEGREE + 3, 30))
    spacing = period / count
    knots = np.arange(-DEGREE, count + DEGREE + 1) * spacing
    blocks = []
    for order in range(4):
        matrix = np.zeros((time.size, count))
        for k in range(count + DEGREE):
            weights = np.zeros(count + DEGREE)
            weights[k] = 1.0
            spline = BSpline(knots, weights, DEGREE)
            matrix[:, k % count] += (spline.derivative(order) if order else spline)(time)
        blocks.append(matrix)
    return MotionBasis("bspline", period, step, np.stack(blocks), np.full(count, 0.25 / spacing), np.ones(count))
