"""Effective samples against closed forms, and the noise floor against logs that hold nothing but noise."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.selection.comparison import compared, effective_samples, effective_samples_for
from drake_tc.diagnosis.selection.engine import compare
from drake_tc.diagnosis.selection.joint_problem import JointProblem, share_better
from drake_tc.diagnosis.thresholds import FITTED_LINKS, JOINT, SHARED
from drake_tc.effects.library import effect

from ..rigs import Joint, Problem, floor_of, problem, servo

QUADRATIC = Term(effect("quadratic_viscous"))


def fake(runs: list[int]) -> Any:
    return cast(Any, SimpleNamespace(run=np.repeat(np.arange(len(runs)), runs)))


def made_fit(block_sse: np.ndarray, size: int, cv_rms: float) -> Fit:
    terms = tuple(Term(effect("viscous")) for _ in range(size - 1))
    return Fit(terms, np.ones(size), np.zeros(1), cv_rms, cv_rms, block_sse)


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.95])
def test_effective_samples_of_an_ar1_process(rho):
    x = lfilter([1.0], [1.0, -rho], np.random.default_rng(3).standard_normal(200_000))
    found = effective_samples(x, fake([120_000, 80_000]))
    assert_allclose(found, x.size * (1 - rho) / (1 + rho), rtol=0.15)  # Sokal's window: a few per cent, 10 at 0.95


def test_effective_samples_ignore_the_mean_and_are_at_least_three():
    x = np.random.default_rng(0).standard_normal(20_000)
    assert_allclose(effective_samples(x + 5.0, fake([20_000])), effective_samples(x, fake([20_000])), rtol=1e-9)
    assert effective_samples(np.linspace(-1.0, 1.0, 500), fake([500])) >= 3.0


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.95])
@pytest.mark.parametrize("omega", [0.0, 0.05, 0.4])
def test_samples_that_tell_the_size_of_a_wave_beside_an_ar1_process(rho, omega):
    """1 + 2 sum_l rho^l cos(omega l) = (1 - rho^2)/(1 - 2 rho cos(omega) + rho^2); a constant has omega 0."""
    x = lfilter([1.0], [1.0, -rho], np.random.default_rng(3).standard_normal(200_000))
    wave = np.cos(omega * np.arange(x.size))
    found = effective_samples_for(wave, x, fake([120_000, 80_000]))
    time = (1 - rho**2) / (1 - 2 * rho * np.cos(omega) + rho**2)
    assert_allclose(found, x.size / max(time, 1.0), rtol=0.15)


def test_the_samples_are_those_that_the_scatter_of_a_coefficient_asks_for():
    """Amplitudes of a wave fitted to AR(1) noise scatter by sigma over the root of half the samples."""
    rng, rho, size = np.random.default_rng(8), 0.9, 2000
    wave = np.cos(0.05 * np.arange(size))
    noise = lfilter([1.0], [1.0, -rho], rng.standard_normal((400, size + 200)), axis=1)[:, 200:]
    scatter = float(np.std(noise @ wave / (wave @ wave)))
    found = np.mean([effective_samples_for(wave, each, fake([size])) for each in noise[:60]])
    assert_allclose(found, np.var(noise) / (scatter**2 * np.mean(wave**2)), rtol=0.2)


NOISY = {
    "torque sensor": Joint(torque_noise=0.3),
    "encoder of a current drive": Joint(encoder_noise=2e-4),
    "encoder of a servo": servo(encoder_noise=1e-4),
    "both": servo(encoder_noise=1e-4, torque_noise=0.2),
}


@pytest.mark.parametrize("name", NOISY)
def test_noise_floor_is_what_noise_alone_leaves(name):
    # no Coulomb friction: its reversals would leave something that is no noise
    joint = replace(NOISY[name], coulomb=0.0, duration=40.0)
    p = problem(joint, seed=4)
    assert_allclose(floor_of(p), p.baseline.rms, rtol=0.1)


def test_noise_floor_of_encoder_steps():
    joint = Joint(encoder_step=2 * np.pi / 2**14, coulomb=0.0, duration=40.0)
    p = problem(joint)
    floor = floor_of(p)
    # steps are no white noise where the joint is slow: same size, not the same number
    assert 0.5 < floor / p.baseline.rms < 2.0


def test_share_of_resamples_where_the_larger_fit_is_better():
    rng = np.random.default_rng(1)
    small = 1.0 + 0.5 * rng.random(60)
    assert share_better(made_fit(small, 2, 1.0), made_fit(small - 0.1, 3, 0.9)) == 1.0
    assert share_better(made_fit(small, 2, 1.0), made_fit(small + 0.1, 3, 1.1)) == 0.0
    toss = small + np.where(np.arange(60) // 2 % 2 == 0, 0.2, -0.2)
    assert 0.3 < share_better(made_fit(small, 2, 1.0), made_fit(toss, 3, 1.0)) < 0.7


def as_problem(p: Problem) -> JointProblem:
    return JointProblem(p.columns, (), p.context, frozenset(), floor_of(p))


def test_comparison_charges_for_parameters_by_effective_samples():
    p = problem(Joint(torque_noise=0.3), seed=2)
    small = fit(p.columns, p.declared)
    same = compare(as_problem(p), small, small)
    assert same.gain == 0.0
    assert same.log_evidence == 0.0
    assert same.removed == 0.0
    useless = compare(as_problem(p), small, fit(p.columns, [*p.declared, QUADRATIC]))
    assert useless.log_evidence < 0.0
    planted = problem(Joint(torque_noise=0.3, extra=lambda m: 0.5 * m.v * np.abs(m.v)), seed=2)
    small, large = (fit(planted.columns, t) for t in (planted.declared, (*planted.declared, QUADRATIC)))
    real = compare(as_problem(planted), small, large)
    assert real.log_evidence > 20.0
    assert real.share == 1.0
    assert_allclose(real.removed**2 + large.cv_rms**2, small.cv_rms**2, rtol=1e-9)


def test_evidence_is_told_joint_by_joint_and_its_price_is_shared():
    small, large, effective = np.array([2.0, 1.0]), np.array([1.0, 1.0]), np.array([100.0, 300.0])
    both = compared(small, large, effective, 2, 1.0)
    assert_allclose(both.gain, [0.5, 0.0])
    assert_allclose(both.removed, [np.sqrt(3.0), 0.0])
    assert_allclose(both.log_evidence.sum(), 100.0 * np.log(2.0) - np.log(400.0))  # 2 parameters, half a log each
    assert both.is_real(np.ones(2), np.zeros(2), JOINT)
    assert both.is_real(np.ones(2), np.full(2, 30.0), JOINT)  # little beside the first effects, but noise is left
    assert not both.is_real(np.full(2, 0.45), np.full(2, 30.0), JOINT)  # 2.2 floors are left: a form corrected in part
    less = compared(np.array([1.2, 1.0]), large, effective, 2, 1.0)
    assert less.is_real(np.ones(2), np.full(2, 6.0), JOINT)
    assert not less.is_real(np.ones(2), np.full(2, 7.0), JOINT)  # sqrt(1.2^2 - 1) is less than a tenth of 7
    assert not both.is_real(np.full(2, 4.0), np.zeros(2), JOINT)  # removes less than half a noise floor
    assert not both.is_real(np.ones(2), np.zeros(2), SHARED)  # one joint's own
    assert not compared(small, np.full(2, np.inf), effective, 2, 1.0).is_real(np.zeros(2), np.zeros(2), FITTED_LINKS)
