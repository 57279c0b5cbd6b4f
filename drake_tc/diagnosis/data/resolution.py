"""What the sensors resolve, estimated from the log itself, and the filter width that follows from it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from drake_tc.diagnosis.data.clocks import TimingScatter
from drake_tc.effects.base import Signals
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import FloatArray, IntArray

WIDEST_LIGHT = 0.060
"""Widest light kernel [s] that the encoder's noise alone may ask for."""
ACCELERATION_NOISE = 0.04
"""Noise of the filtered acceleration, as a share of the acceleration's own spread, that the light kernel leaves."""

WIDEST_FINAL = 0.25
"""Widest final kernel [s]."""
MOST_WIDENING = 4.0
"""Width of the final kernel over the light kernel's, at most."""
LEAST_COVER = 0.7
"""Share of the moving samples usable under the narrowest final kernel that a wider one must leave usable."""
REPLAY_WIDER = 3.0
"""Width of the kernel that frees the position of its steps before they are replayed, over the light kernel's."""

SPEED_OF_NOISE = 5.0
"""Speed over the noise of the filtered velocity, above which the joint resolvably moves."""

SPEED_PHASES = (0.0, 0.25, 0.5, 0.75)
"""Offsets of the grid, in steps, over which the replayed rounding of a velocity is averaged.

A nearly constant speed stays on one step for longer than any filter, which leaves it close to the grid.
"""


@dataclass(frozen=True)
class Resolution:
    """What the sensors resolve.

    Attributes:
        position_step: Step of the encoder as recorded [rad]; 0 where the positions lie on no grid.
        position_noise: Standard deviation of one raw position sample, steps included [rad].
        torque_noise: The same of the torque [N m].
        velocity_noise: Of the filtered velocity [rad/s].
        torque_correlation_time: Declared correlation time of the torque noise [s]; 0 for white noise.
        torque_is_declared: Whether the rig file declares the torque noise, so that the log is not asked for its colour.
        effort_step: Step of the recorded command [rad | A | V | N m]; 0 where it lies on no grid.
        effort_noise: White noise of one sample of a recorded current, voltage, torque command or position command.
        effort_tells_load: Whether no sensor but the effort tells the load (unknown, or a robot's links), so that its
            noise is in the floor of all fits. Elsewhere it counts in what is left
            (`noise_colour.left_by_effort_noise`).
        velocity_step: Step of the recorded velocity of a speed-only log [rad/s]; 0 where there is none.
        raw_velocity_noise: Standard deviation of one raw velocity sample of a speed-only log [rad/s]; 0 where the
            position was recorded.
        speed_at_rest: RMS of the filtered velocity of a joint at rest [rad/s]; 0 where it hardly rests.
        timing: Scatter of the instants at which the position was sampled, and the noise of a position beside it; None
            where the log shows no scatter. `position_noise` is then that of the typical motion.
        command_scatter: Of the instants at which a position command was read [s], see `clocks.command_scatter`.
    """

    position_step: float
    position_noise: float
    torque_noise: float
    velocity_noise: float
    torque_correlation_time: float = 0.0
    torque_is_declared: bool = False
    effort_step: float = 0.0
    effort_noise: float = 0.0
    effort_tells_load: bool = False
    velocity_step: float = 0.0
    raw_velocity_noise: float = 0.0
    speed_at_rest: float = 0.0
    timing: TimingScatter | None = None
    command_scatter: float = 0.0

    @property
    def least_speed(self) -> float:
        """Speed above which the joint resolvably moves [rad/s]."""
        return SPEED_OF_NOISE * max(self.velocity_noise, self.speed_at_rest)

    def torque_pole(self, period: float) -> float:
        """Correlation of the torque's noise from one sample to the next."""
        memory = self.torque_correlation_time
        return float(np.exp(-period / memory)) if memory > 0.0 else 0.0


def light_width(
    values: FloatArray,
    noise: float,
    segments: Sequence[slice],
    period: float,
    slowest: float | None = None,
    *,
    order: int = 2,
) -> float:
    """Width of the light kernel [s].

    The narrowest width whose acceleration noise is below 4 % of the acceleration's own spread over all stretches,
    between 4 periods (at least 12 ms) and 60 ms: wide enough to differentiate the encoder twice, narrow enough to keep
    reversals sharp. The periods are those of the slowest channel: between its samples it is interpolated, and what is
    faster is in the other channels alone.

    Args:
        values: (T,) position [rad], or velocity [rad/s].
        noise: Standard deviation of one sample, in the same unit.
        segments: Uniform stretches.
        period: Of the log [s].
        slowest: Of the channel with the slowest clock [s]; None where all have that of the log.
        order: Derivative of the values that is the acceleration: 2 of a position, 1 of a velocity.
    """
    width = max(4.0 * (period if slowest is None else slowest), 0.012)
    while width < WIDEST_LIGHT:
        kernel = CommonKernel(width, period)
        inner = [slice(s.start + kernel.margin, s.stop - kernel.margin) for s in segments]
        acceleration = kernel.second_derivative(values) if order == 2 else kernel.derivative(values)
        kept = np.concatenate([acceleration[s] for s in inner if s.stop > s.start] or [acceleration])
        gain = float(np.sqrt(np.sum(kernel.kernels[order] ** 2)))
        if noise * gain < ACCELERATION_NOISE * float(np.std(kept)):
            break
        width *= 1.25
    return width


def final_widths(acceleration: FloatArray, noise: float, light: CommonKernel, *, order: int = 2) -> list[float]:
    """Widths of the final kernel [s] to try, from the light kernel's own to the one that noise asks for.

    The light kernel is kept short because nonlinear columns are computed from what it lets through. A coarse encoder
    then leaves noise in the acceleration that covers the balance; the final kernel, which every column passes alike,
    may be wider. The last width is the narrowest after which the acceleration's noise is below 4 % of its own spread,
    at most four light kernels and 250 ms.

    Args:
        acceleration: (T,) after the light kernel [rad/s^2].
        noise: Standard deviation of one sample of what is differentiated [rad | rad/s].
        light: First kernel.
        order: Derivative of the recorded signal that is the acceleration.
    """
    first = light.kernels[order]
    passed = noise * float(np.sqrt(np.sum(first**2)))
    spread = float(np.sqrt(np.maximum(np.var(acceleration) - passed**2, 0.0)))
    width = light.actual_width_s
    widths, widest = [width], min(MOST_WIDENING * width, max(WIDEST_FINAL, width))
    while width < widest:
        kernel = np.convolve(first, CommonKernel(width, light.period).kernels[0])
        if noise * float(np.sqrt(np.sum(kernel**2))) < ACCELERATION_NOISE * spread:
            break
        width = min(1.25 * width, widest)
        widths.append(width)
    return widths


def quantisation_error(position: FloatArray, step: float) -> FloatArray:
    """What rounding to multiples of `step` [rad] adds to a smooth position (T,) [rad], or to a velocity [rad/s].

    At low speed it is a slow sawtooth that no low-pass removes, which white noise of the same size does not show.
    """
    return np.asarray(np.round(position / step) * step - position)


def _motion_gram(
    resolution: Resolution, light: CommonKernel, final: CommonKernel, signals: Signals, rows: IntArray
) -> FloatArray:
    """(3, 3) second moments of the errors of acceleration, velocity and position after both kernels.

    An error of the encoder passes k'', k' and k. One of a recorded velocity passes k' and k; the position that is
    integrated from it takes part in nothing that a noise floor is told of.
    """
    speed_only = resolution.raw_velocity_noise > 0.0
    step, white = resolution.position_step, resolution.position_noise
    if resolution.timing is not None:
        white = resolution.timing.noise
    recorded = signals.position
    if speed_only:
        step, white, recorded = resolution.velocity_step, resolution.raw_velocity_noise, signals.velocity
    orders = (1, 0) if speed_only else (2, 1, 0)
    k = np.stack([np.convolve(light.kernels[d], final.kernels[0]) for d in orders])
    gram = white**2 * (k @ k.T)
    if step > 0.0 and rows.size:
        # the light kernel alone leaves the recorded steps in the channel, and rounding finds less to round
        wide = CommonKernel(REPLAY_WIDER * light.actual_width_s, light.period)
        smooth, passed = wide.smooth(recorded), (light.smooth, light.derivative, light.second_derivative)
        gram = max(white**2 - step**2 / 12.0, 0.0) * (k @ k.T)
        phases = SPEED_PHASES if speed_only else (0.0,)
        for phase in phases:
            error = quantisation_error(smooth + phase * step, step)
            replay = np.stack([final.smooth(passed[d](error))[rows] for d in orders])
            gram = gram + replay @ replay.T / (rows.size * len(phases))
    padded = np.zeros((3, 3))
    padded[: len(orders), : len(orders)] = gram
    return padded


@dataclass(frozen=True)
class NoiseFloor:
    """What sensor noise and encoder steps alone leave in the balance [N m].

    Noise of a raw sample (`Resolution`) through the kernels and the balance's coefficients: torque noise through k,
    encoder noise through J k'' + F_v k' + s k (+ k/K where the effort is q_d - q), J [kg m^2] with a pendulum's own and
    s = d tau/dq where the load is computed from the position. Scatter of the sampling instants (`data.clocks`) adds to
    the encoder's noise.

    Attributes:
        torque_variance: Of the torque noise after both kernels [N m]^2.
        encoder_gram: (3, 3) second moments of the encoder's error after k'', k', k [rad^2/s^4, ..., rad^2].
        inertia: J [kg m^2].
        servo: Whether the effort holds the position.
        effort_variance: Of the effort's rounding or noise after both kernels [effort]^2.
        load_slope: RMS of d tau/dq of a load that is computed from the position [N m/rad].
        timing: (3, 3) second moments, the means over the rows, of what scatter of the sampling instants adds to the
            acceleration, to the velocity [rad^2/s^4, ..., rad^2/s^2] and, by the links' momentum, to the load [N m]^2.
    """

    torque_variance: float
    encoder_gram: FloatArray
    inertia: float
    servo: bool
    effort_variance: float = 0.0
    load_slope: float = 0.0
    timing: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))

    @classmethod
    def of(
        cls,
        resolution: Resolution,
        light: CommonKernel,
        final: CommonKernel,
        signals: Signals,
        rows: IntArray,
        *,
        servo: bool,
        timing: FloatArray | None = None,
    ) -> Self:
        """The floor of rows that passed `light` and then `final`.

        Args:
            resolution: Of the raw samples.
            light: First kernel.
            final: Second kernel.
            signals: (T,) filtered; the encoder's steps are replayed on their motion.
            rows: (N,) of T.
            servo: Whether the effort is q_d - q.
            timing: (N, 3, 3) `timing_moments` of the rows; None where the sampling instants do not scatter.
        """
        k = np.stack([np.convolve(light.kernels[d], final.kernels[0]) for d in (2, 1, 0)])
        gram = _motion_gram(resolution, light, final, signals, rows)
        lags = np.abs(np.subtract.outer(np.arange(k.shape[1]), np.arange(k.shape[1]))) * light.period
        memory = resolution.torque_correlation_time
        correlation = np.exp(-lags / memory) if memory > 0.0 else np.eye(k.shape[1])
        noise = resolution.effort_noise if resolution.effort_tells_load else 0.0
        effort = max(resolution.effort_step**2 / 12.0, noise**2) * float(k[2] @ k[2])
        slope = float(np.sqrt(np.mean(signals.load_slope[rows] ** 2))) if rows.size else 0.0
        return cls(
            torque_variance=resolution.torque_noise**2 * float(k[2] @ correlation @ k[2]),
            encoder_gram=gram,
            inertia=signals.rotor_inertia + signals.link_inertia,
            servo=servo,
            effort_variance=effort,
            load_slope=slope,
            timing=np.zeros((3, 3)) if timing is None or not rows.size else np.mean(timing, axis=0),
        )

    def torque(self, stiffness: float, viscous: float, more_inertia: float = 0.0) -> float:
        """RMS [N m] under 1/K = `stiffness` [N m/effort], F_v = `viscous` and J + `more_inertia`."""
        held = self.load_slope + (stiffness if self.servo else 0.0)
        weights = np.array([self.inertia + more_inertia, viscous, held])
        rounding = stiffness**2 * self.effort_variance
        encoder = weights @ self.encoder_gram @ weights
        return float(np.sqrt(self.torque_variance + rounding + encoder + self.timing_variance(viscous, more_inertia)))

    def timing_variance(
        self, viscous: float, more_inertia: float = 0.0, moments: FloatArray | None = None
    ) -> FloatArray:
        """What scatter of the sampling instants leaves [N m]^2; () of the whole floor, (N,) of `moments` (N, 3, 3)."""
        weights = np.array([self.inertia + more_inertia, viscous, 1.0])
        return np.asarray(weights @ (self.timing if moments is None else moments) @ weights)
