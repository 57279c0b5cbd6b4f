"""The regression: numpy's least squares, a brute-force cross-validation and scipy's bounded solver say the same."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import FOLDS, fit, fold_of, predict, solve_bounded
from drake_tc.effects.library import effect

from ..rigs import Joint, motion, problem, record, rig_of

JOINT = Joint(torque_noise=0.3)
TERMS = (Term(effect("viscous")), Term(effect("coulomb")), Term(effect("torque_sensor_bias")))


@pytest.fixture(scope="module")
def columns() -> Columns:
    return Columns(problem(JOINT, runs=2).samples)  # residuals in each fit's own gain


def test_fit_is_numpys_least_squares(columns):
    x, z = columns.design(TERMS), columns.target
    wanted = np.linalg.lstsq(x, z, rcond=None)[0]
    found = fit(columns, TERMS)
    assert_allclose(found.beta, wanted, rtol=1e-7, atol=1e-9)  # normal equations of a well-conditioned design
    assert_allclose(found.residual, (z - x @ wanted) / wanted[0], atol=1e-9)
    assert_allclose(found.rms, np.sqrt(np.mean(((z - x @ wanted) / wanted[0]) ** 2)), rtol=1e-9)


def test_cross_validation_is_leaving_each_fold_out(columns):
    x, z, block = columns.design(TERMS), columns.target, columns.samples.block
    whole = np.linalg.lstsq(x, z, rcond=None)[0]
    fold, held = fold_of(block), np.empty_like(z)
    for f in range(FOLDS):
        out = fold == f
        held[out] = (z[out] - x[out] @ np.linalg.lstsq(x[~out], z[~out], rcond=None)[0]) / whole[0]
    found = fit(columns, TERMS)
    assert_allclose(found.cv_rms, np.sqrt(np.mean(held**2)), rtol=1e-7)
    assert found.cv_rms > found.rms
    assert_allclose(found.block_sse, [np.sum(held[block == b] ** 2) for b in range(block.max() + 1)], rtol=1e-6)


def test_neighbouring_blocks_share_a_fold_in_pairs():
    fold = fold_of(np.arange(40))
    assert_allclose(fold[0::2], fold[1::2])
    assert set(fold) == set(range(FOLDS))


@pytest.mark.parametrize("seed", range(40))
def test_bounds_are_those_of_scipys_solver(seed):
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((60, 4)) * np.array([1.0, 30.0, 1e-2, 5.0])
    z = x @ (rng.standard_normal(4) / np.array([1.0, 30.0, 1e-2, 5.0])) + 0.1 * rng.standard_normal(60)
    low = np.where(rng.random(4) < 0.5, 0.0, -np.inf)
    high = np.where(rng.random(4) < 0.2, 0.5, np.inf)
    wanted = lsq_linear(x, z, (low, high), method="bvls", tol=1e-12)
    found = solve_bounded(x.T @ x, x.T @ z, low, high)
    assert np.all(found >= low - 1e-9)
    assert np.all(found <= high + 1e-9)
    cost = 0.5 * float(np.sum((x @ found - z) ** 2))
    # nearly orthogonal columns: fixing all violated bounds at once is exact up to rounding in almost every draw
    assert cost <= wanted.cost * 1.001 + 1e-9


def test_a_coefficient_that_would_be_negative_rests_on_its_bound():
    backwards = replace(JOINT, extra=lambda m: -0.1 * np.abs(m.tau) * np.sign(m.v))
    p = problem(backwards)
    terms = [*p.declared, Term(effect("load_dependent_friction"))]
    found, without = fit(p.columns, terms), fit(p.columns, p.declared)
    assert found.beta[3] == 0.0
    assert_allclose(found.beta[:3], without.beta, rtol=1e-6)


def test_columns_that_say_the_same_are_no_explanation(columns):
    bias = Term(effect("torque_sensor_bias"))
    assert not np.isfinite(fit(columns, [*TERMS[:2], bias, replace(bias)]).cv_rms)


def test_prediction_on_other_runs_is_the_balance_there():
    joint = replace(JOINT, torque_noise=0.0, extra=lambda m: 0.8 * np.ones_like(m.q))
    p = problem(joint)
    other = record(joint, shift=2.0)
    held = Columns(build_samples([other], rig_of(joint), "joint", width_s=p.samples.light.width_s))
    residual = predict(held, fit(p.columns, p.declared))
    complete = predict(held, fit(p.columns, TERMS))
    assert np.sqrt(np.mean(complete**2)) < 0.01 * np.sqrt(np.mean(residual**2))
    assert residual.shape == held.target.shape


def test_drive_effects_act_on_the_effort_before_the_filter():
    joint = replace(JOINT, torque_noise=0.0, coulomb=0.0)
    p = problem(joint)
    run = record(joint)
    limit = 0.5 * float(np.max(np.abs(run.columns["joint/current"])))
    term = Term(effect("saturation"), {"limit": limit})
    clipped = p.columns.effort([*p.declared, term])
    m = motion(joint)
    need = joint.gain * (m.tau + joint.inertia * m.a + joint.viscous * m.v)
    # two passes of a 12 ms kernel over a corner: compare away from it
    wanted = np.clip(need, -limit, limit)[p.samples.rows]
    corner = np.abs(np.abs(need[p.samples.rows]) - limit) < 0.1 * limit
    assert_allclose(clipped[~corner], wanted[~corner], atol=1e-3 * limit)
    assert_allclose(p.columns.effort(p.declared), need[p.samples.rows], atol=1e-4 * limit)
