"""Correlated torque noise: its level follows from kernel and autocorrelation, and a cause does not pass for noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.data.noise_colour import (
    CorrelatedNoise,
    correlated_noise,
    left_by_effort_noise,
    spectral_density,
)
from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect

from ..rigs import Joint, Motion, record, rig_of

JOINT = Joint(duration=40.0)
TERMS = (Term(effect("viscous")), Term(effect("coulomb")))


def ar1(size: int, sigma: float, memory: float, period: float, seed: int) -> np.ndarray:
    """Stationary noise (T,) of standard deviation `sigma` and correlation time `memory` [s]."""
    rho = np.exp(-period / memory)
    white = np.random.default_rng(seed).standard_normal(size + 5000)
    return sigma * np.sqrt(1.0 - rho**2) * lfilter([1.0], [1.0, -rho], white)[5000:]


def left_by(joint: Joint) -> tuple[Samples, np.ndarray]:
    """Rows and what the declared model leaves in them [N m]."""
    samples = build_samples([record(joint, "one"), record(joint, "two", 0.9, 1)], rig_of(joint), "joint")
    columns = Columns(samples)
    fitted = fit(columns, TERMS)
    return samples, columns.target - columns.design(TERMS) @ fitted.beta


def sensor(sigma: float, memory: float, seed: int):
    """Noise of a torque sensor, other in each run."""

    def noise(m: Motion) -> np.ndarray:
        own = seed * 1000 + int(1e6 * abs(m.q[0])) % 997
        return ar1(m.q.size, sigma, memory, float(m.time[1]), own)

    return noise


def exact(samples: Samples, sigma: float, memory: float) -> float:
    """sqrt(k' R k), R_ij = sigma^2 exp(-|i - j| dt/T), k the impulse response of both filters."""
    k = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0])
    lag = np.subtract.outer(np.arange(k.size), np.arange(k.size)) * samples.signals.period
    return float(np.sqrt(k @ (sigma**2 * np.exp(-np.abs(lag) / memory)) @ k))


@pytest.mark.parametrize("memory", [0.01, 0.02, 0.04])
def test_the_floor_of_ar1_noise_is_that_of_kernel_and_autocorrelation(memory):
    levels = []
    for seed in range(4):
        samples, left = left_by(replace(JOINT, sensor=sensor(0.3, memory, seed)))
        (found,) = correlated_noise([(samples, left)])
        assert found is not None
        assert found.is_noise
        assert 0.4 < found.correlation_time / memory < 2.5
        levels.append(found.rms / exact(samples, 0.3, memory))
    assert_allclose(levels, 1.0, atol=0.15)


def test_white_noise_keeps_its_own_level():
    samples, left = left_by(replace(JOINT, torque_noise=0.3))
    (found,) = correlated_noise([(samples, left)])
    assert found is not None
    k = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0])
    assert found.is_noise
    assert_allclose(found.rms, 0.3 * np.sqrt(k @ k), rtol=0.15)


def test_a_cause_below_5_hz_does_not_raise_its_own_floor():
    noisy = replace(JOINT, sensor=sensor(0.3, 0.02, 0))
    samples, quiet = left_by(noisy)
    _, loud = left_by(replace(noisy, extra=lambda m: 2.0 * np.sin(2.0 * np.pi * 0.6 * m.time)))
    found = [correlated_noise([(samples, each)])[0] for each in (quiet, loud)]
    assert found[0] is not None
    assert found[1] is not None
    assert np.std(loud) > 3.0 * np.std(quiet)
    assert found[1].rms < 1.15 * found[0].rms


def test_a_disturbance_that_the_torque_channel_does_not_hold_is_not_its_noise():
    """A torque that acts behind the sensor, as broad as noise: it cannot be more than the channel holds."""
    samples, left = left_by(replace(JOINT, extra=sensor(0.6, 0.02, 0), torque_noise=0.02))
    (found,) = correlated_noise([(samples, left)])
    assert found is not None
    assert found.rms < 0.2 * np.std(left)


def test_noise_that_comes_and_goes_is_not_noise_of_a_sensor():
    def gusts(m: Motion) -> np.ndarray:
        return sensor(0.3, 0.02, 0)(m) * np.where((m.time % 10.0) < 1.2, 8.0, 1.0)

    samples, left = left_by(replace(JOINT, sensor=gusts))
    (found,) = correlated_noise([(samples, left)])
    assert found is not None
    assert not found.is_noise


@pytest.mark.parametrize(("misfit", "unevenness", "noise"), [(0.3, 2.5, True), (0.301, 2.5, False), (0.3, 2.51, False)])
def test_what_passes_for_noise_at_the_thresholds(misfit, unevenness, noise):
    assert CorrelatedNoise(1.0, 0.02, misfit, unevenness).is_noise is noise


def test_both_splits_tell_one_form_and_each_its_own_level():
    """A sensor that is twice as noisy in the second log."""
    pairs = [left_by(replace(JOINT, sensor=sensor(sigma, 0.02, seed))) for sigma, seed in ((0.3, 5), (0.6, 6))]
    found = correlated_noise(pairs)
    for sigma, (samples, _), each in zip((0.3, 0.6), pairs, found, strict=True):
        assert each is not None
        assert each.is_noise
        assert_allclose(each.rms, exact(samples, sigma, 0.02), rtol=0.15)


def test_a_log_with_noise_of_another_form_makes_both_doubtful():
    """Noise of 30 ms in one log, and of a band around 20 Hz in the other: one sensor does not have both."""

    def resonance(m: Motion) -> np.ndarray:
        period = float(m.time[1])
        pole = np.exp((-4.0 + 2j * np.pi * 20.0) * period)
        white = np.random.default_rng(9).standard_normal(m.q.size)
        return 0.05 * lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], white)

    pairs = [left_by(replace(JOINT, sensor=each)) for each in (sensor(0.3, 0.03, 7), resonance)]
    first, second = correlated_noise(pairs)
    assert first is not None
    assert second is not None
    assert correlated_noise(pairs[:1])[0].is_noise
    assert not first.is_noise
    assert not second.is_noise


def test_a_band_that_ends_below_8_hz_says_nothing():
    samples = build_samples([record(JOINT)], rig_of(JOINT), "joint", width_s=0.3)
    assert correlated_noise([(samples, np.random.default_rng(0).standard_normal(samples.rows.size))]) == [None]


def test_the_spectral_density_integrates_to_the_variance():
    samples, _ = left_by(JOINT)
    values = np.random.default_rng(1).standard_normal(samples.rows.size)
    frequency, density = spectral_density(samples, values)
    assert_allclose(np.trapezoid(density, frequency), np.var(values), rtol=0.02)  # each run loses its own mean
    # at 0 Hz both are rounding
    assert_allclose(spectral_density(samples, -3.0 * values + 7.0)[1], 9.0 * density, rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize("sensed", [0.0, 0.5, 1.0])
def test_noise_of_a_recorded_current_counts_as_far_as_the_balance_holds_it(sensed):
    """The motor follows the share `sensed` of its amplitude, which is then in the torque as well and no error."""
    size, runs = 0.02, []
    for number, name in enumerate(("one", "two")):
        run = record(JOINT, name, 0.9 * number, number)
        noise = size * np.random.default_rng(number).standard_normal(run.time.size)
        more = {"joint/current": noise, "joint/torque": sensed * noise / JOINT.gain}
        runs.append(replace(run, columns=run.columns | {key: run.columns[key] + value for key, value in more.items()}))
    samples = build_samples(runs, rig_of(JOINT), "joint")
    columns = Columns(samples)
    fitted = fit(columns, TERMS)
    left = (columns.target - columns.design(TERMS) @ fitted.beta) * fitted.gain
    k = np.convolve(samples.light.kernels[0], samples.kernel.kernels[0])
    assert left_by_effort_noise(samples, left, 2.0 * float(np.std(left))) == 0.0
    assert_allclose(left_by_effort_noise(samples, left, 0.0), (1.0 - sensed) * size * np.sqrt(k @ k), atol=0.02 * size)
