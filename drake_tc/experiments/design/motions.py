"""What a designed motion may do, and whether that is possible at all.

Motions that are linear in their parameters: q(t) = q_m + sum_k x_k b_k(t), repeated with a period P.

    fourier:  b_k cosine and sine of the frequencies f_k = n_k/P, n_k whole and spread evenly on a logarithmic scale
    bspline:  b_k periodic B-splines of degree 5 with evenly spaced knots: four continuous derivatives

and in both a constant. Position, velocity, acceleration and jerk at every sample are matrices times x, so that limits
are linear constraints.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline

from drake_tc.config.joint_units import TORQUE, TURNING, JointUnits
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint's motion.

    Attributes:
        position: (lowest, highest) [rad].
        velocity: Largest speed [rad/s].
        acceleration: Largest acceleration [rad/s^2].
        jerk: Largest rate of the acceleration [rad/s^3]; infinite where it does not matter.
        torque: Largest torque of the motor [N m]; infinite where it does not matter.
        bandwidth_hz: Highest frequency of the motion that the drive follows [Hz].
        units: Of the joint; of one that slides the limits are in m and N.

    Raises:
        ParamsError: Limits that are not positive, or that contradict each other; one line.
    """

    position: tuple[float, float]
    velocity: float
    acceleration: float
    jerk: float = math.inf
    torque: float = math.inf
    bandwidth_hz: float = 4.0
    units: JointUnits = TURNING

    def __post_init__(self) -> None:
        low, high = self.position
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ParamsError(f"position limits: expected LOW < HIGH [{self.units.position}], got {low:g} and {high:g}")
        for name in ("velocity", "acceleration", "jerk", "torque", "bandwidth_hz"):
            value = getattr(self, name)
            if not value > 0.0:
                raise ParamsError(f"{name}: expected a positive limit, got {value:g}")
        if not (math.isfinite(self.velocity) and math.isfinite(self.acceleration)):
            raise ParamsError("velocity and acceleration: expected finite limits")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """(lowest, highest) position, velocity, acceleration and jerk."""
        rest = ((-limit, limit) for limit in (self.velocity, self.acceleration, self.jerk))
        return self.position, *rest

    def share_kept(self, mean: float, swing: FloatArray) -> float:
        """Largest share, at most 1, of a swing (4, T) about a mean position that keeps all but the torque."""
        lowest, highest = swing.min(axis=1), swing.max(axis=1)
        rooms = []
        for order, (low, high) in enumerate(self.bounds):
            middle = 0.0 if order else mean
            rooms += [(high - middle, float(highest[order])), (middle - low, -float(lowest[order]))]
        return min([1.0, *(room / size for room, size in rooms if size > 0.0)])

    def require(self, joint: DesignJoint) -> None:
        """Refuse a torque limit that cannot even hold the load and move the joint slowly.

        Raises:
            ParamsError: The limits contradict each other.
        """
        needed, at, unit = joint.least_torque(*self.position), self.units.position, self.units.text(TORQUE)
        if self.torque < needed:
            raise ParamsError(
                f"joint {joint.name}: the limits contradict each other: holding the load within "
                f"{self.position[0]:.3g} to {self.position[1]:.3g} {at} and overcoming friction needs {needed:.3g} "
                f"{unit}, and the torque limit is {self.torque:.3g} {unit}; raise the torque limit or narrow the "
                "position limits"
            )

    def require_resolved(self, joint: DesignJoint) -> None:
        """Refuse a velocity limit at which no sample would take part in a diagnosis.

        Raises:
            ParamsError: The limit is not above the speed that the encoder resolves.
        """
        unit = f"{self.units.position}/s"
        if self.velocity <= joint.slowest:
            raise ParamsError(
                f"joint {joint.name}: a velocity limit of {self.velocity:.3g} {unit} is too small: a diagnosis leaves "
                f"out speeds below {joint.slowest:.3g} {unit}, which the encoder does not resolve"
            )

    def with_margin(self, share: float) -> "JointLimits":
        """The same limits a share narrower, so that a motion between samples keeps the true ones."""
        low, high = self.position
        middle, half = 0.5 * (low + high), 0.5 * (high - low) * (1.0 - share)
        rest = (1.0 - share) * self.velocity, (1.0 - share) * self.acceleration, (1.0 - share) * self.jerk
        torque = (1.0 - share) * self.torque
        return JointLimits((middle - half, middle + half), *rest, torque, self.bandwidth_hz, self.units)


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
        scale: (n,) amplitude [rad] of each function: parameters are of the order of 1.
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

    @property
    def one(self) -> FloatArray:
        """(n,) parameters of the constant motion 1."""
        own = self.frequency_hz == 0.0 if self.kind == "fourier" else np.ones(self.size)
        return np.asarray(own / self.scale)

    def motion(self, x: FloatArray) -> FloatArray:
        """(4, T) position, velocity, acceleration and jerk for x (n,)."""
        return np.asarray(self.matrices @ x)


def whole_step(period: float, step: float) -> float:
    """The step nearest to `step` [s] of which a period is a multiple, so that the motion closes at its end."""
    return period / max(1, round(period / step))


def motion_basis(
    kind: BasisKind, period: float, step: float, limits: JointLimits, most: int = MOST_FREQUENCIES
) -> MotionBasis:
    """The functions of one period, each with the largest amplitude that it may have alone.

    Args:
        kind: Of the functions.
        period: P [s].
        step: Time between samples [s]; P is rounded to a whole number of them.
        limits: Of the motion; no frequency is above their bandwidth.
        most: Frequencies at most.

    Raises:
        ParamsError: A period too short for two frequencies below the bandwidth.
    """
    time: FloatArray = np.asarray(np.arange(round(period / step)) * step, dtype=np.float64)
    highest = int(np.floor(limits.bandwidth_hz * period + 1e-9))
    if highest < 2:
        raise ParamsError(
            f"a motion of {period:g} s has fewer than two frequencies below the drive's bandwidth of "
            f"{limits.bandwidth_hz:g} Hz; lengthen --duration or raise --bandwidth"
        )
    if kind == "fourier":
        matrices, frequency = _fourier(time, period, highest, most)
    else:
        matrices, frequency = _bspline(time, period, limits.bandwidth_hz)
    omega = 2.0 * np.pi * np.maximum(frequency, 1e-9)
    half = 0.5 * (limits.position[1] - limits.position[0])
    scale = np.minimum(half, np.minimum(limits.velocity / omega, limits.acceleration / omega**2))
    return MotionBasis(kind, period, step, matrices * scale, frequency, scale)


def _fourier(time: FloatArray, period: float, highest: int, most: int) -> tuple[FloatArray, FloatArray]:
    """((4, T, n) functions of amplitude 1 and their derivatives, (n,) frequencies [Hz])."""
    numbers = np.unique(np.round(np.geomspace(1, highest, most)).astype(int))
    omega, frequency = 2.0 * np.pi * numbers / period, numbers / period
    phase = omega[None, :] * time[:, None]
    blocks = []
    for order in range(4):
        turned = phase + 0.5 * np.pi * order
        scale = omega**order
        constant = np.full((time.size, 1), 1.0 if order == 0 else 0.0)
        blocks.append(np.hstack([constant, scale * np.cos(turned), scale * np.sin(turned)]))
    return np.stack(blocks), np.concatenate([[0.0], frequency, frequency])


def _bspline(time: FloatArray, period: float, bandwidth_hz: float) -> tuple[FloatArray, FloatArray]:
    """The same: two knots for each half wave of the highest frequency that 30 knots reach, at most the bandwidth."""
    count = int(np.clip(np.ceil(4.0 * bandwidth_hz * period), DEGREE + 3, 30))
    spacing = period / count
    knots = np.arange(-DEGREE, count + DEGREE + 1) * spacing
    weights = np.eye(count)[np.arange(count + DEGREE) % count]  # what leaves one end enters at the other
    splines = [BSpline(knots, weights, DEGREE)]
    for _ in range(3):
        splines.append(splines[-1].derivative())
    return np.stack([spline(time) for spline in splines]), np.full(count, 0.25 / spacing)


EDGE = 0.02
"""Share of the position range that the mean of a motion keeps away from its ends."""
SHRINKING, LEAST_SHARE = 0.93, 1e-3
"""Factor by which a motion is made smaller until it is allowed, and its least share."""


def shrunk(
    bases: Sequence[MotionBasis],
    limits: Sequence[JointLimits],
    x: FloatArray,
    allowed: Callable[[FloatArray], bool],
    centre: FloatArray | None = None,
) -> FloatArray | None:
    """Motions (n, m) of n joints, made smaller about their means until they keep the limits; None where none does.

    Args:
        bases: Of each joint.
        limits: Of each joint; the torques are not looked at.
        x: (n, m) parameters.
        allowed: Of a motion (4, T, n).
        centre: (n,) positions to which the means go as the motion becomes smaller; None leaves them.
    """
    rows = []
    for i, (basis, each, row) in enumerate(zip(bases, limits, x, strict=True)):
        low, high = each.position
        own, edge = float(np.mean(basis.matrices[0] @ row)), EDGE * (high - low)
        mean, swing = float(np.clip(own, low + edge, high - edge)), row - own * basis.one
        end = mean if centre is None else float(np.clip(centre[i], low, high))
        rows.append((mean, end, basis.one, each.share_kept(mean, basis.motion(swing)) * swing))
    share = 1.0
    while share > LEAST_SHARE:
        tried = np.stack(
            [(mean + (1.0 - share) * (end - mean)) * one + share * swing for mean, end, one, swing in rows]
        )
        if allowed(np.stack([basis.motion(row) for basis, row in zip(bases, tried, strict=True)], axis=-1)):
            return tried
        share *= SHRINKING
    return None
