"""A torque on a slower clock: the noise of its samples, and what it lacks beside jumps."""

import numpy as np
import pytest

from drake_tc.diagnosis.data.clocks import between_samples
from drake_tc.diagnosis.data.sensors import interpolated_noise
from drake_tc.filtering.common_kernel import CommonKernel

from .test_slower_channel import PERIOD, TOPIC

RATIO = TOPIC / PERIOD


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_variance_beside_jumps_is_that_of_the_interpolation(noise: float) -> None:
    """Against the error itself: jumps at random instants on a smooth load, which decay in 0.1 s."""
    rng = np.random.default_rng(3)
    time = np.arange(round(400.0 / PERIOD)) * PERIOD
    begins, sizes = np.sort(rng.uniform(1.0, 399.0, 300)), rng.uniform(5.0, 15.0, 300)

    def load(at: np.ndarray) -> np.ndarray:
        since = at[:, None] - begins
        pulses = sizes * np.exp(-np.maximum(since, 0.0) / 0.1) * (since >= 0.0)
        return np.asarray(2.0 * np.sin(2.0 * at) + pulses.sum(axis=1))

    at = np.arange(0.0, 401.0, TOPIC)
    sampled = load(at)
    kernel = CommonKernel(4.0 * TOPIC, PERIOD).kernels[0]
    weights = np.convolve(kernel, kernel)
    error = np.convolve(np.interp(time, at, sampled) - load(time), weights, mode="same")[200:-200]
    recorded = np.interp(time, at, sampled + noise * rng.standard_normal(at.size))
    variance = between_samples(recorded, [slice(0, time.size)], [RATIO], weights)[200:-200]
    assert np.sqrt(np.mean(variance)) == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.2)  # 300 instants: some 6 %
    quiet = variance < 1e-6 * variance.max()
    assert np.sqrt(np.mean(error[quiet] ** 2)) < 0.1 * np.sqrt(np.mean(error**2))


def test_a_smooth_torque_has_no_jumps() -> None:
    time = np.arange(6000) * PERIOD
    at = np.arange(0.0, 31.0, TOPIC)
    noise = 0.05 * np.random.default_rng(4).standard_normal(at.size)
    torque = np.interp(time, at, 3.0 * np.sin(4.0 * at) + noise)
    weights = CommonKernel(4.0 * TOPIC, PERIOD).kernels[0]
    assert not between_samples(torque, [slice(0, 6000)], [RATIO], weights).any()
    assert not between_samples(torque, [slice(0, 6000)], [1.0], weights).any()


@pytest.mark.parametrize("ratio", [1.5, 2.0, 10.0 / 3.0, 5.0])
def test_noise_of_samples_is_read_through_the_interpolation(ratio: float) -> None:
    """The filtered channel has the variance that white noise of the estimate on each row would have."""
    at = np.arange(40000) * PERIOD
    own = np.arange(0.0, at[-1] + 1.0, ratio * PERIOD)
    noise = 0.2 * np.random.default_rng(5).standard_normal(own.size)
    whole = [slice(0, at.size)]
    found = interpolated_noise(np.interp(at, own, np.sin(2.0 * own) + noise), 0.0, whole, [ratio])
    assert found == pytest.approx(np.sqrt(ratio) * 0.2, rel=0.08)  # 1.5: 5 % of the places between samples are uneven
    weights = CommonKernel(20.0 * ratio * PERIOD, PERIOD).kernels[0]
    passed = np.convolve(np.interp(at, own, noise), weights, mode="valid")
    assert np.std(passed) == pytest.approx(np.sqrt(ratio) * 0.2 * np.sqrt(weights @ weights), rel=0.08)
