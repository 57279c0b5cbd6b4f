"""What the sensors of one joint resolve: as the rig file declares, else as the recorded channels show.

The noise of one sample of a channel is told apart from its steps, its staircase and the lines of a controller.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from drake_tc.diagnosis.data.channels import Channels
from drake_tc.diagnosis.data.clocks import LEAST_NOISE
from drake_tc.diagnosis.data.resolution import WIDEST_FINAL, WIDEST_LIGHT, Resolution
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.channels import run_lengths
from drake_tc.logs.loads import Pendulum, RobotLoad, unknown_form
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

SLOWEST_TOPIC: Mapping[bool, float] = {False: WIDEST_FINAL, True: WIDEST_LIGHT}
"""Time [s] for which a command may typically stay the same and still be a channel that a slower topic reports; of a
position servo (true), whose goal is never measured, less than of another drive. Values that stay for longer are steps
that somebody commands, and the differences between them are no noise."""
ORDERS = (3, 4, 5, 6)
"""Of the differences that tell a goal's scatter; the higher the order, the less of a slowly sampled motion is left."""
STEPS = 0.05
"""Share of a goal's samples that may belong to steps."""
MEDIAN_BETWEEN_SAMPLES = 1.703
"""Median magnitude of x(t + 3T) - 3 x(t + 2T) + 3 x(t + T) - x(t) over the standard deviation of white samples every T
between which x is interpolated, t at all places between them."""
LINE_BLOCK = 256
"""Samples of a spectrum in which lines are told from noise."""
MOSTLY_LINES = 0.7
"""Noise between the lines over that of the third differences, below which the latter are called lines."""


def encoder_of(channels: Channels, rig: Rig, position: FloatArray) -> tuple[float, float]:
    """(step, standard deviation of one sample with its steps) of the position [rad]: declared, or from the log.

    Of a speed-only log the same of the velocity [rad/s].
    """
    if channels.speed_only:
        step = channels.step("velocity")
        return step, max(sample_noise(channels.raw("velocity"), step, channels.segments), LEAST_NOISE)
    declared = rig.joint_sensors(channels.joint)
    step = channels.step("position") if declared.encoder_step is None else declared.encoder_step
    if declared.position_noise is not None:
        return step, max(float(np.hypot(declared.position_noise, step / np.sqrt(12.0))), LEAST_NOISE)
    return step, max(_noise(channels, "position", position, step), LEAST_NOISE)


def resolution_of(channels: Channels, rig: Rig, step: float, noise: float, light: CommonKernel) -> Resolution:
    """What the joint's sensors resolve, after the light kernel where velocity is concerned."""
    declared, load = rig.joint_sensors(channels.joint), rig.load[channels.joint]
    command = rig.command_column(channels.joint).rpartition("/")[2]
    torque_noise, effort_noise = 0.0, 0.0
    unknown = unknown_form(load) is not None
    tells_load = unknown or (isinstance(load, RobotLoad) and load.method != "estimate")
    servo = rig.drive[channels.joint] == "position_servo"
    if typical_hold(channels.raw(command), channels.segments) * channels.period > SLOWEST_TOPIC[servo]:
        effort_noise = 0.0  # beside its steps
    elif tells_load or not servo:
        effort_noise = _recorded_noise(channels, command)
    else:
        effort_noise = scatter(channels.raw(command), channels.segments)
    if declared.torque_noise is not None:
        memory = declared.torque_correlation_time or 0.0
        torque_noise = 0.0 if unknown else declared.torque_noise * _louder(channels, "torque", memory)
    elif not (unknown or isinstance(load, Pendulum)):
        torque_noise = _recorded_noise(channels, "torque")
    alone = channels.speed_only
    kernel = light.kernels[0 if alone else 1]
    return Resolution(
        position_step=0.0 if alone else step,
        position_noise=LEAST_NOISE if alone else noise,
        torque_noise=torque_noise,
        velocity_noise=noise * float(np.sqrt(np.sum(kernel**2))),
        torque_correlation_time=declared.torque_correlation_time or 0.0,
        torque_is_declared=declared.torque_noise is not None,
        effort_step=channels.step(command),
        effort_noise=effort_noise,
        effort_tells_load=tells_load,
        velocity_step=step if alone else 0.0,
        raw_velocity_noise=noise if alone else 0.0,
    )


def _louder(channels: Channels, name: str, memory: float) -> float:
    """Noise of a correlation time [s] that a slower clock samples over that which as loud samples of the log's have.

    At the low frequencies of the regression the density of samples every T is T coth(T/(2 memory)).
    """
    periods = channels.period * np.array([1.0, np.median(channels.ratios(name))])
    log, own = periods / np.tanh(periods / (2.0 * memory)) if memory > 0.0 else periods
    return float(np.sqrt(own / log))


def _recorded_noise(channels: Channels, name: str) -> float:
    """Standard deviation of one sample of `<joint>/name` as it was recorded."""
    return _noise(channels, name, channels.raw(name), channels.step(name))


def _noise(channels: Channels, name: str, values: FloatArray, step: float) -> float:
    """Standard deviation of one sample of `<joint>/name` (T,), as large as if the log's clock had sampled it."""
    ratios = channels.ratios(name)
    if max(ratios) > 1.0:
        return interpolated_noise(values, step, channels.segments, ratios)
    return sample_noise(values, step, channels.segments)


def white_noise(values: FloatArray, segments: Sequence[slice]) -> float:
    """Standard deviation of the white part of a channel (T,), from its third differences; 0 where not recorded."""
    return _white_noise([values[s] for s in segments])


def scatter(values: FloatArray, segments: Sequence[slice]) -> float:
    """RMS over time of a channel's (T,) white part, which may be larger in faster motion; 0 where not recorded.

    A goal that is held for h seconds, and sampled at instants that drift against those at which it is written, is up to
    h old: its samples scatter by up to h times its speed. They do not while it rests, so a median shows nothing. Of a
    goal that is held over several samples each value counts once: the servo follows the same stairs. The largest
    `STEPS` of the differences take no part: a goal may step.
    """
    held = typical_hold(values, segments)
    own = [values[s][run_lengths(values[s])[0]] if held > 1.0 else values[s] for s in segments]
    found = []
    for order in ORDERS:
        squares = np.sort(_differences(own, order) ** 2)
        found.append(float(np.sqrt(np.mean(squares[: max(1, round((1.0 - STEPS) * squares.size))]))))
    return float(np.sqrt(held)) * _without_lines(own, min(found))


def _white_noise(stretches: Sequence[FloatArray]) -> float:
    return _without_lines(stretches, 1.4826 * float(np.median(np.abs(_differences(stretches, ORDERS[0])))))


def _without_lines(stretches: Sequence[FloatArray], level: float) -> float:
    """Standard deviation of white noise: that of the differences, or of what is between lines that hold most of it."""
    between = between_lines(stretches)
    return between if between < MOSTLY_LINES * level else level


def _differences(stretches: Sequence[FloatArray], order: int) -> FloatArray:
    """(N,) differences of the recorded samples, as large as one sample of white noise; a zero if there are none."""
    found = np.concatenate([np.diff(x, order) for x in stretches if x.size > 8] or [np.zeros(0)])
    found = found[np.isfinite(found)]
    return np.asarray(found / np.sqrt(math.comb(2 * order, order))) if found.size else np.zeros(1)


def between_lines(stretches: Sequence[FloatArray]) -> float:
    """Standard deviation of white noise of the density that a channel (T,) has between spectral lines.

    sigma^2 is the median over frequencies, above an eighth of the sampling rate, of the power of the third differences
    over |2 sin(pi f)|^6, that of unit white noise. A controller that works in steps makes lines there, which the
    filters of the regression remove. Infinite where no stretch has `LINE_BLOCK` samples.
    """
    window = np.hanning(LINE_BLOCK)
    power = []
    for x in stretches:
        third = np.diff(x, 3)
        blocks = third[: third.size // LINE_BLOCK * LINE_BLOCK].reshape(-1, LINE_BLOCK)
        power += [np.abs(np.fft.rfft(b * window)) ** 2 for b in blocks if np.isfinite(b).all()]
    if not power:
        return float("inf")
    frequency = np.fft.rfftfreq(LINE_BLOCK)
    high = frequency > 0.125
    unit = np.sum(window**2) * (2.0 * np.sin(np.pi * frequency[high])) ** 6
    return float(np.sqrt(np.median(np.mean(power, axis=0)[high] / unit)))


def interpolated_noise(values: FloatArray, step: float, segments: Sequence[slice], ratios: Sequence[float]) -> float:
    """`sample_noise` of a channel (T,) that a slower clock sampled, and that is interpolated between its samples.

    Between the samples the channel is straight, so differences of neighbouring rows show none of its noise. Third
    differences over T_s do. White samples of deviation sigma every T_s have T_s/T times the density of white noise of
    this size on each row at the low frequencies of the regression: the result is sqrt(T_s/T) sigma. Values on a grid
    are spread as in `sample_noise`.

    Args:
        values: (T,) channel.
        step: Of its values; 0 where they lie on no grid.
        segments: Uniform stretches.
        ratios: Of each stretch, T_s over the period T of the log, which need not be whole; not all 1.
    """
    slower = [(values[s], r) for s, r in zip(segments, ratios, strict=True) if r > 1.0]
    ratio, least = float(np.median([r for _, r in slower])), step / float(np.sqrt(12.0))
    spread = [_spread(x, step, r) for x, r in slower]
    both = [_own_noise([(x + way * d, r) for (x, r), d in zip(slower, spread, strict=True)]) for way in (1.0, -1.0)]
    own = float(np.sqrt(max(0.5 * sum(each**2 for each in both) - least**2, 0.0)))
    return float(np.sqrt(ratio)) * max(least, own)


def _own_noise(slower: Sequence[tuple[FloatArray, float]]) -> float:
    """Standard deviation of the samples of a slower clock, of stretches (T,) and their T_s/T."""
    third = np.concatenate([_third_over(x, ratio) for x, ratio in slower])
    return float(np.median(np.abs(third))) / MEDIAN_BETWEEN_SAMPLES if third.size else 0.0


def _spread(values: FloatArray, step: float, ratio: float) -> FloatArray:
    """(T,) uniform within +-step/2 at the samples between which the values were interpolated; straight between them."""
    if not step > 0.0 or values.size < 8.0 * ratio:
        return np.zeros(values.size)
    at = np.arange(values.size, dtype=np.float64)
    begins = np.arange(0.0, ratio, 0.5)  # the samples are noisier than what lies between them
    rough = [
        np.mean(np.square(np.diff(np.interp(np.arange(b, values.size - 1.0, ratio), at, values), 3))) for b in begins
    ]
    own = np.arange(begins[int(np.argmax(rough))] - ratio, values.size + ratio, ratio)
    return np.asarray(np.interp(at, own, np.random.default_rng(0).uniform(-0.5 * step, 0.5 * step, own.size)))


def _third_over(values: FloatArray, samples: float) -> FloatArray:
    """Third differences of values (T,) over so many samples, which need not be whole."""
    at = np.arange(values.size, dtype=np.float64)
    begins = at[: max(values.size - int(np.ceil(3.0 * samples)), 0)]
    x = [np.interp(begins + k * samples, at, values) for k in range(4)]
    return np.asarray(x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0])


def typical_hold(values: FloatArray, segments: Sequence[slice]) -> float:
    """Median number of samples over which a channel (T,) stays exactly the same; 1 where there are none."""
    lengths = [run_lengths(values[s])[1] for s in segments]
    return float(np.median(np.concatenate(lengths))) if lengths else 1.0


def sample_noise(values: FloatArray, step: float, segments: Sequence[slice]) -> float:
    """Standard deviation of one sample of a channel (T,) whose values have a step: the larger of step/sqrt(12) and
    the white part.

    Differences of values that are multiples of the step are multiples of it too, and so is their median: noise of 0.2
    to 0.5 steps would be estimated a third too small or 15 % too large. Therefore a uniform random number within
    +-step/2 is added to each value, which makes the median continuous, and its known variance, step^2/12, is
    subtracted.

    A channel without a step whose values repeat is held between the messages of a slower topic. Its staircase is no
    noise, so each value counts once. Noise of values that are held over h samples has h times the density of white
    noise of this size at the low frequencies of the regression, so its standard deviation is taken sqrt(h) times.
    """
    least = step / float(np.sqrt(12.0))
    if not step > 0.0:
        held = typical_hold(values, segments)
        if held > 1.0:
            own = [values[s][run_lengths(values[s])[0]] for s in segments]
            return max(least, float(np.sqrt(held)) * _white_noise(own))
        return max(least, white_noise(values, segments))
    spread = np.random.default_rng(0).uniform(-0.5 * step, 0.5 * step, values.shape)
    both = [white_noise(values + way * spread, segments) ** 2 for way in (1.0, -1.0)]  # alike for either direction
    return max(least, float(np.sqrt(max(0.5 * sum(both) - least**2, 0.0))))
