"""A fit that lets less noise through has explained nothing by that: the correction, in the fit and in its score."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.problem.columns import NOISE_RATIOS, Columns, Term
from drake_tc.diagnosis.problem.normal_equations import FOLDS, fold_of
from drake_tc.diagnosis.problem.regression import fit, score
from drake_tc.effects.delay import Delay
from drake_tc.effects.library import effect

from ..rigs import Problem, problem, servo

INERTIA = Term(effect("rotor_inertia"))
NOISY = servo(duration=16.0, period=4e-3, encoder_noise=3e-4, torque_noise=0.1, inertia=0.0, extra=lambda m: 0.3 * m.a)


@pytest.fixture(scope="module")
def p() -> Problem:
    return problem(NOISY, runs=2)


def test_the_declared_model_is_not_corrected(p):
    assert_allclose(p.columns.noise_ratio(p.baseline.beta, p.declared), 1.0, rtol=1e-12)
    assert Columns(p.samples).noise_ratio(0.1 * p.baseline.beta, p.declared) == 1.0  # each fit in its own gain


def test_a_model_with_an_error_of_the_torque_sensor_is_not_corrected_either():
    """The sensor's gain error scales the declared rotor inertia, and with it the noise that the model lets through."""
    p = problem(replace(NOISY, inertia=0.3), runs=2)
    terms, beta = [*p.declared, Term(effect("torque_sensor_gain"))], np.append(p.baseline.beta, 0.3)
    columns = p.columns.with_model(terms, beta, servo=True)
    assert_allclose(columns.noise_ratio(beta, terms), 1.0, rtol=1e-12)


def test_the_correction_is_the_ratio_of_the_floors_within_limits(p):
    def floor(beta: np.ndarray, inertia: float = 0.0) -> float:
        return p.samples.floor.torque(float(beta[0]), float(beta[1]), inertia)

    for factor in (0.8, 1.1):
        beta = p.baseline.beta * np.array([factor, 1.0, 1.0])
        found = p.columns.noise_ratio(beta, p.declared)
        assert_allclose(found, floor(p.baseline.beta) / floor(beta), rtol=1e-9)
    assert p.columns.noise_ratio(p.baseline.beta * np.array([1e4, 1.0, 1.0]), p.declared) == NOISE_RATIOS[0]
    with_inertia = np.append(p.baseline.beta, 0.1)
    found = p.columns.noise_ratio(with_inertia, [*p.declared, INERTIA])
    assert_allclose(found, floor(p.baseline.beta) / floor(p.baseline.beta, 0.1), rtol=1e-9)
    assert abs(found - 1.0) > 1e-3


def test_cross_validated_errors_are_weighed_and_the_others_are_not(p):
    terms = [*p.declared, INERTIA]
    found, quick = fit(p.columns, terms), score(p.columns, terms)
    x, z = p.columns.design(terms), p.columns.target
    fold, left = fold_of(p.samples.block), np.empty_like(z)
    for f in range(FOLDS):
        out = fold == f
        left[out] = z[out] - x[out] @ np.linalg.lstsq(x[~out], z[~out], rcond=None)[0]
    weight = p.columns.gain * p.columns.noise_ratio(found.beta, terms)
    assert abs(weight / p.columns.gain - 1.0) > 1e-4  # or this test says nothing
    assert_allclose(found.cv_rms, weight * np.sqrt(np.mean(left**2)), rtol=1e-6)
    assert_allclose(found.block_sse.sum(), weight**2 * np.sum(left**2), rtol=1e-6)
    assert_allclose(found.rms, p.columns.gain * np.sqrt(np.mean((z - x @ found.beta) ** 2)), rtol=1e-6)
    # squared errors are differences of squares a million times as large
    assert_allclose(quick.cv_rms, found.cv_rms, rtol=1e-6)
    assert_allclose(quick.beta, found.beta, rtol=1e-12)


def test_columns_that_say_the_same_are_no_explanation(p):
    bias = Term(effect("torque_sensor_bias"))
    twice = [*p.declared, bias, replace(bias)]
    assert not np.isfinite(score(p.columns, twice).cv_rms)
    assert not np.isfinite(fit(p.columns, twice).cv_rms)


def test_a_score_does_not_depend_on_what_was_scored_before(p):
    sets = [p.declared, [*p.declared, INERTIA], [*p.declared, Term(effect("torque_sensor_bias"))]]
    fresh = [
        score(Columns(p.columns.samples, p.columns.gain, p.samples.floor, p.columns.target), s).cv_rms for s in sets
    ]
    again = [score(p.columns, s).cv_rms for s in (*sets, *sets)][3:]
    assert_allclose(again, fresh, rtol=1e-6)


def test_a_lag_is_charged_for_the_noise_of_the_effort_that_it_takes_out(p):
    """Share of the variance against 10^5 samples of white noise; a delay by whole samples takes nothing out."""
    lag, period = 0.03, p.samples.light.period
    white = np.random.default_rng(0).standard_normal(100_000)
    smooth = [p.samples.kernel.smooth(p.samples.light.smooth(x)) for x in (white, lagged(white, lag, period))]
    expected = np.var(smooth[1][500:-500]) / np.var(smooth[0][500:-500])
    found = p.samples.passed_noise([(effect("current_lag"), {"lag": lag})])
    assert_allclose(found, expected, rtol=0.03)  # about 4000 independent samples: 2 %
    assert 0.2 < found < 0.9
    assert_allclose(p.samples.passed_noise([(Delay(), {"delay": 5.0 * period})]), 1.0, rtol=1e-9)


def lagged(values: np.ndarray, lag: float, period: float) -> np.ndarray:
    """T dy/dt + y = x by the trapezoidal rule."""
    out = lfilter([period, period], [period + 2.0 * lag, period - 2.0 * lag], values)
    return np.asarray(out)


def test_a_lag_that_only_takes_noise_out_explains_nothing(p):
    """With the noise of the effort as floor, the correction is the ratio of what both let through."""
    noisy = replace(p.samples.floor, effort_variance=1e6, torque_variance=0.0, encoder_gram=np.zeros((3, 3)))
    columns = Columns(p.samples, p.columns.gain, noisy)
    terms = [*p.declared, Term(effect("current_lag"), {"lag": 0.03})]
    share = p.samples.passed_noise([(effect("current_lag"), {"lag": 0.03})])
    assert_allclose(columns.noise_ratio(p.baseline.beta, terms), 1.0 / np.sqrt(share), rtol=1e-9)
