"""Declared tolerances of a joint's sensors: sizes within them are not found, larger ones are, and the check says so."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.cli.demo import ROTOR_INERTIA
from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.problem.sensor_errors import errors_in
from drake_tc.diagnosis.selection.joint import search
from drake_tc.diagnosis.selection.joint_problem import candidates
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.effects.library import looked_for
from drake_tc.experiments.check.joint import joint_effects
from drake_tc.experiments.check.tolerable import TolerableErrors
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig, parse_rig

BIAS = 0.5  # [N m]: tolerance


def test_one_error_takes_off_its_limit_and_no_more():
    c = np.array([3.0, -4.0, 0.0])
    errors = TolerableErrors(c[:, None] / 5.0, np.array([2.0]))
    assert_allclose(errors.free_up_to(c), 0.4)  # 0.4 * |c| = 2
    expected = np.outer(np.maximum(np.array([0.2, 0.4, 1.0]) - 0.4, 0.0), c)
    assert_allclose(errors.remainders(c, np.array([0.2, 0.4, 1.0])), expected, atol=1e-12)


def test_the_remainder_is_the_least_that_any_errors_within_limits_leave():
    """Optimality: the residual's slope along an error is 0 within its limits, and points outwards at a limit."""
    rng = np.random.default_rng(4)
    columns, limits = rng.normal(size=(60, 3)), np.array([0.3, 1.0, 0.1])
    c = columns @ np.array([1.0, -0.4, 0.8]) + 0.3 * rng.normal(size=60)
    errors = TolerableErrors(columns, limits)
    sizes = errors.free_up_to(c) * np.array([0.5, 1.0, 3.0, 30.0])
    limited = set()
    for size, left in zip(sizes, errors.remainders(c, sizes), strict=True):
        b = np.linalg.lstsq(columns, size * c - left, rcond=None)[0]
        assert_allclose(columns @ b, size * c - left, atol=1e-9)
        assert np.all(np.abs(b) <= limits * (1.0 + 1e-9))
        slope = columns.T @ left
        at = np.abs(b) >= limits * (1.0 - 1e-9)
        assert np.all(np.abs(slope[~at]) < 1e-7)
        assert np.all(slope[at] * np.sign(b[at]) >= -1e-7)
        limited.add(int(at.sum()))
    assert {0, 3} < limited  # from none to all of them


def test_what_the_errors_hardly_imitate_has_no_limit():
    columns = np.array([[1.0], [0.0], [0.0]])
    assert TolerableErrors(columns, np.ones(1)).free_up_to(np.array([0.1, 1.0, 0.0])) == 0.0
    assert TolerableErrors(columns, np.ones(1)).free_up_to(np.zeros(3)) == 0.0


def with_tolerance(demo, bias: float):
    rig = load_rig(demo[0])
    content = {"joint": rig.joints[0], "drive": "position_servo", "declared": {"rotor_inertia": ROTOR_INERTIA}}
    allowed = parse_rig(content | {"sensors": {"torque": {"bias": f"{bias} N*m"}}})
    return prepare_joint(load_runs(demo[1], allowed), [], allowed, rig.joints[0])


def visible(prepared, key: str = "torque_sensor_bias"):
    return next(v for v in joint_effects(prepared).effects if v.key == key)


@pytest.fixture(scope="module")
def tolerant(demo):
    return with_tolerance(demo, BIAS)


def test_sizes_count_from_the_largest_error_that_is_tolerated(prepared, tolerant):
    assert errors_in(tolerant.terms) is not None
    plain, allowed = visible(prepared), visible(tolerant)
    assert_allclose(allowed.smallest - plain.smallest, 3.0 * BIAS, rtol=0.05)
    assert_allclose(allowed.easiest - plain.easiest, 3.0 * BIAS, rtol=0.05)


def test_the_reason_is_the_tolerance_where_that_hides_the_effect(demo):
    found = visible(with_tolerance(demo, 50.0))
    assert found.status == "not_seen"
    assert found.reason == "Sizes up to 1.5e+02 N*m may be errors of the joint's sensors within their tolerances."


def test_a_search_finds_a_bias_beyond_the_stated_size_and_none_within_the_tolerance(tolerant):
    """The balance of the demo's rows with white noise as large as its floor, and a bias of the torque sensor."""
    columns, context = tolerant.train, tolerant.context
    floor = tolerant.floor / columns.gain
    declared = [t for t in tolerant.terms if errors_in([t]) is None]
    clean = columns.design(declared) @ fit(columns, declared).beta
    noise = np.random.default_rng(3).normal(scale=floor, size=columns.target.size)
    smallest = visible(tolerant).smallest
    usable, _ = candidates(looked_for(context), context, tolerant.declared)
    same = {"torque_sensor_bias", "effort_bias", "asymmetric_friction"}  # one function of such a joint

    def named(size: float) -> set[str]:
        target = clean - size + noise
        made = Columns(columns.samples, columns.gain, columns.floor, target, columns.declared_gain)
        found = search(made, tolerant.terms, usable, context, tolerant.floor, JOINT)
        return {t.effect.id for t in found.chosen.terms} - {t.effect.id for t in tolerant.terms}

    assert named(1.2 * smallest) & same
    assert not named(2.5 * BIAS) & same
