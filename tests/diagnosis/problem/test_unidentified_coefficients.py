"""Coefficients that the rows do not identify stay at zero, and effects that leave the drive no torque are no model."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import cross_validated, fit, fold_of, solve_bounded
from drake_tc.effects.base import plain_signals
from drake_tc.effects.library import effect

from ..rigs import Joint, problem

JOINT = Joint(torque_noise=0.3)
ANY = np.array([-np.inf, -np.inf, -np.inf])


@pytest.mark.parametrize("size", [0.0, 1e-160, 1e-17])
def test_a_column_of_rounding_errors_has_no_coefficient(size):
    rng = np.random.default_rng(0)
    x = rng.standard_normal((50, 3)) * np.array([1.0, size, 5.0])
    z = rng.standard_normal(50)
    found = solve_bounded(x.T @ x, x.T @ z, ANY, -ANY)
    assert found[1] == 0.0
    assert_allclose(found[::2], np.linalg.lstsq(x[:, ::2], z, rcond=None)[0], rtol=1e-9)
    assert solve_bounded(x.T @ x, x.T @ z, np.array([-np.inf, 0.25, -np.inf]), -ANY)[1] == 0.25


@pytest.mark.parametrize("outside", [0.0, 1e-155, 1e-9])
def test_a_column_that_acts_in_one_fold_only_is_not_extrapolated_into_it(outside):
    """As the effort does under a dead zone that only one stretch of the log exceeds."""
    rng = np.random.default_rng(1)
    x, z = rng.standard_normal((4, 30, 3)), rng.standard_normal((4, 30))
    x[1:, :, 0] *= outside
    with np.errstate(all="raise", under="ignore"):
        whole, folds = cross_validated(np.einsum("fni,fnj->fij", x, x), np.einsum("fni,fn->fi", x, z), ANY, -ANY)
    assert folds[0, 0] == 0.0
    assert_allclose(folds[0, 1:], np.linalg.lstsq(x[1:, :, 1:].reshape(90, 2), z[1:].ravel(), rcond=None)[0], rtol=1e-7)
    assert_allclose(whole, np.linalg.lstsq(x.reshape(120, 3), z.ravel(), rcond=None)[0], rtol=1e-7)


def test_a_dead_zone_that_one_fold_exceeds_is_fitted_without_overflow():
    p = problem(JOINT)
    samples = p.samples
    row_is_first = fold_of(samples.block) == 0
    first = np.interp(np.arange(len(samples.signals)), samples.rows, row_is_first.astype(float)) == 1.0
    effort = np.where(first, samples.signals.effort, 1e-3 * samples.signals.effort)
    quiet = Columns(replace(samples, signals=replace(samples.signals, effort=effort)), p.columns.gain)
    limit = 1.1e-3 * float(np.max(np.abs(samples.signals.effort)))
    with np.errstate(over="raise", invalid="raise"):
        found = fit(quiet, [*p.declared, Term(effect("deadzone"), {"deadzone": limit})])
    assert np.all(np.abs(found.beta) < 1e3) and np.isfinite(found.cv_rms)


@pytest.mark.parametrize(("share", "sound"), [(-1.0, False), (0.5, True), (1.0, True)])
def test_effects_that_explain_the_load_without_the_drive_are_no_model(share, sound):
    """The target holds only `share` of what the effort of the declared model supplies."""
    p = problem(JOINT)
    effort, friction = p.columns.design(p.declared)[:, 0], p.columns.design(p.declared)[:, 1:]
    target = share * p.baseline.beta[0] * effort + friction @ p.baseline.beta[1:]
    assert np.isfinite(fit(p.columns.changed(target=target), p.declared).cv_rms) == sound


def test_the_lag_of_a_winding_does_not_turn_into_an_inertia():
    """For a short time constant T the column is -T qddot, so that F_e T alone would be identified."""
    winding = effect("current_lag.winding")
    least = winding.shapes[0].lower
    assert least == winding.parameters[0].lower == 1e-4
    time = np.arange(2000) * 1e-3
    log = replace(plain_signals(2000, {"velocity": np.sin(3.0 * time)}), period=1e-3)
    column = winding.columns(log, {"lag": least})[100:, 0]
    assert_allclose(column, -least * 3.0 * np.cos(3.0 * time[100:]), atol=0.01 * least * 3.0)
