"""The three motions of a rig: held postures with loads by hand, a growing sinusoid, and a faster multisine.

Random signals that are closed forms of time: the same value at the same instant whatever the sampling.
"""

from dataclasses import dataclass

import numpy as np

from drake_tc.joint_simulator.spec import RUNS, BlindError, RigSpec
from drake_tc.types import FloatArray

LOG_PERIOD = 1e-3


@dataclass(frozen=True)
class Motion:
    """What the joint is asked to do, sampled at `LOG_PERIOD`.

    Attributes:
        position, velocity: Reference [rad], [rad/s], (T,).
        load: Torque of the hand on the link, against the motor [N m], (T,).
    """

    position: FloatArray
    velocity: FloatArray
    load: FloatArray


def run_generator(spec: RigSpec, run: str, stream: int = 0) -> np.random.Generator:
    """The generator of one run of one rig; `stream` keeps motion and sensors apart."""
    if run not in RUNS:
        raise BlindError(f"no run {run!r}; runs are {', '.join(RUNS)}")
    return np.random.default_rng([spec.seed, RUNS.index(run), stream])


def make_motion(spec: RigSpec, run: str) -> Motion:
    """The motion of `run`; a rig without torque sensor is never touched, its hand load is zero."""
    rng = run_generator(spec, run)
    time: FloatArray = np.asarray(np.arange(round(spec.duration / LOG_PERIOD) + 1) * LOG_PERIOD, dtype=np.float64)
    if run == "static":
        position, load = _postures(time, rng, spec.pace), _smooth_random(time, rng, rng.uniform(30.0, 50.0), 0.6)
    elif run == "sine":
        position, load = _growing_sine(time, rng, spec.pace * spec.sine_pace), np.zeros_like(time)
    else:
        position, load = _multisine(time, rng, spec.pace), _smooth_random(time, rng, rng.uniform(8.0, 20.0), 0.5)
    if spec.pendulum is not None:
        load = np.zeros_like(time)
    velocity = np.asarray(np.gradient(position, LOG_PERIOD), dtype=np.float64)
    return Motion(position, velocity, spec.hand * load * _ramp(time, 1.0))


def _ramp(time: FloatArray, length: float) -> FloatArray:
    """A quintic rise from 0 to 1 over `length` seconds: x^3 (10 - 15 x + 6 x^2)."""
    x = np.clip(time / length, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x * x))


def _postures(time: FloatArray, rng: np.random.Generator, pace: float) -> FloatArray:
    position = np.zeros_like(time)
    last = 0.0
    for start in np.arange(0.0, time[-1], 5.0):
        goal = float(rng.uniform(-0.75, 0.75))
        while abs(goal - last) < 0.15:
            goal = float(rng.uniform(-0.75, 0.75))
        position += (goal - last) * _ramp(time - start, rng.uniform(0.9, 1.6) / pace)
        last = goal
    return position


def _growing_sine(time: FloatArray, rng: np.random.Generator, pace: float) -> FloatArray:
    first, last = rng.uniform(0.02, 0.08), rng.uniform(0.65, 0.8)
    amplitude = first + (last - first) * time / time[-1]
    return np.asarray(amplitude * np.sin(2 * np.pi * pace * rng.uniform(0.28, 0.48) * time) * _ramp(time, 1.0))


def _multisine(time: FloatArray, rng: np.random.Generator, pace: float) -> FloatArray:
    count = int(rng.integers(5, 9))
    frequency = rng.uniform(0.35, 1.25, count)
    raw = _sines(time, rng, pace * frequency, frequency**-0.3)
    return np.asarray(raw * (rng.uniform(0.7, 0.8) / np.max(np.abs(raw))) * _ramp(time, 1.5))


def _smooth_random(time: FloatArray, rng: np.random.Generator, peak: float, highest_hz: float) -> FloatArray:
    raw = _sines(time, rng, rng.uniform(0.05, highest_hz, 8), np.ones(8))
    return np.asarray(raw * (peak / np.max(np.abs(raw))))


def _sines(time: FloatArray, rng: np.random.Generator, frequency_hz: FloatArray, amplitude: FloatArray) -> FloatArray:
    phase = rng.uniform(0.0, 2 * np.pi, frequency_hz.size)
    return np.asarray(np.sin(2 * np.pi * np.outer(time, frequency_hz) + phase) @ amplitude)


TONES = 120
"""Sinusoids of a band; over 30 s and 4 Hz about one for each line that a spectrum resolves."""
WALK_TERMS = 300
"""Terms of a random walk's series: over 30 s it is resolved down to about 0.2 s."""


@dataclass(frozen=True)
class BandNoise:
    """n(t) = sqrt(2/M) sum_i sin(2 pi f_i t + p_i), f_i and p_i uniform: RMS 1, nearly Gaussian (M = 120).

    Attributes:
        frequency_hz: (m, M), m signals.
        phase: (m, M) [rad].
    """

    frequency_hz: FloatArray
    phase: FloatArray

    @classmethod
    def draw(cls, seeds: list[list[int]], low_hz: float, high_hz: float) -> "BandNoise":
        """One independent signal for each seed, in the band from `low_hz` to `high_hz`."""
        generators = [np.random.default_rng(seed) for seed in seeds]
        frequency = np.stack([rng.uniform(low_hz, high_hz, TONES) for rng in generators])
        return cls(frequency, np.stack([rng.uniform(0.0, 2 * np.pi, TONES) for rng in generators]))

    def at(self, time: float) -> FloatArray:
        """(m,) at one instant [s]."""
        return np.asarray(np.sqrt(2.0 / TONES) * np.sin(2 * np.pi * self.frequency_hz * time + self.phase).sum(axis=1))

    def over(self, time: FloatArray) -> FloatArray:
        """(T,) values of the first signal at the instants `time` [s]."""
        angle = 2 * np.pi * np.outer(time, self.frequency_hz[0]) + self.phase[0]
        return np.asarray(np.sqrt(2.0 / TONES) * np.sin(angle).sum(axis=1))


def random_walk(time: FloatArray, horizon: float, seed: list[int]) -> FloatArray:
    """Brownian motion W(t) on [0, horizon] with W(0) = 0 and variance t, by its Karhunen-Loeve series.

    W(t) = sqrt(2 T) sum_k z_k sin((k - 1/2) pi t/T)/((k - 1/2) pi), z_k standard normal, k = 1 ... 300.

    Args:
        time: (T,) [s].
        horizon: T of the series [s].
        seed: Of the z_k.

    Returns:
        (T,) [s^0.5].
    """
    weights = np.random.default_rng(seed).standard_normal(WALK_TERMS)
    rate = (np.arange(WALK_TERMS) + 0.5) * np.pi
    return np.asarray(np.sqrt(2.0 * horizon) * (np.sin(np.outer(time / horizon, rate)) @ (weights / rate)))


def random_instants(seed: list[int], count: int, spacing: float) -> FloatArray:
    """(count,) instants [s]: one in each interval of `spacing`, uniform within its middle 70 %."""
    rng = np.random.default_rng(seed)
    return np.asarray((np.arange(count) + rng.uniform(0.15, 0.85, count)) * spacing)
