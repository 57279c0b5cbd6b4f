"""The step of recorded values: that of the grid they were rounded to, in any unit, and none without a grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.logs.channels import grid_step

TIME = np.arange(0.0, 8.0, 1e-3)
SWING = 0.5 * np.sin(2.0 * np.pi * 0.4 * TIME) + 0.1 * np.sin(2.0 * np.pi * 1.7 * TIME)


@settings(max_examples=60)
@given(
    st.integers(8, 16), st.floats(1e-3, 1e3), st.sampled_from([-1.0, 1.0]), st.floats(-10.0, 10.0), st.integers(0, 9)
)
def test_an_encoder_of_any_resolution_unit_sign_and_zero(bits, unit, sign, zero, seed):
    step = 2.0 * np.pi / 2**bits
    noisy = SWING + 0.3 * step * np.random.default_rng(seed).standard_normal(SWING.size)
    values = sign * unit * (np.round(noisy / step) * step + zero)
    assert_allclose(grid_step(values), unit * step, rtol=0.02)  # of a step, as the rule has it


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 300.0])
def test_noise_and_smooth_signals_have_no_step(seed, precision, unit):
    """Neither the smallest of thousands of differences nor the rounding of the number format is one."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(5000)
    for values in (noise, SWING[: noise.size] + 1e-3 * noise, SWING):
        assert grid_step((unit * values).astype(precision).astype(float)) == 0.0


@pytest.mark.parametrize("bits", [12, 16])
@pytest.mark.parametrize("gain", [1e-3, 1.0, 57.3])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_the_step_of_a_converter_is_found_to_four_digits_in_either_precision(bits, gain, precision):
    step = 2.0 * np.pi / 2**bits
    slow = np.round(SWING / step) * step
    fast = np.round(40.0 * SWING / step) * step  # differences of up to a hundred steps
    for values in (slow, fast):
        assert_allclose(grid_step((gain * values).astype(precision).astype(float)), gain * step, rtol=1e-4)


@pytest.mark.parametrize("step", [1e-6, 2.0 * np.pi / 2**12])
def test_values_written_with_six_decimals(step):
    """Decimals are a step like any other where the signal is slow; they do not hide one that is coarser."""
    written = np.round(np.round(SWING / step) * step, 6)
    assert_allclose(grid_step(written), step, rtol=1e-3)
    assert grid_step(np.round(np.random.default_rng(0).standard_normal(5000), 6)) == 0.0


@pytest.mark.parametrize("levels", [(-6.0, 6.0), (0.0, 1.0, 2.0, 3.0), (-2.0, 0.0, 2.0)])
def test_a_command_of_a_few_levels_is_not_rounded_to_them(levels):
    """A pseudo-random binary or a staircase command is exact: half of its swing is no rounding error."""
    dwell = np.random.default_rng(1).integers(0, len(levels), 80)
    assert grid_step(np.repeat(np.array(levels)[dwell], 50)) == 0.0


def test_interpolation_hides_the_step_and_leaves_none_that_is_wrong():
    step = 2.0 * np.pi / 4096
    rounded = np.round(SWING / step) * step
    jitter = TIME + 2e-4 * np.random.default_rng(0).uniform(-1.0, 1.0, TIME.size)
    assert grid_step(np.interp(TIME, jitter, rounded)) < 0.5 * step


def test_missing_values_and_constant_channels():
    step = 0.01
    rounded = np.round(SWING / step) * step
    rounded[::7] = np.nan
    assert_allclose(grid_step(rounded), step, rtol=1e-6)
    assert grid_step(np.full(100, 3.0)) == 0.0
    assert grid_step(np.full(100, np.nan)) == 0.0
    assert grid_step(np.array([])) == 0.0


def test_nine_differences_in_ten_must_be_multiples():
    steps = np.where(np.arange(1000) % 3 == 0, 2.0, 1.0)
    for share, found in ((0.05, 1.0), (0.15, 0.0)):
        odd = np.arange(1000) % round(1.0 / share) == 0
        assert_allclose(grid_step(np.cumsum(np.where(odd, 1.5, steps))), found, rtol=1e-9)
