"""Intervals that cover, parameters in true units, and bounds that are said to be hit."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.estimates import (
    block_lengths,
    estimates,
    physical_parameters,
    rests_on_bound,
    shape_slopes,
)
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.result.widening import widened
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.effects.library import effect

from ..rigs import Joint, problem

TRUTH = {("drive", "gain"): 0.08, ("viscous", "viscous"): 6.0, ("coulomb", "coulomb"): 3.0}
SEEDS = 40


def coloured(seed: int, rho: float, size: float):
    """An error of the torque sensor with the autocorrelation of an AR(1) process and RMS `size` [N m]."""

    def error(m):
        white = np.random.default_rng(seed).standard_normal(m.q.size + 500)
        return size * np.sqrt(1 - rho**2) * lfilter([1.0], [1.0, -rho], white)[500:]

    return error


@pytest.mark.parametrize("rho", [0.0, 0.98])
def test_intervals_cover_the_truth(rho):
    covered = dict.fromkeys(TRUTH, 0)
    for seed in range(SEEDS):
        p = problem(Joint(duration=12.0, period=4e-3, sensor=coloured(seed, rho, 0.5)))
        found = estimates(p.columns, p.baseline, "current")
        for key, true in TRUTH.items():
            low, high = found[key[0]][key[1]].ci95
            covered[key] += low <= true <= high
    total = sum(covered.values()) / (SEEDS * len(TRUTH))
    assert total >= 0.85, covered
    assert min(covered.values()) >= 0.75 * SEEDS, covered  # 30 of 40 at 95 %: one case in 10^9
    if rho == 0.0:
        assert total <= 0.999, covered  # intervals that always cover say too little


def test_shape_parameters_have_intervals_too():
    hits = 0
    for seed in range(10):
        extra = lambda m: 1.5 * np.sin(11.0 * m.q)  # noqa: E731
        p = problem(Joint(duration=12.0, period=4e-3, torque_noise=0.4, extra=extra), seed=seed)
        start = Term(effect("torque_ripple"), {"cycles_per_turn": 10.9})
        found = estimates(p.columns, refine(p.columns, fit(p.columns, [*p.declared, start])), "current")
        low, high = found["torque_ripple"]["cycles_per_turn"].ci95
        assert high - low < 0.5
        hits += low <= 11.0 <= high
    assert hits >= 8


def test_an_estimate_on_its_bound_says_so():
    p = problem(Joint(torque_noise=0.3, extra=lambda m: -0.1 * np.abs(m.tau) * np.sign(m.v)))
    found = estimates(p.columns, fit(p.columns, [*p.declared, Term(effect("load_dependent_friction"))]), "current")
    mu = found["load_dependent_friction"]["load_friction"]
    assert mu.at_bound
    assert mu.value == 0.0
    assert mu.ci95[0] == 0.0
    assert not found["viscous"]["viscous"].at_bound


def test_units_follow_the_drive():
    p = problem(Joint(torque_noise=0.3))
    terms = [*p.declared, Term(effect("deadzone"), {"deadzone": 0.01})]
    found = estimates(p.columns, fit(p.columns, terms), "current")
    assert found["drive"]["gain"].unit == "A/(N*m)"
    assert found["deadzone"]["deadzone"].unit == "A"
    assert found["viscous"]["viscous"].unit == "N*m*s/rad"


def test_with_a_sensor_gain_every_torque_is_a_true_torque():
    wrong = replace(Joint(), sensor=lambda m: 0.2 * m.tau)
    p = problem(wrong)
    found = fit(p.columns, [*p.declared, Term(effect("torque_sensor_gain"))])
    named = physical_parameters(found, found.beta, np.zeros(0))
    assert_allclose(named["torque_sensor_gain"]["gain_error"], 0.2, rtol=0.01)
    # noise-free; what is left are the reversals of the Coulomb friction
    assert_allclose(named["drive"]["gain"], wrong.gain, rtol=2e-3)
    assert_allclose(named["viscous"]["viscous"], wrong.viscous, rtol=5e-3)
    assert_allclose(named["coulomb"]["coulomb"], wrong.coulomb, rtol=5e-3)


def test_autocorrelation_is_counted_inside_each_run_alone():
    p = problem(Joint(torque_noise=0.3, duration=8.0), runs=3)
    lengths = block_lengths(p.columns)
    assert sum(lengths) == p.columns.target.size
    ends = np.cumsum(lengths)[:-1]
    switches = np.flatnonzero(np.diff(p.samples.run)) + 1
    assert set(switches) <= set(ends)


def test_the_slope_by_a_shape_is_the_derivative_of_the_prediction():
    """Of a Stribeck velocity, against a central difference with a step a hundred times smaller."""
    p = problem(Joint(duration=12.0, period=4e-3))
    shape = {"stribeck_velocity": 0.05, "stribeck_exponent": 2.0}
    terms = [*p.declared, Term(effect("stribeck"), shape)]
    beta = np.array([12.0, *(0.5 for t in p.declared for _ in t.effect.coefficients), 2.0])
    found = shape_slopes(p.columns, terms, beta)
    assert found.shape == (p.columns.target.size, 2)
    sides = [
        p.columns.design([*p.declared, Term(effect("stribeck"), shape | {"stribeck_velocity": v})]) @ beta
        for v in (0.05 - 5e-7, 0.05 + 5e-7)
    ]
    slope = (sides[1] - sides[0]) / 1e-6
    assert_allclose(found[:, 0], slope, atol=2e-3 * np.abs(slope).max())  # one-sided, over 0.1 % of the velocity


def test_what_is_not_known_of_a_shape_widens_its_interval():
    p = problem(Joint(duration=12.0, period=4e-3))
    fitted = fit(p.columns, [*p.declared, Term(effect("torque_ripple"), {"cycles_per_turn": 10.9})])
    found = estimates(p.columns, fitted, "current")
    spread = np.zeros((fitted.beta.size + 1,) * 2)
    spread[-1, -1] = 0.3**2
    low, high = found["torque_ripple"]["cycles_per_turn"].ci95
    wide = widened(found, fitted, spread)
    assert_allclose(
        np.subtract(*wide["torque_ripple"]["cycles_per_turn"].ci95[::-1]),
        np.hypot(high - low, 2.0 * 1.959964 * 0.3),
        rtol=1e-6,
    )
    assert wide["viscous"] == found["viscous"]


def test_a_wider_interval_ends_at_the_bound_of_its_parameter():
    p = problem(Joint(duration=12.0, period=4e-3, torque_noise=0.4))
    found = estimates(p.columns, p.baseline, "current")
    wide = widened(found, p.baseline, np.diag(np.full(p.baseline.beta.size, 50.0**2)))
    assert wide["coulomb"]["coulomb"].ci95[0] == 0.0
    assert wide["coulomb"]["coulomb"].ci95[1] > 50.0


def test_a_shape_that_acts_as_another_parameter_does_has_no_interval():
    """Of a drive that is always saturated, i = K limit sign(i): the gain and the limit only show as their product."""
    p = problem(Joint(duration=12.0, period=4e-3, torque_noise=0.2))
    smallest = float(np.min(np.abs(p.columns.samples.signals.effort[p.columns.samples.rows])))
    saturated = fit(p.columns, [*p.declared, Term(effect("saturation"), {"limit": 0.5 * smallest})])
    found = estimates(p.columns, saturated, "current")
    assert found["saturation"]["limit"].ci95 == (0.0, np.inf)
    assert np.isfinite(found["coulomb"]["coulomb"].ci95).all()


@pytest.mark.parametrize("value", [0.3, 0.0])
def test_the_answer_for_a_numpy_value_can_be_written_to_the_report(value):
    assert json.dumps(rests_on_bound(np.float64(value), 0.0, 10.0)) == ("true" if value == 0.0 else "false")
