"""What the sensors resolve, estimated from the log itself, and the filter width that follows from it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Resolution:
    """What the sensors resolve, estimated from the log itself.

    Attributes:
        position_step: Smallest step between different positions [rad].
        position_noise, torque_noise: White noise of one raw sample [rad, N m].
        velocity_noise: Of the filtered velocity [rad/s].
    """

    position_step: float
    position_noise: float
    torque_noise: float
    velocity_noise: float


def light_width(position: FloatArray, segments: Sequence[slice], period: float) -> tuple[float, float, float]:
    """Width of the light kernel [s] and the position's (step, noise) [rad].

    The narrowest width whose acceleration noise is below 4 % of the acceleration's own spread, between 4 periods (at
    least 12 ms) and 60 ms: wide enough to differentiate the encoder twice, narrow enough to keep reversals sharp.
    """
    inside = np.concatenate([position[s] for s in segments])
    steps = np.abs(np.diff(inside))
    positive = steps[steps > 1e-12]
    step = float(np.min(positive)) if positive.size else 0.0
    if step and np.mean(np.abs(np.round(positive / step) * step - positive) < 0.02 * step) <= 0.9:
        step = 0.0  # no grid: the positions are not quantised
    third = np.concatenate([np.diff(position[s], 3) for s in segments if s.stop - s.start > 8] or [np.zeros(1)])
    noise = max(step / np.sqrt(12.0), 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0), 1e-12)
    width = max(4.0 * period, 0.012)
    while width < 0.060:
        kernel = CommonKernel(width, period)
        longest = max(segments, key=lambda s: s.stop - s.start)
        acceleration = kernel.second_derivative(position[longest])
        gain = float(np.sqrt(np.sum(kernel.kernels[2] ** 2)))
        if noise * gain < 0.04 * float(np.std(acceleration)):
            break
        width *= 1.25
    return width, step, noise


def white_noise(values: FloatArray, segments: Sequence[slice]) -> float:
    """Standard deviation of the white part of a channel (T,), from its third differences; 0 where not recorded."""
    third = np.concatenate([np.diff(values[s], 3) for s in segments])
    third = third[np.isfinite(third)]
    return 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0) if third.size else 0.0


@dataclass(frozen=True)
class NoiseFloor:
    """What sensor noise and encoder steps alone leave in the balance [N m].

    White noise of a raw sample (`Resolution`) through the kernels and the balance's coefficients: torque noise through
    k, encoder noise through J k'' + F_v k' (+ k/K where the effort is q_d - q), J [kg m^2] with a pendulum's own.

    Attributes:
        torque_variance: Of the torque noise after both kernels [N m]^2.
        encoder_gram: (3, 3) inner products of k'', k', k times the encoder's variance.
        inertia: J [kg m^2].
        servo: Whether the effort holds the position.
    """

    torque_variance: float
    encoder_gram: FloatArray
    inertia: float
    servo: bool

    @classmethod
    def of(
        cls, resolution: Resolution, light: CommonKernel, final: CommonKernel, inertia: float, *, servo: bool
    ) -> Self:
        """The floor of rows that passed `light` and then `final`."""
        k = np.stack([np.convolve(light.kernels[d], final.kernels[0]) for d in (2, 1, 0)])
        gram = resolution.position_noise**2 * (k @ k.T)
        return cls(resolution.torque_noise**2 * float(k[2] @ k[2]), gram, inertia, servo)

    def torque(self, stiffness: float, viscous: float, more_inertia: float = 0.0) -> float:
        """RMS [N m] under 1/K = `stiffness` [N m/effort], F_v = `viscous` and J + `more_inertia`."""
        weights = np.array([self.inertia + more_inertia, viscous, stiffness if self.servo else 0.0])
        return float(np.sqrt(self.torque_variance + weights @ self.encoder_gram @ weights))
