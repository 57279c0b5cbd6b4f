"""The Newton minimum against the quadratic program, and against what the penalty means."""

import time

import numpy as np
import pytest
from asymmetric_program import asymmetric_by_program
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.errors import IdentificationError
from drake_tc.identification.asymmetric import asymmetric_least_squares, penalty
from drake_tc.identification.regression import least_squares
from tests.benchmarks.times.machine import require


def servo(seed, samples, noise=2e-3):
    rng = np.random.default_rng(seed)
    tau, v = rng.normal(size=samples) * 20, rng.normal(size=samples)
    columns = np.stack([tau, v, np.sign(v)], axis=1)
    return columns, columns @ [2e-4, 7e-3, 3e-3] + rng.normal(size=samples) * noise


def cost(columns, target, x, weight):
    return float(penalty(np.sign(target) * (columns @ x - target), weight).sum())


@pytest.mark.parametrize("weight", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_newton_agrees_with_the_quadratic_program(seed, weight):
    columns, target = servo(seed, 400)
    newton = asymmetric_least_squares(columns, target, weight=weight).coefficients
    assert_allclose(asymmetric_by_program(columns, target, weight), newton, rtol=1e-6)


def test_weight_one_is_ordinary_least_squares():
    columns, target = servo(5, 500)
    fit = asymmetric_least_squares(columns, target, weight=1.0)
    assert_allclose(fit.coefficients, least_squares(columns, target).coefficients, rtol=1e-9)


def test_one_unknown_in_closed_form():
    # min over x of w (x − 1)² + (x − 2)²: only the sample below x is over-estimated
    fit = asymmetric_least_squares(np.ones((2, 1)), np.array([1.0, 2.0]), weight=3.0)
    assert_allclose(fit.coefficients, [(3 * 1 + 2) / 4], rtol=1e-12)
    assert fit.over_estimated == 0.5


def test_friction_is_over_estimated_less_often():
    columns, target = servo(1, 5000)
    symmetric = least_squares(columns, target)
    over = np.mean(np.sign(target) * (columns @ symmetric.coefficients - target) > 0)
    fit = asymmetric_least_squares(columns, target)
    assert over > 0.4
    assert fit.over_estimated < 0.15
    assert np.all(np.abs(fit.coefficients) < np.abs(symmetric.coefficients))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), share=st.floats(0.0, 1.0), weight=st.floats(1.0, 1e3))
def test_the_cost_is_convex_and_the_fit_is_its_minimum(seed, share, weight):
    columns, target = servo(seed, 60)
    rng = np.random.default_rng(seed + 1)
    x, y = rng.normal(size=(2, 3)) * 1e-2
    between = cost(columns, target, share * x + (1 - share) * y, weight)
    ends = share * cost(columns, target, x, weight) + (1 - share) * cost(columns, target, y, weight)
    assert between <= ends * (1 + 1e-12)
    fit = asymmetric_least_squares(columns, target, weight=weight)
    assert_allclose(fit.cost, cost(columns, target, fit.coefficients, weight), rtol=1e-9)
    nearby = fit.coefficients + 1e-3 * fit.coefficients * rng.normal(size=3)
    assert fit.cost <= cost(columns, target, nearby, weight) * (1 + 1e-12)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), scale=st.floats(1e-5, 1e5), unit=st.floats(1e-5, 1e5))
def test_units_and_signs_do_not_matter(seed, scale, unit):
    columns, target = servo(seed, 80)
    fit = asymmetric_least_squares(columns, target)
    other = asymmetric_least_squares(columns * [scale, 1, -1], -unit * target)
    assert_allclose(other.coefficients, -unit * fit.coefficients / [scale, 1, -1], rtol=1e-6)


def test_samples_without_effort_take_no_part():
    columns, target = servo(2, 300)
    idle = np.random.default_rng(0).normal(size=(50, 3))
    both = asymmetric_least_squares(np.vstack([columns, idle]), np.concatenate([target, np.zeros(50)]))
    assert_allclose(both.coefficients, asymmetric_least_squares(columns, target).coefficients, rtol=1e-9)


def test_intervals_have_the_spread_of_repeated_experiments():
    fits = [asymmetric_least_squares(*servo(seed, 800)) for seed in range(150)]
    spread = np.std([fit.coefficients for fit in fits], axis=0)
    stated = np.mean([np.sqrt(np.diag(fit.hac_covariance)) for fit in fits], axis=0)
    assert_allclose(stated, spread, rtol=0.25)  # 150 repetitions: 6 % scatter of a deviation, and few lags


@pytest.mark.benchmark
def test_a_million_samples_in_under_a_second():
    columns, target = servo(0, 1_000_000)

    def fitted():
        start = time.perf_counter()
        asymmetric_least_squares(columns, target)
        return {"a million samples": time.perf_counter() - start}

    require({"a million samples": 0.5}, fitted)


def test_bad_input_is_refused():
    columns, target = servo(0, 50)
    with pytest.raises(IdentificationError, match="weight"):
        asymmetric_least_squares(columns, target, weight=0.5)
    with pytest.raises(IdentificationError, match="excitation too poor"):
        asymmetric_least_squares(columns * [1, 0, 1], target)
    with pytest.raises(IdentificationError, match="excitation too poor"):
        asymmetric_least_squares(np.column_stack([columns, columns[:, 0]]), target)
