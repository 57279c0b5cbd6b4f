"""From which size on an effect would be found: closed forms, and a diagnosis that finds it there and not below."""

import math
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls

from drake_tc.analysis.executors import processes
from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.diagnose import candidates, diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.priors import NAMED, NAMED_FLOORS
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect, looked_for
from drake_tc.experiments.check.consistency import findings
from drake_tc.experiments.check.contributions import Contribution, ContributionBuilder
from drake_tc.experiments.check.joint import joint_effects, joint_numbers
from drake_tc.experiments.check.reasons import Evidence, sentence
from drake_tc.experiments.check.visibility import SEPARABLE_WITHIN, Noise, Visibility, confused_with, smallest_sizes
from drake_tc.experiments.sizes import Size, size_of
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import load_rig
from tests.benchmarks.evidence.predicted import compared, predictions, weakened_rigs
from tests.diagnosis.rigs import Joint, Motion, record, rig_of


def linear(values, span=None):
    values = np.asarray(values, dtype=float)
    rms = float(np.sqrt(np.mean(values**2)))
    own = values[:, None] if span is None else span
    return Contribution(effect("stribeck"), {}, np.ones(1), values[None, None], np.array([rms]), values, own)


def test_the_least_explained_torque_is_worth_the_evidence_and_half_a_floor():
    n, parameters = 50.0, 2
    r = Noise(floor=0.1, left=0.1, independent=n).least(parameters)
    evidence = n * math.log(math.hypot(0.1, r) / 0.1) - 0.5 * parameters * math.log(n)
    assert_allclose(evidence, NAMED, rtol=1e-9)
    assert r > NAMED_FLOORS * 0.1
    many = Noise(floor=0.1, left=0.1, independent=1e6).least(parameters)
    assert_allclose(many, NAMED_FLOORS * 0.1, rtol=1e-12)


def test_noise_moves_the_explained_torque_by_the_margin_in_five_of_a_hundred_logs():
    """Monte Carlo: the RMS that least squares gives a known column, with and against the noise."""
    rng, n, size = np.random.default_rng(5), 400, 0.2
    noise = Noise(floor=0.1, left=0.1, independent=float(n))
    column = rng.normal(size=n)
    column /= float(np.sqrt(np.mean(column**2)))
    explained = (size * column + rng.normal(scale=0.1, size=(20000, n))) @ column / n
    for sign in (-1.0, 1.0):
        share = float(np.mean(sign * (explained - size) > noise.margin))
        assert_allclose(share, 0.05, atol=3.0 * math.sqrt(0.05 * 0.95 / 20000))


def test_the_smallest_size_is_reached_for_certain_and_the_easiest_hardly_ever():
    own = [linear(np.ones(50))]
    assert_allclose(smallest_sizes(own, 0.3, falling=False, margin=0.05), (0.35, 0.25), rtol=1e-12)
    sizes = np.array([4.0, 2.0, 1.0])  # a limit: at 2 the remainder has an RMS of 0.5
    remainders = np.stack([np.full(50, 1.0 / size) for size in sizes])[:, None, :]
    limit = Contribution(effect("saturation"), {}, sizes, remainders, sizes, np.ones(50), remainders[:, 0].T)
    assert_allclose(smallest_sizes([limit], 0.5, falling=True, margin=0.1), (1.0 / 0.6, 1.0 / 0.4), rtol=1e-9)


def test_the_smallest_size_is_in_proportion_to_the_noise():
    rng = np.random.default_rng(1)
    values = rng.normal(size=400)
    own = [linear(values)]
    rms = float(np.sqrt(np.mean(values**2)))
    assert_allclose(smallest_sizes(own, 0.3, falling=False), (0.3 / rms, 0.3 / rms), rtol=1e-12)
    assert smallest_sizes([linear(np.zeros(400))], 0.3, falling=False) == (math.inf, math.inf)


def test_a_size_that_is_a_shape_is_found_between_two_of_its_grid():
    sizes = np.array([1e-3, 2e-3, 4e-3])
    unit = np.ones(50)
    remainders = np.stack([size * 100.0 * unit for size in sizes])[:, None, :]
    each = Contribution(effect("delay.loop"), {}, sizes, remainders, sizes, unit, remainders[:, 0].T)
    assert_allclose(smallest_sizes([each], 0.3, falling=False)[0], 3e-3, rtol=1e-9)


def test_a_remainder_is_what_no_change_of_the_declared_model_imitates(prepared):
    builder = ContributionBuilder(prepared, joint_numbers(prepared))
    values = np.random.default_rng(0).normal(size=(builder.rows, 2))
    left = builder.remainder(values)
    # orthogonal to every declared column, up to the rounding of a QR decomposition
    assert_allclose(builder.design.T @ left, 0.0, atol=1e-9 * builder.rows)
    expected = values - builder.design @ np.linalg.lstsq(builder.design, values, rcond=None)[0]
    assert_allclose(left, expected, atol=1e-9)


def test_an_effect_explains_itself_and_keeps_its_sign():
    target = np.random.default_rng(2).normal(size=300)
    assert linear(target).left_by(linear(target), 1.0)[0] < 1e-12
    rms = float(np.sqrt(np.mean(target**2)))
    opposite = replace(linear(-target), effect=effect("load_dependent_friction"))  # whose coefficient is not negative
    assert_allclose(linear(target).left_by(opposite, 1.0), rms, rtol=1e-12)


def test_what_an_effect_leaves_is_that_of_least_squares_at_every_size():
    rng = np.random.default_rng(7)
    own = replace(linear(np.zeros(200)), remainders=rng.normal(size=(1, 3, 200)))
    span = rng.normal(size=(200, 3))
    span[:, 2] = span[:, 0] - 2.0 * span[:, 1]  # two directions only
    several = linear(span[:, 0], span)
    column = own.remainders[0, 1] - 0.3
    bounded = replace(linear(column), effect=effect("load_dependent_friction"))
    for size in (0.2, 1.0, 7.0, 0.2):
        targets = size * own.remainders[0]
        free = span @ np.linalg.lstsq(span, targets.T, rcond=1e-12)[0]
        assert_allclose(own.left_by(several, size), np.sqrt(np.mean((targets - free.T) ** 2, axis=1)), rtol=1e-9)
        left = [float(nnls(column[:, None], target)[1]) / np.sqrt(200.0) for target in targets]
        assert_allclose(own.left_by(bounded, size), left, rtol=1e-9)


def test_a_drive_effect_is_left_between_half_and_twice_a_size_of_its_grid():
    rng = np.random.default_rng(8)
    grid = rng.normal(size=(200, 4))
    sizes = np.array([1e-3, 2e-3, 4e-3, 8e-3])
    drive = Contribution(effect("delay.loop"), {}, sizes, grid.T[:, None], sizes, grid[:, 0], grid)
    for size, near in ((1.7, 1.7), (0.1, 0.5), (5.0, 2.0)):
        own = linear(size * grid[:, 2])
        expected = abs(size - near) * np.sqrt(np.mean(grid[:, 2] ** 2))
        assert_allclose(own.left_by(drive, 1.0), expected, rtol=1e-9, atol=1e-12)
    # a size of the grid itself, and one between: the nearest stands for it, whatever was asked before
    for size, index in ((4e-3, 2), (1.2e-3, 0), (4.1e-3, 2)):
        expected = np.sqrt(
            np.mean((grid[:, index] - grid[:, 1] * (grid[:, index] @ grid[:, 1]) / (grid[:, 1] @ grid[:, 1])) ** 2)
        )
        free = replace(linear(grid[:, 1]), span=np.stack([grid[:, 1], grid[:, 1]], axis=1))
        assert_allclose(drive.left_by(free, size), expected, rtol=1e-9)


SENSED = Joint(duration=12.0, period=4e-3, torque_noise=0.25, encoder_step=1e-5)
EFFECTS: Mapping[str, Callable[[Motion], np.ndarray]] = {
    "load_dependent_friction": lambda m: np.abs(m.tau) * np.sign(m.v),
    "torque_ripple": lambda m: np.cos(18.0 * m.q),
    "cable_spring": lambda m: m.q,
}
"""Torque of size 1."""
LOOKED_FOR = tuple(
    map(effect, (*EFFECTS, "payload", "stribeck", "quadratic_viscous", "torque_sensor_gain", "delay.loop"))
)


def recorded(joint: Joint) -> list[Run]:
    return [record(joint, name, 0.9 * k, k) for k, name in enumerate(("one", "two", "held"))]


@pytest.mark.parametrize("key", EFFECTS)
def test_a_diagnosis_finds_an_effect_above_its_smallest_size_and_not_far_below_its_easiest(key):
    runs = recorded(SENSED)
    found = joint_effects(prepare_joint(runs[:2], runs[2:], rig_of(SENSED), "joint"))
    told = next(each for each in found.effects if each.key == key)

    def named(size: float) -> set[str]:
        acting = recorded(replace(SENSED, extra=lambda m: size * EFFECTS[key](m)))
        options = DiagnosisOptions(effects=LOOKED_FOR, assess_residual=False)
        return {each.id for each in diagnose_joint(acting[:2], acting[2:], rig_of(SENSED), "joint", options).effects}

    assert named(2.0 * told.smallest) & {key, *told.not_separable_from}
    assert not named(0.3 * told.easiest)


def test_each_effect_has_a_status_and_what_is_hidden_has_a_reason(prepared):
    found = joint_effects(prepared)
    assert {each.key for each in found.effects} >= {"stribeck", "backlash", "thermal_friction", "delay.command"}
    for each in found.effects:
        assert each.status in ("seen", "weakly", "not_seen", "not_separable")
        assert bool(each.reason) == (each.status in ("weakly", "not_seen")), each
        assert bool(each.not_separable_from) == (each.status == "not_separable")
    warm = next(each for each in found.effects if each.key == "thermal_friction")
    assert warm.status == "not_seen" and "temperature not recorded" in warm.reason
    bias = next(each for each in found.effects if each.key == "asymmetric_friction.coulomb")
    assert "torque_sensor_bias" in bias.not_separable_from


def test_a_size_that_is_found_may_be_too_small_to_be_separated(prepared):
    """Just below the stated size the effect is confused with those that are named, and at it with none."""
    found = joint_effects(prepared)
    numbers, builder = joint_numbers(prepared), ContributionBuilder(prepared, joint_numbers(prepared))
    usable, _ = candidates(looked_for(prepared.context), prepared.context, prepared.declared)
    made = {e.key: builder.of(e, size_of(e, numbers, prepared.context)) for e in usable}
    told = [each for each in found.effects if each.separable is not None]
    assert told
    for each in told:
        assert each.smallest < each.separable <= max(each.size.typical, 4.0 * each.smallest)
        assert not confused_with(made[each.key], made, each.separable, found.noise)
        assert confused_with(made[each.key], made, each.separable / SEPARABLE_WITHIN, found.noise)
        if not each.reason:
            assert each.why.startswith("below") and each.confused_below[0] in each.why


def test_a_wrong_drive_gain_is_not_hidden_by_a_gain_that_is_declared(demo):
    """Where it is declared, no fit changes it: its error is seen, and is not taken for noise of the balance."""
    rig = load_rig(demo[0])
    runs, joint = load_runs(demo[1], rig), rig.joints[0]
    free = prepare_joint(runs, [], rig, joint)
    gain = fit(free.train, free.terms).gain
    wrong = prepare_joint(runs, [], replace(rig, drive_gain={joint: 1.3 * gain}), joint)
    found = joint_effects(wrong)
    assert next(each for each in found.effects if each.key == "servo_gain").status in ("seen", "not_separable")
    assert_allclose(found.noise.left, joint_effects(free).noise.left, rtol=0.3)


def test_predictions_compare_the_true_size_with_both_stated_sizes():
    size = Size("mu", "-", 0.1)
    seen = Visibility("a", "a", "a", "seen", size, 0.2, 0.1)
    assert [compared([seen], x)[2] for x in (0.3, 0.15, 0.05)] == ["seen", "between", "not_seen"]
    limit = Visibility("a", "a", "a", "seen", Size("limit", "A", 1.0, falling=True), 4.0, 5.0)
    assert [compared([limit], x)[2] for x in (3.0, 4.5, 6.0)] == ["seen", "between", "not_seen"]
    assert compared([], 1.0)[2] == "not_seen"


def test_the_effects_of_blind_rigs_are_as_weak_as_asked_for():
    middle, weak = (weakened_rigs(("stribeck",), 7, (strength,)) for strength in (1.0, 0.01))
    assert [rig.name for rig in (*middle, *weak)] == ["stribeck_1", "stribeck_0.01"]
    assert weak[0].targets["stribeck"] == pytest.approx(0.01 * middle[0].targets["stribeck"])
    assert weak[0].joint == middle[0].joint


@pytest.mark.slow
def test_what_is_predicted_to_be_seen_is_found_on_blind_rigs(tmp_path):
    """A small version of `python -m tests.benchmarks check`: two effects at three strengths each."""
    with processes(2) as pool:
        found = predictions(tmp_path, ("load_dependent_friction", "cable_spring"), 5, pool, lambda text, share: None)
    assert len(found) == 6
    assert all(each.found for each in found if each.predicted == "seen"), found
    assert not any(each.found for each in found if each.predicted == "not_seen"), found


def test_the_rounding_error_of_an_exact_identity_gives_no_size():
    exact = replace(linear(1e-12 * np.ones(100)), whole=np.ones(1))
    small = replace(linear(1e-4 * np.ones(100)), whole=np.ones(1))
    assert smallest_sizes([exact], 0.1, falling=False) == (math.inf, math.inf)
    assert_allclose(smallest_sizes([small], 0.1, falling=False), 1e3, rtol=1e-12)  # exact up to rounding


def test_torques_of_unknown_scale_are_stated_in_the_unit_of_the_effort(prepared):
    train = copy(prepared.train)
    train.samples = replace(
        prepared.train.samples, units=JointUnits("revolute", "position_servo", torque_as_effort=True)
    )
    told = joint_effects(replace(prepared, train=train))
    assert not [each.key for each in told.effects if "N*m" in each.size.unit + each.reason]
    declared = next(
        f
        for f in findings(replace(prepared, train=train), fit(train, prepared.terms), told.numbers)
        if f.name == "declared model"
    )
    assert "drive gain of" not in declared.text and "declare drive_gain" in declared.text


def test_a_reason_agrees_with_the_number_of_terms_that_explain_the_effect(prepared):
    facts, size = joint_effects(prepared).facts, Size("bias", "N*m", 1.0)
    one, two = (
        sentence("payload.own_arm", Evidence(facts, size, 0.0, names, 0.0, 1.0)) for names in (["A"], ["A", "B"])
    )
    assert one == "At these motions A explains all of what it does."
    assert two == "At these motions A and B together explain all of what it does."
