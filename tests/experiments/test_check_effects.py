"""From which size on an effect would be found: closed forms, and a diagnosis that finds it there and not below."""

import math
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import ncx2

from drake_tc.analysis.sweep import processes
from drake_tc.config.joint_units import JointUnits
from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.priors import ALTERNATIVE
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect
from drake_tc.experiments import log_odds
from drake_tc.experiments.check.consistency import findings
from drake_tc.experiments.check.effects import SEPARABLE_WITHIN, Visibility, joint_effects
from drake_tc.experiments.check.reasons import why_hidden
from drake_tc.experiments.effect_columns import Variant
from drake_tc.experiments.log_odds import EffectOdds
from drake_tc.experiments.sizes import Size
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import load_rig
from tests.benchmarks.evidence.predicted import compared, predictions, weakened_rigs
from tests.diagnosis.rigs import Joint, Motion, record, rig_of


@pytest.fixture(scope="session")
def odds(checked) -> EffectOdds:
    return EffectOdds(checked.fitted, checked.fitted.usable)


def expected_odds(odds: EffectOdds, variant: Variant, size: float) -> float:
    """Of the effect beside the set without it, noise left out."""
    return 0.5 * odds.information(variant, size) - odds.occam(variant, size)


@pytest.mark.parametrize("key", ["quadratic_viscous", "load_dependent_friction", "torque_sensor_drift"])
def test_the_information_about_a_size_is_that_of_the_posterior_with_the_effect(odds, key):
    """The marginal variance of a coefficient is the inverse of its information beside the others, plus its prior's."""
    fitted, (variant,) = odds.fitted, odds.variants[key]
    scored = fitted.evidence.score([*fitted.best.terms, variant.term], fitted.best.posterior.variance)
    at = scored.coefficients - 1
    prior = float(variant.prior.prior.deviation[0])
    expected = (1.0 / scored.posterior.covariance[at, at] - prior**-2) * fitted.gain**2
    found = odds.beside(variant.term.effect).information(*variant.at(1.0))
    assert_allclose(found, expected, rtol=1e-3)  # two ways to invert matrices of many scales


@pytest.mark.parametrize("key", ["quadratic_viscous", "load_dependent_friction"])
def test_the_expected_log_odds_are_those_that_a_diagnosis_computes(odds, key):
    """Of the same rows with the effect's own contribution added to the effort, noise as recorded."""
    fitted, (variant,) = odds.fitted, odds.variants[key]
    size = 2.0 * odds.found_from(key)[0]
    evidence, model = fitted.evidence, fitted.evidence.model
    change = (model.train.of(variant.term) @ (size * variant.unit))[:, None]
    white = model.train.rows.whitened(change, evidence.noise)[0][:, 0]
    variance, scores = fitted.best.posterior.variance, []
    held = evidence.target(model.train, fitted.best.terms)
    for terms in ([*fitted.best.terms, variant.term], list(fitted.best.terms)):
        key_of_target = next(k for k, v in evidence._whitened.items() if v.base is held or np.shares_memory(v, held))
        kept = evidence._whitened[key_of_target]
        evidence._whitened[key_of_target] = (held + white)[:, None]
        scores.append(evidence.score(terms, variance).log_odds)
        evidence._whitened[key_of_target] = kept
    expected, spread = expected_odds(odds, variant, size), math.sqrt(2.0 * expected_odds(odds, variant, size))
    assert abs(scores[0] - scores[1] - expected) < 3.0 * spread


def test_what_is_found_for_certain_has_clear_expected_odds(odds):
    for key, variants in odds.variants.items():
        smallest, easiest = odds.found_from(key)
        if len(variants) == 1 and not variants[0].by_shape and math.isfinite(smallest):
            assert easiest < smallest
            assert expected_odds(odds, variants[0], smallest) > ALTERNATIVE


def test_the_stated_sizes_are_found_in_95_and_in_5_percent_of_such_logs(odds, monkeypatch):
    """Twice the log odds and O are noncentral chi-squared; without the floor below which nothing is named."""
    monkeypatch.setattr(log_odds, "NAMED_FLOORS", 0.0)
    alone = {key: variants[0] for key, variants in odds.variants.items() if len(variants) == 1}
    plain = {key: variant for key, variant in alone.items() if not variant.by_shape and variant.freedom == 1}
    assert len(plain) >= 3
    for key, variant in plain.items():
        for size, share in zip(odds.found_from(key), (0.95, 0.05), strict=True):
            occam = odds.occam(variant, size)
            strength = odds.information(variant, size)
            found = ncx2.sf(2.0 * (ALTERNATIVE + occam), 1, strength)
            assert found == pytest.approx(share, abs=2e-3), key  # of two signs, the other is that improbable


SENSED = Joint(duration=8.0, period=4e-3, torque_noise=0.25, encoder_step=1e-5)
EFFECTS: Mapping[str, Callable[[Motion], np.ndarray]] = {
    "load_dependent_friction": lambda m: np.abs(m.tau) * np.sign(m.v),
    "torque_ripple": lambda m: np.cos(18.0 * m.q),
    "cable_spring": lambda m: m.q,
}
"""Torque of size 1."""
NEAR = ("payload", "stribeck", "quadratic_viscous", "torque_sensor_gain")
SCALES = tuple(map(effect, ("servo_gain", "torque_sensor_bias", "stribeck", "deadzone")))
"""The error of a declared gain, one of a sensor, and what the demo's joint lacks."""


def recorded(joint: Joint) -> list[Run]:
    return [record(joint, name, 0.9 * k, k) for k, name in enumerate(("one", "two", "held"))]


@pytest.mark.slow
@pytest.mark.parametrize("key", EFFECTS)
def test_a_diagnosis_finds_an_effect_above_its_smallest_size_and_not_far_below_its_easiest(key):
    runs, near = recorded(SENSED), tuple(map(effect, (key, *NEAR)))
    found = joint_effects(prepare_joint(runs[:2], runs[2:], rig_of(SENSED), "joint"), near)
    told = next(each for each in found.effects if each.key == key)

    def named(size: float) -> set[str]:
        acting = recorded(replace(SENSED, extra=lambda m: size * EFFECTS[key](m)))
        options = DiagnosisOptions(effects=near, assess_residual=False)
        return {each.id for each in diagnose_joint(acting[:2], acting[2:], rig_of(SENSED), "joint", options).effects}

    assert named(2.0 * max(told.smallest, told.separable or 0.0)) & {key, *told.not_separable_from}
    assert not named(0.3 * told.easiest)


def test_each_effect_has_a_status_and_what_is_hidden_has_a_reason(checked):
    found = checked
    assert {each.key for each in found.effects} >= {"stribeck", "backlash", "thermal_friction", "delay.command"}
    for each in found.effects:
        assert each.status in ("seen", "weakly", "not_seen", "not_separable")
        assert bool(each.reason) == (each.status in ("weakly", "not_seen")), each
        assert bool(each.not_separable_from) == (each.status == "not_separable")
    warm = next(each for each in found.effects if each.key == "thermal_friction")
    assert warm.status == "not_seen" and "temperature not recorded" in warm.reason
    bias = next(each for each in found.effects if each.key == "asymmetric_friction.coulomb")
    assert "torque_sensor_bias" in bias.not_separable_from


def test_a_size_that_is_found_may_be_too_small_to_be_separated(checked):
    """Just below the stated size the effect is confused with those that are named, and at it with none."""
    usable = {e.key: e for e in checked.fitted.usable}
    listed = [usable[each.key] for each in checked.effects if each.key in usable]
    odds, told = EffectOdds(checked.fitted, listed), [each for each in checked.effects if each.separable is not None]
    assert told
    for each in told:
        assert each.smallest < each.separable <= max(each.size.typical, 4.0 * each.smallest)
        assert not odds.confused_with(usable[each.key], each.separable)
        assert odds.confused_with(usable[each.key], each.separable / SEPARABLE_WITHIN)
        if not each.reason:
            assert each.why.startswith("below") and each.confused_below[0] in each.why


def test_a_wrong_drive_gain_is_not_hidden_by_a_gain_that_is_declared(demo, prepared, checked):
    """Where it is declared, no fit changes it: its error is seen, and is not taken for noise of the balance."""
    rig = load_rig(demo[0])
    runs, joint = load_runs(demo[1], rig), rig.joints[0]
    gain = fit(prepared.train, prepared.terms).gain
    wrong = prepare_joint(runs, [], replace(rig, drive_gain={joint: 1.3 * gain}), joint)
    found = joint_effects(wrong, SCALES)
    assert next(each for each in found.effects if each.key == "servo_gain").status in ("seen", "not_separable")
    assert_allclose(found.fitted.balance.left, checked.fitted.balance.left, rtol=0.3)


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


def test_torques_of_unknown_scale_are_stated_in_the_unit_of_the_effort(prepared):
    train = copy(prepared.train)
    train.samples = replace(
        prepared.train.samples, units=JointUnits("revolute", "position_servo", torque_as_effort=True)
    )
    told = joint_effects(replace(prepared, train=train), SCALES)
    assert not [each.key for each in told.effects if "N*m" in each.size.unit + each.reason]
    declared = next(f for f in findings(told.fitted) if f.name == "declared model")
    assert "drive gain of" not in declared.text and "declare drive_gain" in declared.text


def test_a_reason_agrees_with_the_number_of_terms_that_explain_the_effect(checked):
    member = effect("asymmetric_friction")

    def told(*imitators: str) -> str:
        odds = SimpleNamespace(
            sizes={member.key: Size("bias", "N*m", 1.0)}, middle=lambda _: None, imitators=lambda *_: list(imitators)
        )
        return why_hidden(member, odds, checked.facts, math.inf, 0.0)

    assert told("A") == "In these motions, A imitates all of its contribution."
    assert told("A", "B") == "In these motions, A and B together imitate all of its contribution."
