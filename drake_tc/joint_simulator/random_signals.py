"""Random signals that are closed forms of time: the same value at the same instant whatever the sampling."""

from dataclasses import dataclass

import numpy as np

from drake_tc.types import FloatArray

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
