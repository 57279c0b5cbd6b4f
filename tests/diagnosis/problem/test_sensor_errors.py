"""The regression of one joint with its sensors' errors: the textbook posterior, the cut-off, what takes their place."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.regression import bounds_of, fit
from drake_tc.diagnosis.problem.sensor_errors import errors_of, expected_errors, spread_of_errors, weighed
from drake_tc.diagnosis.selection.comparison import effective_samples
from drake_tc.effects.library import effect
from drake_tc.effects.within_tolerance import within_tolerance

from ..rigs import Joint, problem

JOINT = Joint(duration=8.0, period=4e-3, torque_noise=0.5, sensor=lambda m: 0.15 + 0.0 * m.q)
ERRORS = within_tolerance((("torque_sensor_bias", 0.2), ("torque_sensor_gain", 0.01)))


@pytest.fixture(scope="module")
def rows():
    """The problem, its columns with the errors' prior, and the terms with the errors."""
    made = problem(JOINT)
    terms = [*made.declared, Term(ERRORS)]
    return made, weighed(made.columns, made.columns, made.baseline), terms


def normal_equations(columns, terms):
    x, z = columns.design(terms), columns.target
    return x.T @ x, x.T @ z


def test_the_estimate_is_the_textbook_posterior(rows):
    _, columns, terms = rows
    found = fit(columns, terms)
    rest = columns.target - columns.design(terms) @ found.beta
    weight = np.mean(rest**2) / columns.samples.sensor_prior.share
    gram, moment = normal_equations(columns, terms)
    gram[3:, 3:] += np.diag(weight / np.array(ERRORS.tolerances) ** 2)
    assert_allclose(found.beta, np.linalg.solve(gram, moment), rtol=1e-3, atol=1e-5)  # the weight has settled to less


def test_an_error_is_cut_off_at_three_tolerances(rows):
    _, columns, terms = rows
    moved = replace(columns.samples, signals=replace(columns.samples.signals, load_torque=_shifted(columns, 2.0)))
    found = fit(type(columns)(moved, columns.gain), terms)
    assert_allclose(found.beta[3], 0.6, rtol=1e-12)


def _shifted(columns, bias):
    return columns.samples.signals.load_torque + bias


def test_an_effect_among_the_terms_takes_the_place_of_its_part(rows):
    made, columns, terms = rows
    both = [*terms, Term(effect("torque_sensor_bias"))]
    low, high = bounds_of(both)
    assert low[3] == high[3] == 0.0 and low[4] < high[4]
    found = fit(columns, both)
    alone = fit(made.columns, [*made.declared, Term(effect("torque_sensor_bias"))])
    assert found.beta[3] == 0.0 and np.isfinite(found.cv_rms)
    assert_allclose(found.beta[5], alone.beta[3], atol=0.02)  # beside the gain, which moves it by less
    assert spread_of_errors(columns, found)[3, 3] == 0.0


def test_the_spread_is_the_posterior_s_where_noise_is_white(rows):
    """S = (C' M C/sigma^2 + diag(1/t^2))^-1 with M what the other columns leave, times n/N for the rows."""
    _, columns, terms = rows
    found = fit(columns, terms)
    x = columns.design(terms)
    rest = columns.target - x @ found.beta
    share = effective_samples(rest, columns.samples) / rest.size
    left = x[:, 3:] - x[:, :3] @ np.linalg.lstsq(x[:, :3], x[:, 3:], rcond=None)[0]
    precision = share * left.T @ left / np.mean(rest**2) + np.diag(1.0 / np.array(ERRORS.tolerances) ** 2)
    spread = spread_of_errors(columns, found)
    assert np.all(np.linalg.eigvalsh(spread) > -1e-12 * np.trace(spread))
    ratio = np.diag(spread)[3:] / np.diag(np.linalg.inv(precision))
    assert np.all(ratio > 0.999) and np.all(ratio < 2.5)  # never below it; the sandwich of few half seconds scatters


def test_an_estimate_within_three_deviations_is_expected(rows):
    made, columns, terms = rows
    context = replace(made.context, tolerances={"torque_sensor_bias": 0.2})
    bias = Term(effect("torque_sensor_bias"))
    found = fit(columns, [*terms, bias])
    known = frozenset({"viscous", "coulomb", "within_tolerance"})
    assert expected_errors(columns, found, known, context) == [bias]
    assert expected_errors(columns, found, known | {"torque_sensor_bias"}, context) == []  # declared
    narrow = replace(context, tolerances={"torque_sensor_bias": 0.01})
    assert expected_errors(columns, found, known, narrow) == []


def test_only_the_errors_that_concern_the_joint_are_part_of_its_model(rows):
    context = replace(
        rows[0].context, tolerances={"torque_sensor_bias": 0.2, "torque_sensor_gain": 0.01, "encoder_offset": 1e-3}
    )
    made = {
        load: errors_of(replace(context, load=load, drive="position_servo"))
        for load in ("torque", "pendulum", "robot", "links", "unknown")
    }
    ids = {load: [] if each is None else [m.id for m in each.members] for load, each in made.items()}
    assert ids["torque"] == ["torque_sensor_bias", "torque_sensor_gain", "encoder_offset"]
    assert ids["pendulum"] == ["encoder_offset"]
    assert ids["robot"] == ids["links"] == ids["unknown"] == []
    assert errors_of(replace(context, tolerances={})) is None
    efforts = replace(context, tolerances={"effort_bias": 0.2})
    acts = {load: errors_of(replace(efforts, load=load, drive="current")) is not None for load in made}
    assert acts == {"torque": True, "pendulum": True, "robot": True, "links": True, "unknown": False}
    assert errors_of(replace(efforts, load="pendulum", drive="position_servo")) is None
