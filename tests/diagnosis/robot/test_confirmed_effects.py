"""A diagnosis that is repeated among the confirmed effects keeps what the first one told of all others."""

from dataclasses import fields
from types import SimpleNamespace

from drake_tc.diagnosis.result.experiments import CheckLoad, RepeatUnchanged
from drake_tc.diagnosis.result.joint_result import FoundEffect, JointResult, RejectedEffect
from drake_tc.diagnosis.robot.confirmed_effects import confirmed_effects, with_first
from drake_tc.diagnosis.selection.withdrawal import DidNotHold, ImpossibleValues, LargerOnHeldOut, NotFoundAgain
from drake_tc.effects.library import effect


def found(key):
    return FoundEffect(key, effect(key).id, key, {}, heldout_gain=0.1, stability=1.0, contribution=1.0)


def result(keys, **changes):
    terms = [SimpleNamespace(effect=effect(key)) for key in ("viscous", *keys)]
    empty = {each.name: () for each in fields(JointResult)}
    given = {"final": SimpleNamespace(terms=terms), "effects": tuple(map(found, keys)), "next_experiment": None}
    return JointResult(**(empty | given | changes))


def test_candidates_are_the_effects_that_were_confirmed():
    assert [each.id for each in confirmed_effects(result(["stribeck", "deadzone"]))] == ["stribeck", "deadzone"]
    assert confirmed_effects(result([])) == ()


def test_what_only_the_first_diagnosis_tried_is_kept():
    rejected = (RejectedEffect("delay", "delay", 0.0, 0.0, "too_little_gain"),)
    spring = DidNotHold("cable_spring", "cable_spring", "spring", ImpossibleValues("It is negative."))
    pairs = (("stribeck", "deadzone"), ("deadzone", "stribeck"))
    first = result(
        ["stribeck", "deadzone"],
        rejected=rejected,
        did_not_hold=(spring,),
        indistinguishable=pairs,
        next_experiment=CheckLoad(measured=False),
    )
    again = with_first(first, result(["stribeck"], next_experiment=RepeatUnchanged()))
    assert [each.id for each in again.effects] == ["stribeck"]
    assert again.rejected == rejected
    assert again.did_not_hold == (spring, DidNotHold("deadzone", "deadzone", "deadzone", NotFoundAgain(), 0.1))
    assert again.indistinguishable == (("stribeck", "deadzone"),)
    assert again.next_experiment == RepeatUnchanged()  # the one of the first asked for a pair that is gone
    assert with_first(first, result(["stribeck", "deadzone"])).next_experiment == CheckLoad(measured=False)


def test_an_effect_that_the_repeated_diagnosis_withdraws_has_its_own_reason():
    first = result(["stribeck"])
    against = DidNotHold("stribeck", "stribeck", "Stribeck", LargerOnHeldOut("run_3", 0.1))
    assert with_first(first, result([], did_not_hold=(against,))).did_not_hold == (against,)
