"""Noise of a channel that a slower clock sampled and that is interpolated between its samples."""

import numpy as np
import pytest

from drake_tc.diagnosis.data.sensors import interpolated_noise, sample_noise
from drake_tc.filtering.common_kernel import CommonKernel

PERIOD, SIGMA, COUNT = 4e-3, 0.03, 60_000


def interpolated(spacing: float, step: float, seed: int) -> np.ndarray:
    """(T,) of a slow wave with white noise and steps, sampled every `spacing` samples of the log."""
    rng = np.random.default_rng(seed)
    rows = np.arange(COUNT) - 0.0
    own = np.arange(int(COUNT / spacing) + 2) * spacing
    noisy = 2.0 * np.sin(2.0 * np.pi * 0.2 * PERIOD * own) + SIGMA * rng.standard_normal(own.size)
    noisy = np.round(noisy / step) * step if step else noisy
    return np.asarray(np.interp(rows, own, noisy))


@pytest.mark.parametrize("step", [0.0, 0.001, 0.05])
@pytest.mark.parametrize("spacing", [2.0, 3.0, 10.0 / 3.0])
def test_the_noise_behind_a_wide_filter_is_that_which_the_filter_leaves(spacing, step):
    """The filter itself is the judge: what it leaves of the channel without the wave is sigma |k| of white noise."""
    values = interpolated(spacing, step, seed=1)
    half = COUNT // 2 + 1  # of another phase of the slower clock
    found = interpolated_noise(values, step, [slice(0, half), slice(half, COUNT)], [spacing, spacing])
    kernel = CommonKernel(8.0 * spacing * PERIOD, PERIOD)
    wave = 2.0 * np.sin(2.0 * np.pi * 0.2 * PERIOD * np.arange(COUNT))
    passed = kernel.smooth(values - wave)[kernel.margin : -kernel.margin]
    assert found * np.sqrt(np.sum(kernel.kernels[0] ** 2)) == pytest.approx(np.std(passed), rel=0.12)


def test_the_differences_of_an_interpolated_channel_alone_show_too_little():
    values = interpolated(2.0, 0.0, seed=3)
    assert sample_noise(values, 0.0, [slice(None)]) < 0.6 * interpolated_noise(values, 0.0, [slice(None)], [2.0])


@pytest.mark.parametrize("spacing", [2.0, 3.0, 10.0 / 3.0, 5.0])
@pytest.mark.parametrize("noise", [0.2, 0.4, 0.7])
def test_steps_as_large_as_the_noise_do_not_hide_it(spacing, noise):
    """Differences of rounded samples are few different values, and so is their median."""
    own = np.arange(int(COUNT / spacing) + 2) * spacing
    true = 60.0 * np.sin(2.0 * np.pi * 0.2 * PERIOD * own)
    read = np.round(true + noise * np.random.default_rng(4).standard_normal(own.size))
    found = interpolated_noise(np.interp(np.arange(COUNT), own, read), 1.0, [slice(None)], [spacing])
    assert found == pytest.approx(np.sqrt(spacing) * np.std(read - true), rel=0.15)


def test_a_stretch_too_short_for_differences_has_the_noise_of_its_steps():
    found = interpolated_noise(np.array([0.0, 0.05, 0.1, 0.05]), 0.1, [slice(None)], [2.0])
    assert found == pytest.approx(np.sqrt(2.0) * 0.1 / np.sqrt(12.0))
