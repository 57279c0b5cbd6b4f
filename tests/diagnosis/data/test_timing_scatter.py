"""Scatter of the sampling instants: found in simulated positions, and not where something else grows with the speed."""

import numpy as np
import pytest

from drake_tc.diagnosis.data.clocks import command_scatter, timing_moments, timing_scatter
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import FloatArray

SECONDS = 60.0


def motion(time: FloatArray, fast: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Position [rad] and velocity [rad/s]: three incommensurable sines."""
    parts = [(fast / (k + 1), 2.0 * np.pi * f, p) for k, (f, p) in enumerate(((0.2, 0.3), (0.55, 1.9), (1.3, 4.0)))]
    position = np.sum([a * np.sin(w * time + p) for a, w, p in parts], axis=0)
    return position, np.sum([a * w * np.cos(w * time + p) for a, w, p in parts], axis=0)


def clock(rate: float) -> FloatArray:
    return np.arange(round(SECONDS * rate)) / rate


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("rate", "scatter", "noise"), [(500.0, 2e-5, 2e-6), (500.0, 2e-5, 2e-5), (250.0, 1e-4, 1e-5), (1000.0, 1e-5, 2e-6)]
)
def test_scatter_is_found_whatever_the_encoder_adds(rate, scatter, noise, seed):
    rng, time = np.random.default_rng(seed), clock(rate)
    position = motion(time + scatter * rng.normal(size=time.size))[0] + noise * rng.normal(size=time.size)
    found = timing_scatter(position, [slice(0, time.size)], 1.0 / rate, 0.0)
    assert found is not None
    # some 1000 blocks of four independent frequencies: 2 % of delta; large powers are clipped: 0.5 %
    assert found.time == pytest.approx(scatter, rel=0.05)
    assert found.noise < 2.0 * noise
    speeds = motion(time)[1]
    assert found.speed == pytest.approx(np.sqrt(np.mean(speeds**2)), rel=0.02)
    assert found.fastest == pytest.approx(np.abs(speeds).max(), rel=0.05)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rate", [100.0, 500.0, 1000.0])
@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
def test_white_noise_of_an_encoder_shows_no_scatter(rate, noise, seed):
    rng, time = np.random.default_rng(seed), clock(rate)
    position = motion(time)[0] + noise * rng.normal(size=time.size)
    assert timing_scatter(position, [slice(0, time.size)], 1.0 / rate, 0.0) is None


@pytest.mark.parametrize("bits", [10, 12, 14, 16, 19])
@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_rounding_shows_no_scatter_although_it_grows_with_slow_speeds(bits, rate):
    time, step = clock(rate), 2.0 * np.pi / 2**bits
    position = np.round(motion(time)[0] / step) * step
    assert timing_scatter(position, [slice(0, time.size)], 1.0 / rate, step) is None


def test_rounded_positions_show_scatter_that_exceeds_their_steps():
    rng, time, step = np.random.default_rng(3), clock(500.0), 2.0 * np.pi / 2**17
    position = np.round(motion(time + 1e-4 * rng.normal(size=time.size))[0] / step) * step
    found = timing_scatter(position, [slice(0, time.size)], 2e-3, step)
    assert found is not None
    assert found.time == pytest.approx(1e-4, rel=0.05)
    assert found.noise >= step / np.sqrt(12.0)


@pytest.mark.parametrize("frequency", [60.0, 100.0, 130.0])
def test_a_vibration_that_grows_with_the_speed_is_no_scatter(frequency):
    """A controller's steps or a gear leave a line; white noise beside it does not grow."""
    rng, time = np.random.default_rng(0), clock(500.0)
    position, velocity = motion(time)
    position = position + 2e-5 * velocity * np.sin(2.0 * np.pi * frequency * time) + 2e-6 * rng.normal(size=time.size)
    assert timing_scatter(position, [slice(0, time.size)], 2e-3, 0.0) is None


def test_noise_that_grows_with_the_square_of_the_speed_is_no_scatter():
    rng, time = np.random.default_rng(0), clock(500.0)
    position, velocity = motion(time)
    position = position + 1e-6 * (1.0 + velocity**2) * rng.normal(size=time.size)
    assert timing_scatter(position, [slice(0, time.size)], 2e-3, 0.0) is None


def test_a_short_log_or_one_at_rest_shows_none():
    rng = np.random.default_rng(0)
    time = clock(500.0)[:600]
    assert timing_scatter(motion(time + 1e-4 * rng.normal(size=600))[0], [slice(0, 600)], 2e-3, 0.0) is None
    rest = 1e-5 * rng.normal(size=30000)
    assert timing_scatter(rest, [slice(0, 30000)], 2e-3, 0.0) is None
    assert timing_scatter(np.zeros(30000), [slice(0, 30000)], 2e-3, 0.0) is None


def test_moments_are_those_of_many_simulated_scatters():
    """Two parts that share the scatter: an acceleration by k'' and a velocity by k', at rows of different speed."""
    period, scatter = 2e-3, 5e-5
    time = np.arange(1500) * period
    kernel, rows = CommonKernel(0.04, period), np.array([200, 500, 700, 1100])
    velocity = motion(time)[1]
    parts = ((velocity, kernel.kernels[2]), (velocity, kernel.kernels[1]))
    rng, samples = np.random.default_rng(1), []
    for _ in range(4000):
        error = scatter * rng.normal(size=time.size) * velocity
        samples.append([np.convolve(error, w, mode="same")[rows] for _, w in parts])
    made = np.einsum("sai,sbi->iab", np.array(samples), np.array(samples)) / 4000.0
    found = timing_moments(scatter, parts, rows)
    scale = np.sqrt(np.einsum("iaa->ia", found))
    # standard error of a second moment of 4000 normal values: 1.6 to 2.2 % of the product of the deviations
    np.testing.assert_allclose(
        made / (scale[:, :, None] * scale[:, None, :]), found / (scale[:, :, None] * scale[:, None, :]), atol=0.08
    )


def test_moments_at_constant_speed_are_those_of_white_noise():
    period, scatter, speed = 1e-3, 2e-5, 3.0
    wide, narrow = CommonKernel(0.05, period).kernels[2], CommonKernel(0.03, period).kernels[1]
    constant = np.full(2000, speed)
    found = timing_moments(scatter, ((constant, wide), (0.5 * constant, narrow)), np.array([1000]))[0]
    padded = np.pad(narrow, (wide.size - narrow.size) // 2)
    expected = (scatter * speed) ** 2 * np.array(
        [[wide @ wide, 0.5 * wide @ padded], [0.5 * wide @ padded, 0.25 * narrow @ narrow]]
    )
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * expected[0, 0])


HOLD = 2e-3
"""Time [s] for which a command is held."""


def _read(time: np.ndarray, hold: float) -> np.ndarray:
    """A command that is held, at these instants."""
    return np.asarray(motion(hold * np.floor(time / hold))[0])


def test_a_command_that_is_held_is_read_with_an_age_that_is_uniform_over_the_hold() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(6000) * 4e-3
    assert command_scatter(
        motion(time - HOLD * rng.random(time.size))[0], [slice(0, time.size)], 4e-3
    ) == pytest.approx(HOLD / np.sqrt(12.0), rel=0.1)


@pytest.mark.parametrize("period", [1e-3, 2e-3, 4e-3, 5e-3])
def test_the_regular_pattern_of_two_clocks_is_no_scatter(period: float) -> None:
    """Its frequencies are those at which the clocks beat."""
    time = np.arange(12000) * period + 0.3e-3
    assert command_scatter(_read(time, HOLD), [slice(0, time.size)], period) < 0.02 * HOLD


def test_a_command_that_jumps_and_rests_is_read_at_instants_that_the_log_shows() -> None:
    jumps = np.repeat(np.random.default_rng(5).uniform(-1.0, 1.0, 40), 250)
    assert command_scatter(jumps, [slice(0, jumps.size)], 2e-3) == 0.0
    slow = np.repeat(motion(np.arange(1200) * 20e-3)[0], 10)  # held for ten samples of 2 ms
    assert command_scatter(slow, [slice(0, slow.size)], 2e-3) == 0.0


def test_rests_between_which_a_command_follows_a_curve_hide_no_scatter() -> None:
    rng = np.random.default_rng(4)
    time = np.arange(6000) * 4e-3
    read = motion(time - HOLD * rng.random(time.size))[0]
    resting = np.concatenate([np.full(400, read[0]), read, np.full(400, read[-1])])
    assert command_scatter(resting, [slice(0, resting.size)], 4e-3) == pytest.approx(HOLD / np.sqrt(12.0), rel=0.1)
