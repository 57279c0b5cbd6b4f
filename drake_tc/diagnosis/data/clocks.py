"""What the clocks of a log do to the balance: sampling instants that scatter, and a torque on a slower clock.

**Scatter.** A position that is sampled at t_k + delta_k, while the log says t_k, errs by qdot(t_k) delta_k. In blocks
of the log, the density at high frequencies is then that of white noise of the variance

    sigma^2 + delta^2 <qdot^2>,

with sigma the noise of the encoder and delta the standard deviation of the delta_k. Both are fitted to the third
differences of each block at each frequency between a quarter and half of the sampling rate. A scatter is taken only
where it is beyond doubt, and where it matters: what grows with the speed for another reason, such as a vibration, a
controller's steps or the rounding of an encoder, is not white, does not grow in proportion to the speed, or stays below
a step. Through the filters of acceleration and velocity, with the momentum p = M qdot of links that a robot's model
gives, row i of the balance errs by

    n_i = sum_m delta_m (J k''_(i-m) qdot_m + l''_(i-m) p_m + F_v k'_(i-m) qdot_m)

whose variance is that of independent delta_m. Effort and load are sampled with the position and err with it; what they
add is small beside the differentiated position, and partly cancels: it is left out.

**A slower torque.** A torque that is sampled every T_s and interpolated between turns a jump by A into a ramp over one
T_s. The jump itself lies a time u from the middle of the ramp, with u anywhere within +-T_s/2. Through both filters
k (1/s), which are wide against T_s, a row at t errs by A u k(t - t_A), of the variance

    s^2(t) = (T_s^2/12) sum_A A^2 k(t - t_A)^2.

If the jumps recur at the samples' own rhythm, u is the same at each of them, so the error looks like an effect that
acts at jumps: a saturation, a payload, a delay. It is noise of unknown sign none the less. Where the torque jumps is
read from the torque. With x its interpolated curve and h = T_s/2,

    D(t) = d(t) - (d(t - T_s) + d(t + T_s))/2,    d(t) = x(t + h) - x(t - h)

is near 0 of a smooth curve, and the integral of D^2 over time is 2/3 A^2 T_s for a jump by A. Values that the noise of
the torque explains are no jumps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import oaconvolve

from drake_tc.diagnosis.data.channels import Channels
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import FloatArray, IntArray

BLOCK = 32
"""Samples of a block; blocks overlap by half."""
LEAST_BLOCKS = 60
LEAST_REST = 8
"""Samples over which a command that does not change rests."""
LOWEST = 0.25
"""Lowest frequency, over the sampling rate."""
ROUNDS = 20
"""Of reweighting the fit by the variance that it finds."""
CERTAIN = 6.0
"""Standard deviations of delta^2 that it must reach."""
FAST = 0.9
"""Share of the blocks that are slower than the speed at which the scatter must exceed the encoder's noise."""
STEPS = 2.0
"""Variance by the scatter at that speed, over that of rounding to steps, at least."""
UNEVEN = 1.5
"""Ratio of delta^2 in the upper and in the lower half of the frequencies, and of the noise over the model in the faster
and the slower half of the blocks in which the scatter is the larger part of it, at most."""
BANDS = 4
"""In which the scatter of a command is looked for."""
MOST_POWER = 5.0
"""Power of a block over its mean that counts at most: an exponential variable is larger in 0.7 % of the cases."""
MEDIAN_OF_CORRELATED = 3.0
"""Variance of a median over F frequencies of overlapping tapered blocks, times F, over that at one frequency."""
LEAST_GROUP = 15
"""Blocks of a group that is compared with another one, at least."""
MOST_BLOCKS = 4000
LEAST_NOISE = 1e-12
"""Of a position [rad], so that noise-free logs have a resolution too."""
Part = tuple[FloatArray, FloatArray]
"""Values (T,) that the scatter multiplies, and the weights of an odd number of samples through which they pass."""
OF_A_JUMP = 2.0 / 3.0
"""Integral of D^2 over time, over A^2 T_s."""
BEYOND_NOISE = 5.0
"""Standard deviations of D from which on it is a jump."""
DEVIATION_OF_MEDIAN = 1.4826
"""Standard deviation over the median magnitude, of a normal distribution."""


@dataclass(frozen=True)
class TimingScatter:
    """What the position's noise shows of the instants of sampling.

    Attributes:
        time: delta [s].
        noise: sigma, standard deviation of one position of a joint at rest, its steps included [rad].
        speed, fastest: RMS over time and largest of the speeds, means over short blocks [rad/s].
    """

    time: float
    noise: float
    speed: float
    fastest: float

    def position_noise(self, speed: FloatArray) -> FloatArray:
        """(T,) RMS noise of one position [rad] in motion of these speeds (T,) [rad/s]."""
        return np.hypot(self.noise, self.time * speed)


def timing_scatter(position: FloatArray, segments: Sequence[slice], period: float, step: float) -> TimingScatter | None:
    """The scatter of the instants at which a position was sampled; None where the log shows none.

    Args:
        position: (T,) [rad].
        segments: Uniform stretches.
        period: [s].
        step: Of the encoder [rad]; 0 where the positions lie on no grid.
    """
    power, speed2 = _blocks(position, segments, period)
    if len(speed2) < LEAST_BLOCKS or not np.any(speed2 > 0.0):
        return None
    noise, growth, deviation = _fitted(power, speed2)
    fast = float(np.quantile(speed2, FAST))
    least = max(noise, STEPS * step**2 / 12.0)
    if not growth > CERTAIN * deviation or growth * fast < least:
        return None
    half = power.shape[1] // 2
    halves = [_fitted(part, speed2)[1] for part in (power[:, :half], power[:, half:])]
    if min(halves) * UNEVEN < max(halves) or not _in_proportion(power, speed2, noise, growth):
        return None
    speed = float(np.sqrt(np.mean(speed2)))
    own = max(float(np.sqrt(noise)), step / float(np.sqrt(12.0)), LEAST_NOISE)
    return TimingScatter(float(np.sqrt(growth)), own, speed, float(np.sqrt(speed2.max())))


def command_scatter(command: FloatArray, segments: Sequence[slice], period: float) -> float:
    """Standard deviation [s] of the instants at which a position command was read; 0 where the log shows none.

    A command that is held until its next step is read with a random age of up to one step, and errs by the speed times
    this age. That of a regular pattern of the two clocks lies near a few frequencies, and passes no filter: the band
    with the least error counts. A command that rests, or jumps between rests, has an age that the log shows.

    Args:
        command: (T,) [rad].
        segments: Uniform stretches.
        period: [s].
    """
    power, speed2 = _blocks(command, _changing(command, segments), period)
    if len(speed2) < LEAST_BLOCKS or not np.any(speed2 > 0.0):
        return 0.0
    fits = [_fitted(part, speed2) for part in np.array_split(power, BANDS, axis=1)]
    _, growth, deviation = min(fits, key=lambda fit: fit[1])
    return float(np.sqrt(growth)) if growth > CERTAIN * deviation else 0.0


def _changing(command: FloatArray, segments: Sequence[slice]) -> list[slice]:
    """The stretches of a command (T,) between its rests of at least `LEAST_REST` samples."""
    out = []
    for s in segments:
        changes = s.start + np.flatnonzero(np.diff(command[s], prepend=np.nan, append=np.nan))
        ends = np.flatnonzero(np.diff(changes) > LEAST_REST)
        starts = changes[np.append(0, ends + 1)]
        out += [slice(int(a), int(b)) for a, b in zip(starts, changes[np.append(ends, -1)], strict=True)]
    return out


def _blocks(position: FloatArray, segments: Sequence[slice], period: float) -> tuple[FloatArray, FloatArray]:
    """(power (B, F), squared speed (B,) [(rad/s)^2]) of blocks; the power is 1 on average for unit white noise."""
    window = np.hanning(BLOCK + 1)[:BLOCK]
    weight = window**2 / np.sum(window**2)
    frequency = np.fft.rfftfreq(BLOCK)
    high = frequency > LOWEST
    unit = np.sum(window**2) * (2.0 * np.sin(np.pi * frequency[high])) ** 6
    kernel = CommonKernel(8.0 * period, period)
    power, speed2 = [np.zeros((0, int(high.sum())))], [np.zeros(0)]
    for s in segments:
        if s.stop - s.start < BLOCK + 3 + 2 * kernel.margin:
            continue
        inner = slice(kernel.margin, s.stop - s.start - kernel.margin)
        third = np.lib.stride_tricks.sliding_window_view(np.diff(position[s], 3)[inner], BLOCK)[:: BLOCK // 2]
        speed = np.lib.stride_tricks.sliding_window_view(kernel.derivative(position[s])[inner], BLOCK)[:: BLOCK // 2]
        power.append(np.abs(np.fft.rfft(third * window)[:, high]) ** 2 / unit)
        speed2.append((speed[: len(third)] ** 2) @ weight)
    thin = slice(None, None, max(1, -(-sum(map(len, speed2)) // MOST_BLOCKS)))
    return np.concatenate(power)[thin], np.concatenate(speed2)[thin]


def _fitted(power: FloatArray, speed2: FloatArray) -> tuple[float, float, float]:
    """(sigma^2, delta^2, standard deviation of delta^2), medians over the frequencies.

    Least squares at each frequency, weighted by the variances of the model. The power of a block has an exponential
    distribution; it counts with at most `MOST_POWER` of its mean, so that a blow does not decide.
    """
    design = np.stack([np.ones_like(speed2), speed2], axis=-1)
    least = 1e-6 * max(float(np.mean(power)), 1e-300)
    model = np.full(speed2.shape, max(float(np.median(power)), least))
    noise = growth = deviation = 0.0
    for _ in range(ROUNDS):
        scaled = design / model[:, None]
        inverse = np.linalg.pinv(scaled.T @ scaled)
        clipped = np.minimum(power / model[:, None], MOST_POWER)
        noise, growth = (float(x) for x in np.median(inverse @ (scaled.T @ clipped), axis=1))
        noise, growth = max(noise, 0.0), max(growth, 0.0)
        model = np.maximum(noise + growth * speed2, least)
        deviation = float(np.sqrt(inverse[1, 1] * MEDIAN_OF_CORRELATED / power.shape[1]))
    return noise, growth, deviation


def _in_proportion(power: FloatArray, speed2: FloatArray, noise: float, growth: float) -> bool:
    """Whether the noise grows as the speed does among the blocks in which the scatter is the larger part of it."""
    order = np.argsort(speed2)
    order = order[growth * speed2[order] > noise]
    if order.size < 2 * LEAST_GROUP:
        return False
    model = (noise + growth * speed2)[:, None]
    relative = np.minimum(power / model, MOST_POWER)
    slower, faster = (float(np.median(np.mean(relative[part], axis=0))) for part in np.array_split(order, 2))
    return max(slower, faster) < UNEVEN * min(slower, faster)


def timing_moments(scatter: float, parts: Sequence[Part], rows: IntArray) -> FloatArray:
    """(N, n, n) second moments of sum_m delta_m w_(i-m) x_m on the rows (N,), for n parts (x, w).

    Args:
        scatter: Standard deviation of delta [s].
        parts: Of one uniform clock.
        rows: Where.
    """
    longest = max(weights.size for _, weights in parts)
    padded = [(x, np.pad(w, (longest - w.size) // 2)) for x, w in parts]
    out = np.zeros((rows.size, len(parts), len(parts)))
    for a, (x, w) in enumerate(padded):
        for b, (y, u) in enumerate(padded[: a + 1]):
            passed = oaconvolve(np.pad(x * y, longest // 2), w * u, mode="valid")
            out[:, a, b] = out[:, b, a] = scatter**2 * passed[rows]
    return out


def timing_of_rows(
    scatter: float, channels: Channels, light: CommonKernel, final: CommonKernel, velocity: FloatArray, rows: IntArray
) -> FloatArray:
    """(N, 3, 3) moments of what passes the inertia, the viscous friction and the links, of rows of a joint's channels.

    Runs with `acceleration_weights` have accelerations and loads that passed these weights before the light kernel.
    """
    momentum = np.nan_to_num(channels.raw("momentum"))
    rate = np.convolve(light.kernels[1], final.kernels[0])
    out = np.zeros((rows.size, 3, 3))
    for number, run in {i: run for i, run, _ in channels.pieces}.items():
        mine = channels.run_of_sample[rows] == number
        weights = run.acceleration_weights
        first = light.kernels[2] if weights is None else np.convolve(weights, light.kernels[0])
        inertial = np.convolve(first, final.kernels[0])
        parts = ((velocity, inertial), (velocity, rate), (momentum, inertial))
        out[mine] = timing_moments(scatter, parts, rows[mine])
    return out


def jumps_squared(torque: FloatArray, ratio: float) -> FloatArray:
    """(T,) A^2 spread over the samples near each jump: its sum over them is the sum of A^2 over the jumps.

    Args:
        torque: (T,) of one stretch, interpolated between the samples of a slower clock [N m].
        ratio: T_s over the period of the log.
    """
    at = np.arange(torque.size, dtype=np.float64)
    steps = [
        np.interp(at + (shift + 0.5) * ratio, at, torque) - np.interp(at + (shift - 0.5) * ratio, at, torque)
        for shift in (-1.0, 0.0, 1.0)
    ]
    jump = steps[1] - (steps[0] + steps[2]) / 2.0
    noise = DEVIATION_OF_MEDIAN * float(np.median(np.abs(jump)))
    return np.where(np.abs(jump) > BEYOND_NOISE * noise, jump**2 / (OF_A_JUMP * ratio), 0.0)


def between_samples(
    torque: FloatArray, segments: Sequence[slice], ratios: Sequence[float], weights: FloatArray
) -> FloatArray:
    """(T,) variances s^2 of what a torque lacks between its samples, after the filters [N m]^2.

    Args:
        torque: (T,) interpolated between its samples [N m].
        segments: Uniform stretches.
        ratios: Of each stretch, T_s over the period of the log; 1 where the torque has the clock of the log.
        weights: Of both filters together, an odd number that sums to 1.
    """
    jumps = np.zeros(torque.size)
    for segment, ratio in zip(segments, ratios, strict=True):
        if ratio > 1.0:
            jumps[segment] = ratio**2 / 12.0 * jumps_squared(torque[segment], ratio)
    passed = oaconvolve(np.pad(jumps, weights.size // 2), weights**2, mode="valid")
    return np.asarray(np.maximum(passed, 0.0))
