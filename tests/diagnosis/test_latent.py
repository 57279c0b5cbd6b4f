"""The most probable effort and load of a simulated log: their errors tell nothing of the residual."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.noise import filtered, latent_shares
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.split import with_needed
from drake_tc.effects.library import effect
from tests.diagnosis.rigs import Joint, problem, record, rig_of

GAIN = 1.0
"""K [effort/(N m)]."""


@pytest.fixture(scope="module")
def samples():
    return problem(Joint(encoder_noise=2e-5, encoder_step=0.0)).samples


def _noise(samples, level: float, seed: int) -> np.ndarray:
    return level * np.random.default_rng(seed).normal(size=len(samples.signals))


def _correlation(samples, x: np.ndarray, y: np.ndarray) -> float:
    """Over all samples but the margins of the filters."""
    inner = slice(2 * samples.light.margin, -2 * samples.light.margin)
    x, y = x[inner], y[inner]
    return float(x @ y / np.sqrt((x @ x) * (y @ y)))


def test_where_the_effort_s_noise_is_all_the_effort_is_the_modelled_one(samples) -> None:
    residual = samples.light.smooth(_noise(samples, samples.resolution.effort_noise, 1))
    left = filtered(samples, latent_shares(samples, residual, GAIN)[0], residual)
    assert np.std(samples.reduce(left)) < 0.25 * np.std(samples.reduce(residual))


def test_what_the_noise_does_not_explain_stays_in_the_effort(samples) -> None:
    slow = np.sin(2.0 * np.pi * 0.5 * samples.signals.time)
    left = filtered(samples, latent_shares(samples, slow, GAIN)[0], slow)
    np.testing.assert_allclose(samples.reduce(left), samples.reduce(slow), atol=0.03)


def test_the_error_of_the_latent_effort_tells_nothing_of_the_residual(samples) -> None:
    """u - w = n - d with the noise n of u and a disturbance d that w lacks: the error of x = u - n is x - (u - n)."""
    own = samples.light.smooth(_noise(samples, samples.resolution.effort_noise, 1))
    other = samples.light.smooth(_noise(samples, 1.5 * samples.resolution.effort_noise, 3))
    residual = own - other
    wrong = filtered(samples, latent_shares(samples, residual, GAIN)[0], residual) + other
    assert _correlation(samples, own, residual) > 0.4
    assert abs(_correlation(samples, wrong, residual)) < 0.1


def test_the_load_takes_up_its_own_noise_and_nothing_that_the_model_lacks(samples) -> None:
    """u - w = n - K n_tau: the error of the load is n_tau + m * (u - w)/K, m = K^2 S_tau/S."""
    noisy = replace(samples, resolution=replace(samples.resolution, torque_noise=samples.resolution.effort_noise))
    own, of_load = (noisy.light.smooth(_noise(noisy, noisy.resolution.effort_noise, seed)) for seed in (1, 3))
    residual = own - GAIN * of_load
    error = of_load + filtered(noisy, latent_shares(noisy, residual, GAIN)[1], residual) / GAIN
    assert _correlation(noisy, of_load, residual) < -0.5
    assert abs(_correlation(noisy, error, residual)) < 0.1
    lacking = residual + 100.0 * np.std(residual) * np.sin(2.0 * np.pi * 0.5 * noisy.signals.time)
    taken = filtered(noisy, latent_shares(noisy, lacking, GAIN)[1], lacking)
    assert np.std(noisy.reduce(taken)) < 0.05 * np.std(noisy.reduce(lacking))


def test_rest_tells_nothing_of_the_noise(samples) -> None:
    """There the friction that holds a joint is not what the model needs."""
    residual = samples.light.smooth(_noise(samples, 1.5 * samples.resolution.effort_noise, 1))
    wild = np.where(samples.moving, residual, 1e3 * np.std(residual))
    assert np.count_nonzero(~samples.moving) > 50
    for one, other in zip(*(latent_shares(samples, each, GAIN) for each in (residual, wild)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_at_rest_the_load_is_the_recorded_one_and_so_is_the_effort() -> None:
    """The friction that holds a joint may be anything, so that the effort there is an error of no channel."""
    found = problem(Joint(torque_noise=1.0))
    s, rest = found.samples.signals, ~found.samples.moving
    held = replace(s, effort=s.effort + np.where(rest, 50.0 * np.std(s.effort), 0.0))
    other = found.columns.changed(samples=replace(found.samples, signals=held))
    one, two = (
        with_needed(columns, found.declared, found.baseline.beta, measured=True) for columns in (found.columns, other)
    )
    assert np.count_nonzero(rest) > 50
    np.testing.assert_array_equal(two.load, one.load)
    np.testing.assert_allclose(two.acting[~rest], one.acting[~rest], atol=1e-9)


def test_the_effort_that_a_dead_zone_holds_back_is_no_noise() -> None:
    """u = w + d sign(w) with the effort's noise: what arrives differs from w by noise alone, which stays out of x."""
    joint, width = Joint(), 0.3
    made = record(joint)
    drawn = 0.02 * np.random.default_rng(5).normal(size=made.time.size)
    sent = made.columns["joint/current"]
    columns = made.columns | {"joint/current": sent + width * np.sign(sent) + drawn}
    samples = build_samples([replace(made, columns=columns)], rig_of(joint), "joint")
    terms = (*(Term(effect(key)) for key in ("viscous", "coulomb")), Term(effect("deadzone"), {"deadzone": width}))
    true = np.array([1.0 / joint.gain, joint.viscous, joint.coulomb])
    split = with_needed(Columns(samples), terms, true, measured=True)
    taken, whole = (samples.reduce(effort - split.needed) for effort in (split.acting, split.arrived))
    assert np.std(taken) < 0.4 * np.std(whole) < 0.01


def test_what_stands_in_the_margins_of_the_light_filter_does_not_reach_the_rows() -> None:
    """There an acceleration rests on how the log was extended, and may be a hundred times too large."""
    found = problem(Joint(torque_noise=1.0))
    s, edge = found.samples.signals, found.samples.light.margin
    wild = s.acceleration.copy()
    for each in found.samples.segments:
        wild[each.start : each.start + edge] = wild[each.stop - edge : each.stop] = 1e5
    other = found.columns.changed(samples=replace(found.samples, signals=replace(s, acceleration=wild)))
    loads = [
        found.samples.reduce(with_needed(columns, found.declared, found.baseline.beta, measured=True).load)
        for columns in (found.columns, other)
    ]
    np.testing.assert_allclose(loads[1], loads[0], atol=0.01 * np.std(loads[0]))
