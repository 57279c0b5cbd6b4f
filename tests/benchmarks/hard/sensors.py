"""How a signal becomes a column of a log: age, averaging, own rate, jitter, gain, zero, noise, wander, steps.

    column[k] = g s(t_j - age, averaged over `average`) + b + noise + wander, rounded to steps,

where j is the last update of the channel before row k, and the instants are late or early by the channel's jitter.
"""

from dataclasses import dataclass

import numba
import numpy as np

from tests.benchmarks.hard.physics import Array

Generator = np.random.Generator


@dataclass(frozen=True)
class Channel:
    """One recorded channel.

    Attributes:
        age: Time by which the sample is older than its stamp [s].
        average: Length of the average that a sample is [s]; 0 is an instant.
        every: The channel is updated once in so many rows and held in between.
        jitter: Standard deviation of the instant about the stamp [s].
        gain: Relative error of the scale.
        zero: Error of the zero.
        noise: Standard deviation of white noise.
        wander: Standard deviation of slow noise.
        wander_time: Its correlation time [s].
        step: Quantisation step; 0 for none.
    """

    age: float = 0.0
    average: float = 0.0
    every: int = 1
    jitter: float = 0.0
    gain: float = 0.0
    zero: float = 0.0
    noise: float = 0.0
    wander: float = 0.0
    wander_time: float = 1.0
    step: float = 0.0


def stamps(rate: float, duration: float, jitter: float, rng: Generator) -> Array:
    """Times of the rows [s] (rows,), with `jitter` as a standard deviation in periods."""
    first = 2.5 / rate + 0.02
    time = np.arange(first, duration - 1.0 / rate, 1.0 / rate)
    return time + np.clip(jitter * rng.standard_normal(time.size), -0.4, 0.4) / rate


def record(channel: Channel, time: Array, trace_time: Array, signal: Array, rng: Generator) -> tuple[Array, Array]:
    """Column (rows,), and what it would be without errors: only age, average and rate. Jitter is an error."""
    row = (np.arange(time.size) // channel.every) * channel.every
    clean = read = _sampled(channel, time - channel.age, trace_time, signal)
    late = channel.jitter * rng.standard_normal(time.size)
    if channel.jitter > 0.0:
        read = _sampled(channel, time - channel.age + late, trace_time, signal)
    noise = channel.noise * rng.standard_normal(time.size)
    noise += channel.wander * _wander(time, channel.wander_time, rng)
    column = (1.0 + channel.gain) * read + channel.zero + noise
    if channel.step > 0.0:
        column = channel.step * np.round(column / channel.step)
    return column[row], clean[row]


def _sampled(channel: Channel, instant: Array, trace_time: Array, signal: Array) -> Array:
    """The signal at the instants, or its mean over the time before them."""
    if channel.average <= 0.0:
        return np.interp(instant, trace_time, signal)
    step = trace_time[1] - trace_time[0]
    total = np.concatenate([[0.0], np.cumsum(0.5 * step * (signal[1:] + signal[:-1]))])
    rise = np.interp(instant, trace_time, total) - np.interp(instant - channel.average, trace_time, total)
    start = np.clip(instant - channel.average, trace_time[0], None)
    return rise / np.maximum(np.clip(instant, trace_time[0], None) - start, step)


def _wander(time: Array, seconds: float, rng: Generator) -> Array:
    """Slow noise of standard deviation 1: a first-order Gauss-Markov process."""
    keep = np.exp(-np.diff(time, prepend=time[0] - seconds) / seconds)
    return _recursion(keep, np.sqrt(1.0 - keep**2) * rng.standard_normal(time.size), float(rng.standard_normal()))


@numba.njit(cache=True)
def _recursion(keep: Array, drive: Array, value: float) -> Array:
    out = np.empty(keep.size)
    for k in range(keep.size):
        value = keep[k] * value + drive[k]
        out[k] = value
    return out


def encoder_error(q: Array, offset: float, sine: float, cosine: float) -> Array:
    """What an encoder reads beyond the true angle [rad]."""
    return offset + sine * np.sin(q) + cosine * np.cos(q)
