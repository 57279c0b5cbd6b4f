"""Closed forms for the estimate; seeded trials for what an interval promises."""

import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import (
    autocovariance,
    automatic_bandwidth,
    correlation_time,
    critical_value_95,
    long_run_covariance,
)
from drake_tc.identification.regression import least_squares

TRUTH = np.array([1.0, 2.0, 3.0])


def ar1(rng, samples, rho):
    return lfilter([1.0], [1.0, -rho], rng.normal(size=samples + 500))[500:]


def problem(seed, samples=2000, rho=0.9):
    rng = np.random.default_rng(seed)
    t = np.arange(samples)
    columns = np.stack(
        [
            np.sin(2 * np.pi * 7 * t / samples + seed),
            ar1(rng, samples, 0.95),
            np.sign(np.cos(10 * np.pi * t / samples)),
        ],
        axis=1,
    )
    return columns, columns @ TRUTH + ar1(rng, samples, rho)


def test_an_exact_line_is_found_with_its_condition_and_no_spread():
    x = np.linspace(-1, 1, 101)
    fit = least_squares(np.stack([np.ones(101), x], axis=1), 2 - 3 * x, names=["offset", "slope"])
    assert_allclose([fit.parameters["offset"], fit.parameters["slope"]], [2, -3], rtol=1e-12)
    assert_allclose(fit.condition_number, 1, rtol=1e-12)  # orthogonal columns
    assert_allclose(fit.ci95, [[2, 2], [-3, -3]], rtol=1e-9)
    assert_allclose(fit.predict(np.array([[1.0, 10.0]])), [-28], rtol=1e-12)


def test_white_noise_covariance_of_a_mean_is_the_textbook_one():
    y = np.random.default_rng(0).normal(size=5000) + 4
    fit = least_squares(np.ones((5000, 1)), y)
    assert_allclose(fit.coefficients, [y.mean()], rtol=1e-12)
    assert_allclose(fit.covariance, [[y.var(ddof=1) / 5000]], rtol=1e-9)
    # the Newey–West estimate of the same number, from some ten lags of 5000 samples
    assert_allclose(fit.hac_covariance, fit.covariance, rtol=0.2)
    assert_allclose(fit.effective_samples, 5000, rtol=0.15)


def test_weights_act_as_repetitions():
    rng = np.random.default_rng(1)
    columns, target = rng.normal(size=(50, 2)), rng.normal(size=50)
    counts = rng.integers(1, 4, 50)
    repeated = least_squares(np.repeat(columns, counts, axis=0), np.repeat(target, counts))
    weighted = least_squares(columns, target, weights=counts.astype(float))
    assert_allclose(weighted.coefficients, repeated.coefficients, rtol=1e-10)


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(1e-6, 1e6), unit=st.floats(1e-6, 1e6), seed=st.integers(0, 1000))
def test_units_do_not_matter(scale, unit, seed):
    columns, target = problem(seed, samples=300)
    fit = least_squares(columns, target)
    other = least_squares(columns * [scale, 1, 1], target * unit)
    back = np.array([scale, 1, 1]) / unit
    assert_allclose(other.coefficients * back, fit.coefficients, rtol=1e-8)
    assert_allclose(other.ci95 * back[:, None], fit.ci95, rtol=1e-6)
    assert_allclose(other.condition_number, fit.condition_number, rtol=1e-8)
    assert_allclose(other.correlation, fit.correlation, atol=1e-8)


def test_hac_intervals_cover_and_naive_ones_do_not():
    hac, naive = np.zeros(3), np.zeros(3)
    for seed in range(300):
        columns, target = problem(seed)
        fit = least_squares(columns, target)
        hac += (fit.ci95[:, 0] < TRUTH) & (fit.ci95[:, 1] > TRUTH)
        naive += np.abs(fit.coefficients - TRUTH) < 1.96 * np.sqrt(np.diag(fit.covariance))
    assert np.all((hac / 300 >= 0.90) & (hac / 300 <= 0.98)), hac / 300
    assert np.all(naive / 300 < 0.7), naive / 300


def test_effective_sample_size_of_ar1_noise():
    # exactly: T (1 − ρ)/(1 + ρ); the estimate scatters by some 15 %
    assert_allclose(correlation_time(ar1(np.random.default_rng(0), 200_000, 0.9)), 19, rtol=0.15)
    assert correlation_time(np.zeros(10)) == 1
    assert correlation_time(np.resize([1.0, -1.0], 1000)) == 1


@pytest.mark.parametrize("lengths", [None, [200, 1, 299]])
def test_long_run_covariance_is_the_bartlett_sum_and_pairs_stay_in_their_stretch(lengths):
    scores = np.random.default_rng(2).normal(size=(500, 2))
    total, gamma = np.zeros((2, 2)), np.zeros(40)
    edges = np.cumsum([0, *(lengths or [500])])
    for first, last in pairwise(edges):
        for s in range(first, last):
            for t in range(max(first, s - 39), s + 1):
                gamma[s - t] += scores[s, 0] * scores[t, 0] / 500
                pair = max(0.0, 1 - (s - t) / 9) * np.outer(scores[s], scores[t])
                total += pair if s == t else pair + pair.T
    assert_allclose(long_run_covariance(scores, 9, lengths), total, rtol=1e-10)
    assert_allclose(autocovariance(scores[:, 0], 40, lengths), gamma, atol=1e-12)


def test_bandwidth_grows_with_memory_and_with_the_cube_root_of_the_samples():
    rng = np.random.default_rng(4)
    short, long = (automatic_bandwidth(ar1(rng, n, 0.9)) for n in (20_000, 160_000))
    assert_allclose(long / short, 2, rtol=0.25)
    assert automatic_bandwidth(rng.normal(size=20_000)) < short / 3


def test_critical_value_at_the_ends():
    assert_allclose(critical_value_95(1, 10**9), 1.96, atol=1e-3)
    # simulated value of the Bartlett fixed-b statistic at b = 1: 4.771
    assert_allclose(critical_value_95(100, 100), 4.813, atol=0.06)


def test_poor_excitation_names_the_parameter_and_the_condition():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(100, 3))
    x[:, 2] = x[:, 1] * (1 + 1e-9)
    with pytest.raises(
        IdentificationError, match=r"excitation too poor: condition number .*K_[vc].*cannot tell from K_"
    ):
        least_squares(x, x[:, 0], names=["K_tau", "K_v", "K_c"])
    x[:, 1] = 0
    with pytest.raises(IdentificationError, match="nothing in the data excites K_v"):
        least_squares(x, x[:, 0], names=["K_tau", "K_v", "K_c"])


@pytest.mark.parametrize(
    ("columns", "target", "options", "message"),
    [
        (np.ones((5, 1)), np.ones(4), {}, r"target \(T,\)"),
        (np.ones((2, 2)), np.ones(2), {}, "need more than 2 samples"),
        (np.full((5, 1), np.nan), np.ones(5), {"names": ["K_v"]}, "K_v"),
        (np.ones((5, 1)), np.full(5, np.inf), {}, "target"),
        (np.ones((5, 1)), np.ones(5), {"names": ["a", "b"]}, "1 columns but 2 names"),
        (np.ones((5, 1)), np.ones(5), {"weights": -np.ones(5)}, "weights"),
        (np.ones((5, 1)), np.ones(5), {"lengths": [2, 2]}, "add up"),
    ],
)
def test_bad_input_is_refused(columns, target, options, message):
    with pytest.raises(IdentificationError, match=message):
        least_squares(columns, target, **options)


@pytest.mark.benchmark
def test_time_grows_linearly():
    """The best of five, in turn: the least that each takes is not the work of others on the machine."""
    problems = [problem(0, samples=samples) for samples in (100_000, 400_000)]
    seconds = np.empty((5, 2))
    for row in seconds:
        for which, (columns, target) in enumerate(problems):
            start = time.process_time()
            least_squares(columns, target)
            row[which] = time.process_time() - start
    few, many = seconds.min(axis=0)
    assert many < 12 * few
