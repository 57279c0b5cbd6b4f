"""What became of each effect: gains against refitted models, and the reason of each that was not added."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.estimates import estimates
from drake_tc.diagnosis.problem.regression import fit, predict
from drake_tc.diagnosis.result.outcome import found_effects, rejected_effects, stabilities
from drake_tc.diagnosis.selection.joint_problem import Search
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.effects.library import effect
from drake_tc.effects.obstacle import Obstacle

from ..rigs import Joint, floor_of, problem, record, rig_of

BIAS, QUADRATIC = Term(effect("torque_sensor_bias")), Term(effect("quadratic_viscous"))
RIG = Joint(duration=12.0, period=4e-3, torque_noise=0.25, extra=lambda m: 1.0 * m.v * np.abs(m.v) + 0.6)


@pytest.fixture(scope="module")
def made():
    p = problem(RIG, runs=2)
    other = build_samples([record(RIG, "held", 2.3, 9)], rig_of(RIG), "joint", p.samples.light.width_s)
    held = Columns(other).with_model(p.baseline.terms, p.baseline.beta, servo=False)
    return p, held


def test_gains_are_those_against_the_model_refitted_without_the_effect(made):
    p, held = made
    terms = [*p.declared, BIAS, QUADRATIC]
    chosen = fit(p.columns, terms)
    keys = {"torque_sensor_bias": 0.9, "quadratic_viscous": 1.0}
    found = found_effects(p.columns, held, chosen, p.declared, estimates(p.columns, chosen, p.context.drive), keys)
    assert {e.id for e in found} == set(keys)
    assert [e.heldout_gain for e in found] == sorted((e.heldout_gain for e in found), reverse=True)
    after = predict(held, chosen)
    for e in found:
        rest = predict(held, fit(p.columns, [t for t in terms if t.effect.key != e.key]))
        gain = 1.0 - np.sqrt(np.mean(after**2) / np.mean(rest**2))
        assert_allclose((e.heldout_gain, e.contribution), (gain, np.sqrt(np.mean((after - rest) ** 2))), rtol=1e-9)
        assert e.heldout_gain > 0.1
        assert e.stability == keys[e.key]


def test_stability_is_the_worst_against_sets_without_the_effect(made):
    p, _ = made
    chosen, only_bias = fit(p.columns, [*p.declared, BIAS, QUADRATIC]), fit(p.columns, [*p.declared, BIAS])
    found = stabilities(Search(p.baseline, chosen, (), (), (only_bias,)), 0)
    assert found["quadratic_viscous"] == 1.0
    assert found["torque_sensor_bias"] == 1.0  # against the declared model alone
    same = replace(chosen, terms=only_bias.terms, block_sse=0.9 * chosen.block_sse)
    tied = stabilities(Search(p.baseline, chosen, (), (), (same,)), 0)
    assert tied["quadratic_viscous"] == 0.0  # a set without it that is 5 % better in every block
    assert tied["torque_sensor_bias"] == 1.0


def test_what_was_not_added_has_its_reason(made):
    p, held = made
    chosen = fit(p.columns, [*p.declared, BIAS])
    found = rejected_effects(
        p.columns,
        held,
        chosen,
        p.context,
        JOINT,
        [("thermal_friction", Obstacle("not_recorded", "no temperature"))],
        floor_of(p),
    )
    by_id = {r.id: r for r in found}
    assert len(by_id) == len(found)
    assert not {"viscous", "coulomb", "torque_sensor_bias", "rotor_inertia"} & set(by_id)
    assert (by_id["thermal_friction"].reason, by_id["thermal_friction"].obstacle) == (
        "not_recorded",
        "no temperature",
    )
    assert by_id["quadratic_viscous"].reason == "not_chosen"  # it would have helped
    assert by_id["quadratic_viscous"].train_gain > JOINT.least_gain
    assert by_id["torque_sensor_drift"].reason == "too_little_gain"
    assert [r.train_gain for r in found] == sorted((r.train_gain for r in found), reverse=True)
    deep = rejected_effects(p.columns, held, chosen, p.context, JOINT, [], 100.0 * floor_of(p))
    assert {r.id: r.reason for r in deep}["quadratic_viscous"] == "below_floor"


@pytest.mark.parametrize(
    ("stricter", "reason"),
    [
        ({"least_gain": 0.99}, "too_little_gain"),
        ({"least_share": 1.01}, "unstable"),
        ({"least_log_evidence": 1e9}, "too_little_evidence"),
        ({"least_of_first": 1e3, "own_gain": 1.0}, "imperfect_form"),
    ],
)
def test_the_reason_is_the_condition_that_was_not_met(made, stricter, reason):
    p, held = made
    chosen, thresholds = fit(p.columns, [*p.declared, BIAS]), replace(JOINT, **stricter)
    found = rejected_effects(
        p.columns, held, chosen, p.context, thresholds, [], floor_of(p), (QUADRATIC.effect,), p.baseline
    )
    assert [(r.id, r.reason, r.least_gain) for r in found] == [("quadratic_viscous", reason, thresholds.least_gain)]


def test_an_effect_that_did_not_hold_is_not_said_to_be_small(made):
    p, held = made
    found = rejected_effects(
        p.columns, held, p.baseline, p.context, JOINT, [], floor_of(p), (QUADRATIC.effect,), None, {"quadratic_viscous"}
    )
    assert [(r.id, r.reason) for r in found] == [("quadratic_viscous", "withdrawn")]


@pytest.mark.parametrize(("factor", "reason"), [(1.05, "too_little_gain"), (1.2, "untested")])
def test_a_saturation_is_untested_where_held_out_runs_ask_for_more(made, factor, reason):
    p, held = made
    chosen = fit(p.columns, [*p.declared, BIAS, QUADRATIC])
    largest = [np.percentile(np.abs(c.samples.signals.effort[c.samples.rows]), 99.9) for c in (p.columns, held)]
    signals = held.samples.signals
    faster = replace(held.samples, signals=replace(signals, effort=signals.effort * factor * largest[0] / largest[1]))
    found = rejected_effects(p.columns, Columns(faster), chosen, p.context, JOINT, [], floor_of(p))
    assert {r.id: r.reason for r in found}["saturation"] == reason
