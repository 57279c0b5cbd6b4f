"""What the report says in words: for each verdict, for what is left, and what must not be overlooked."""

from dataclasses import replace
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_tc.diagnosis.priors import ALTERNATIVE
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.residual.unexplained import SEVERITY, BeyondTraining, SharedBand, TimeStretch, Unexplained
from drake_tc.diagnosis.result.joint_result import Errors, JointResult, RejectedEffect, Withdrawal
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SharedEffect
from drake_tc.report.notes import warnings
from drake_tc.report.tables import rejected_rows
from drake_tc.report.words import (
    REASONS,
    VERDICTS,
    band_sentence,
    dependence_words,
    headline,
    joined,
    natural,
    ranked_effects,
    structure_words,
    title_of,
    unexplained,
    why_rejected,
)

QUIET = Unexplained(1.0, 1.2, False, 0.1, 0.0, False, ())


def plain(text: str) -> str:
    """With ordinary spaces."""
    return text.replace("\u00a0", " ")


def with_errors(joint: JointResult, before: float, after: float, floor: float) -> JointResult:
    return replace(joint, before=Errors(1.0, before, None), after=Errors(1.0, after, None), noise_floor=floor)


def test_a_model_without_a_band_is_not_said_to_explain_the_whole_band(joint):
    nan = float("nan")
    said = [
        plain(band_sentence(replace(joint, shared_band=band)))
        for band in (None, SharedBand(0.0, nan, nan), SharedBand(4.0, 0.002, 0.002))
    ]
    assert said[0] == "the whole band of the filters"
    assert said[1].startswith("none: the model explains less than half")
    assert said[2].startswith("up to 4.00 Hz, where 2.00 mA (")


@pytest.mark.parametrize(
    ("words", "phrase"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_words_are_joined(words, phrase):
    assert joined(words) == phrase


def test_what_was_lacking_and_what_it_did(joint):
    two = with_errors(joint, 0.02, 0.004, 0.002)
    titles = [e.title for e in joint.effects]
    said = plain(headline(two))
    assert said == (
        f"Missing in the model: {titles[0]} and {titles[1]}. With them, the held-out error goes from 20.0 mA to "
        "4.00 mA (5.0 times smaller), 2.00 times the noise floor."
    )
    one = plain(headline(replace(two, effects=two.effects[:1])))
    assert one.startswith(f"Missing in the model: {titles[0]}. With it, the held-out error")


def test_an_error_that_grew_is_said_to_be_larger(joint):
    assert "(2.0 times larger), 4.00 times the noise floor" in plain(headline(with_errors(joint, 0.004, 0.008, 0.002)))


def test_nothing_is_missing(joint):
    none = replace(with_errors(joint, 0.004, 0.004, 0.002), effects=(), verdict="no_missing_effect")
    assert plain(headline(none)) == (
        "The declared model explains the data: its held-out error of 4.00 mA is 2.00 times the noise floor."
    )


def test_a_floor_of_nothing_has_its_reason(joint):
    none = replace(with_errors(joint, 0.004, 0.004, 0.0), effects=(), verdict="no_missing_effect")
    assert plain(headline(none)).endswith(
        "is 4.00 mA. There is no noise floor, because the logs show neither noise nor steps of the sensors."
    )


@pytest.mark.parametrize("found", [False, True])
def test_more_than_noise_says_how_many_floors_and_which_share(joint, found):
    left = replace(QUIET, floors=40.8, floors_anywhere=52.0, excess=True, share_of_signal=0.123)
    loud = replace(with_errors(joint, 0.2, 0.0816, 0.002), unexplained=left, verdict="unexplained_residual")
    said = plain(headline(loud if found else replace(loud, effects=())))
    assert (
        "the remaining error on the held-out runs is 41 times the noise floor (52 times on the training runs)"
        in said.replace("The remaining", "the remaining")
    )
    assert "12 % of the effort's RMS. It does not depend on the recorded signals" in said
    assert said.startswith("Missing in the model: " if found else "No effect of the library was added")
    assert ("However, the remaining error" in said) == found
    assert (" The remaining error" in said) != found
    assert said.endswith("sensor.")
    predicted = replace(loud, unexplained=replace(left, fraction=0.93))
    assert "does not depend" not in headline(predicted)
    assert "Recorded signals predict 93 % of its variance, but" in plain(headline(predicted))
    assert ".." not in said


def test_beside_fitted_links_a_wrong_drive_gain_is_a_possible_cause(joint):
    """The links take up most of a wrong gain, `servo_gain` cannot be looked for, and other joints show the rest."""
    left = replace(QUIET, floors=5.1, excess=True, share_of_signal=0.019)
    alone = replace(with_errors(joint, 0.2, 0.0816, 0.002), unexplained=left, verdict="unexplained_residual")
    assert "drive gain" not in unexplained(alone)
    said = unexplained(replace(alone, links_fitted=True))
    assert "not depend on the recorded signals of this joint" in said
    assert "a wrong drive gain of this or another joint" in said
    assert "a load in some of the runs that the rig file does not declare" in said


def test_a_held_out_run_under_other_conditions_is_named_first(joint):
    """A load that the arm carries in the held-out run alone, for example."""
    left = replace(QUIET, structured=True, floors=80.0, fraction=0.3, depends_on=("position",))
    made = replace(joint, unexplained=left, after=Errors(0.014, 1.12, None))
    growth = "80 times as large on the held-out runs as on the training runs"
    said = unexplained(made)
    assert said.startswith(f"the remaining error is {growth}")
    assert "with another load. 30 % of the remaining error can be predicted from position" in plain(said)
    assert growth not in unexplained(replace(made, after=Errors(0.014, 0.03, None)))


def test_play_and_elasticity_of_a_gear_that_the_drive_does_not_show_are_possible_causes(joint):
    left = replace(QUIET, floors=5.1, excess=True, share_of_signal=0.019)
    alone = replace(with_errors(joint, 0.2, 0.0816, 0.002), unexplained=left, verdict="unexplained_residual")
    hidden = tuple(
        RejectedEffect(name, name, "cannot_be_looked_for", "needs a position servo")
        for name in ("backlash", "elasticity")
    )
    tried = replace(alone, rejected=(replace(hidden[0], reason="too_little_evidence"), hidden[1]))
    assert "Backlash and elasticity of the gear are possible causes too" in unexplained(replace(alone, rejected=hidden))
    assert "Backlash" not in unexplained(tried)


@pytest.mark.parametrize("verdict", ["unexplained_residual", "unexplained_structure"])
def test_effects_that_leave_most_of_the_error_are_not_called_missing(joint, verdict):
    left = replace(QUIET, floors=40.0, excess=True, structured=verdict.endswith("structure"), share_of_signal=0.12)
    most = replace(with_errors(joint, 0.1, 0.08, 0.002), unexplained=left, verdict=verdict)
    titles = [e.title for e in joint.effects]
    assert plain(headline(most)).startswith(
        f"The cause of most of the error was not found. Of the effects in the library, {titles[0]} and {titles[1]} fit "
        "best: with them, the held-out error goes from 100 mA to 80.0 mA (1.2 times smaller)"
    )
    assert plain(headline(most)).count("times the noise floor") == 1
    assert f"{titles[0]} fits best: with it," in plain(headline(replace(most, effects=most.effects[:1])))
    assert any("80 % of the held-out error is left" in plain(each) for each in warnings(most))
    less = replace(most, before=Errors(1.0, 0.2, None))
    assert plain(headline(less)).startswith("Missing in the model: ")
    assert not any("is left" in plain(each) for each in warnings(less))


@pytest.mark.parametrize("found", [False, True])
def test_structure_says_on_what_it_depends(joint, found):
    left = replace(QUIET, structured=True, excess=True, fraction=0.7, depends_on=("velocity", "expected_torque"))
    made = replace(joint, unexplained=left, verdict="unexplained_structure")
    said = plain(headline(made if found else replace(made, effects=())))
    assert "70 % of the remaining error can be predicted from velocity and load torque expected by the model" in said
    assert ("However, 70 %" in said) == found
    assert "an unrecorded disturbance" not in said


def test_structure_that_an_effect_not_added_would_explain_names_that_effect(joint):
    """Friction that warms up, too small in the training runs to be added, is most of the held-out error."""
    left = replace(QUIET, structured=True, fraction=0.93, depends_on=("velocity", "temperature"))
    tried = (
        RejectedEffect("thermal_friction", "thermal_friction", "too_little_evidence", "", 2.0, 0.86),
        RejectedEffect("stribeck", "stribeck", "too_little_evidence", "", -4.0, 0.02),
    )
    said = plain(unexplained(replace(joint, unexplained=left, rejected=tried)))
    assert said.endswith("temperature-dependent friction would lower the held-out error most (by 86 %).")
    said = plain(unexplained(replace(joint, unexplained=left, rejected=tried[1:])))
    assert said.endswith("and no effect that could be looked for has this form.")


def test_structure_that_nothing_explains_names_what_the_logs_cannot_show(joint):
    """The gear of a joint without a torque sensor and a missing signal, but not what another drive would have."""
    left = replace(QUIET, structured=True, fraction=0.93, depends_on=("velocity",))
    missing = (
        RejectedEffect("thermal_friction", "thermal_friction", "not_recorded", "temperature not recorded"),
        RejectedEffect("backlash", "backlash", "cannot_be_looked_for", "needs a position servo"),
        RejectedEffect("servo_integrator", "servo_integrator", "cannot_be_looked_for", "no servo"),
    )
    no_sensor = RejectedEffect("torque_sensor_bias", "torque_sensor_bias", "cannot_be_looked_for", "none")
    said = plain(unexplained(replace(joint, unexplained=left, rejected=(*missing, no_sensor))))
    assert said.endswith("; temperature-dependent friction and backlash of the gear could not be looked for.")
    said = plain(unexplained(replace(joint, unexplained=left, rejected=missing)))
    assert said.endswith("; temperature-dependent friction could not be looked for.")


WARMER = BeyondTraining("temperature", ("warm",), (24.4, 30.7), (24.4, 59.2), 0.998)


@pytest.mark.parametrize("structured", [False, True])
def test_an_error_beyond_the_training_range_is_called_one_of_extrapolation(joint, structured):
    left = replace(QUIET, structured=structured, excess=True, floors=8.0, beyond=WARMER, depends_on=("time",))
    said = plain(unexplained(replace(joint, unexplained=left)))
    assert (
        "99.8 % of the remaining error lies where the temperature is outside the range of the training runs "
        "(24.4 to 30.7 °C), so the model is extrapolated there."
    ) in said
    assert "no recorded signal" not in said


def test_a_range_of_efforts_has_the_unit_of_the_drive(joint):
    left = replace(
        QUIET, structured=True, beyond=BeyondTraining("effort", ("fast",), (-2.8, 2.8), (-4.0, 4.8), 0.97, "A")
    )
    said = plain(unexplained(replace(joint, unexplained=left)))
    assert "where the effort is outside the range of the training runs (-2.80 to 2.80 A)" in said.replace("−", "-")


def test_structure_in_time_names_three_stretches_and_counts_the_rest(joint):
    stretches = tuple(TimeStretch("run", 10.0 * k, 10.0 * k + 2.5) for k in range(5))
    left = replace(QUIET, structured=True, fraction=0.0, depends_on=("time",), confined_to=stretches, period_hz=4.237)
    said = plain(unexplained(replace(joint, unexplained=left)))
    assert "run from 0.0 to 2.5 s, run from 10.0 to 12.5 s and run from 20.0 to 22.5 s and 2 more stretches" in said
    assert said.endswith("and the remaining error repeats at 4.24 Hz.")
    three = plain(unexplained(replace(joint, unexplained=replace(left, confined_to=stretches[:3], period_hz=None))))
    assert "more stretches" not in three


def test_a_model_that_does_not_carry_over_is_said_to_be_larger_on_held_out_runs(joint):
    left = replace(QUIET, structured=True)
    assert unexplained(replace(joint, unexplained=left)) == (
        "the remaining error is larger on the held-out runs than on the training runs."
    )


def test_every_verdict_and_every_reason_has_words():
    assert set(VERDICTS) == set(SEVERITY)
    assert set(REASONS) == set(get_args(Withdrawal))
    assert len({*VERDICTS.values()}) == len(VERDICTS)
    assert len({*REASONS.values()}) == len(REASONS)
    for short, sentence in REASONS.values():
        assert not short.endswith(".") and sentence.endswith(".")


def test_titles_are_those_of_library_and_shared_causes():
    assert title_of("stribeck") != "stribeck"
    assert title_of("ft_bias") == "bias of an F/T sensor"
    assert title_of("no_such_effect") == "no such effect"


@given(st.lists(st.floats(-0.5, 0.99), min_size=4, max_size=4))
def test_effects_are_ranked_by_gain_shared_or_not(result_of, gains):
    ranked = ranked_effects(result_of(gains))
    assert [g for _, _, g in ranked] == sorted(gains, reverse=True)
    assert {(name, where) for name, where, _ in ranked} == {
        ("link_mass", "shank"),
        ("imu_bias", "pelvis"),
        ("stribeck", "knee"),
        ("torque_ripple", "knee"),
    }


@pytest.fixture(scope="module")
def result_of(result: CloseLoopResult):
    """A result with two shared causes and the knee's two effects, of these gains of the whole robot."""

    def make(gains: list[float]) -> CloseLoopResult:
        causes = (("link_mass", "shank"), ("imu_bias", "pelvis"))
        shared = tuple(SharedEffect(i, w, "", {}, g, 1.0, {}) for (i, w), g in zip(causes, gains[:2], strict=True))
        knee = result.joints["knee"]
        effects = tuple(replace(e, robot_gain=g) for e, g in zip(knee.effects, gains[2:], strict=True))
        return replace(result, joints={"knee": replace(knee, effects=effects)}, shared=shared)

    return make


def test_a_joints_own_gain_ranks_where_the_robots_is_not_known(result):
    assert [g for _, _, g in ranked_effects(result)] == [e.heldout_gain for e in result.joints["knee"].effects]


def identified(joint: JointResult, low: float, high: float) -> JointResult:
    drive = {"gain": Estimate(0.1, "A/(N*m)", (low, high), False)}
    parameters = {
        key: {n: replace(e, at_bound=False) for n, e in g.items()} for key, g in joint.final_parameters.items()
    }
    return replace(joint, final_parameters={**parameters, "drive": drive}, indistinguishable=())


def test_a_sound_result_has_no_warnings(joint):
    assert list(warnings(with_errors(identified(joint, 0.09, 0.11), 0.02, 0.004, 0.002))) == []


@pytest.mark.parametrize(("high", "said"), [(0.1449, False), (0.1451, True)])
def test_a_gain_whose_interval_is_wider_than_itself_is_not_identified(joint, high, said):
    found = warnings(identified(joint, 0.045, high))
    assert any("do not identify the drive gain" in w and "0.0450 to 0.145" in w for w in found) == said


@pytest.mark.parametrize("verdict", ["unexplained_structure", "unexplained_residual"])
def test_effects_that_leave_most_of_the_error_are_said_to_be_doubtful(joint, verdict):
    half = with_errors(identified(joint, 0.09, 0.11), 0.02, 0.011, 0.002)
    doubtful = replace(half, verdict=verdict)
    (said,) = warnings(doubtful)
    assert plain(said).startswith("With the effects found, 55 % of the held-out error is left.")
    beyond = replace(QUIET, beyond=BeyondTraining("temperature", ("held",), (20.0, 30.0), (30.0, 50.0), 0.9))
    for sound in (
        replace(half, verdict="effects_found"),
        replace(doubtful, effects=()),
        with_errors(doubtful, 0.02, 0.009, 0.002),
        replace(doubtful, unexplained=beyond),
    ):
        assert not warnings(sound)


def test_what_must_not_be_overlooked(joint):
    sound = with_errors(identified(joint, 0.09, 0.11), 0.02, 0.004, 0.002)
    assert "held-out error did not fall" in warnings(with_errors(sound, 0.004, 0.0041, 0.002))[0]
    assert warnings(replace(with_errors(sound, 0.004, 0.0041, 0.002), effects=())) == []
    free = replace(sound, before=replace(sound.before, free_run_heldout=1.0))
    for after, said in ((1.019, False), (1.021, True)):
        made = replace(free, after=replace(free.after, free_run_heldout=after))
        assert any("position error of the free run" in w for w in warnings(made)) == said
    either = warnings(replace(sound, indistinguishable=(("stribeck", "delay"),)))
    assert either == [
        f"These logs cannot distinguish {title_of('stribeck')} from {title_of('delay')}; both fit equally well."
    ]
    bound = {"stribeck": {"stribeck_exponent": Estimate(4.0, "-", (3.0, 4.0), True)}}
    at_bound = warnings(replace(sound, final_parameters={**sound.final_parameters, **bound}))
    assert at_bound == [
        f"{title_of('stribeck')}: the parameter stribeck exponent lies at a bound of its range, so its 95 % "
        "interval is not valid."
    ]


def test_an_effect_that_was_tried_is_told_with_its_log_odds_and_another_with_its_obstacle():
    tried = RejectedEffect("delay", "delay", "too_little_evidence", "", -1.24, 0.03)
    assert why_rejected(tried) == f"its log odds are −1.2, at least {ALTERNATIVE:+g} is required"
    barred = RejectedEffect("delay", "delay", "not_recorded", "temperature not recorded")
    assert why_rejected(barred) == "temperature not recorded"
    impossible = RejectedEffect("saturation", "saturation", "not_possible", "limit is 8 A", 40.0, 0.5)
    assert why_rejected(impossible) == "limit is 8 A"
    assert why_rejected(replace(impossible, obstacle="")) == "it would leave nothing of the effort"
    assert [each["id"] for each in rejected_rows([barred, impossible])[0]] == ["saturation"]


@pytest.mark.parametrize(
    ("fraction", "structured", "names", "structure", "depends"),
    [
        (0.05, False, (), "no", "no recorded signal"),
        (
            0.54,
            False,
            (),
            "no: recorded signals predict part of it, but this part is too small to count",
            "not determined",
        ),
        (0.54, True, ("velocity",), "yes", "velocity"),
    ],
)
def test_the_facts_on_what_is_left_do_not_contradict_each_other(fraction, structured, names, structure, depends):
    left = Unexplained(1.9, 1.9, False, 0.001, fraction, structured, names)
    assert (structure_words(left), dependence_words(left)) == (structure, depends)


def test_the_headline_has_one_unit(joint):
    said = plain(headline(replace(with_errors(joint, 2.5e-3, 14.5e-6, 7.65e-6), unit="rad", verdict="effects_found")))
    assert "from 2.50 mrad to 0.0145 mrad" in said and "µrad" not in said


def test_numbers_in_names_count_by_their_value():
    assert sorted(["run10", "run2", "a", "run", "2b", "run2b"], key=natural) == [
        "2b",
        "a",
        "run",
        "run2",
        "run2b",
        "run10",
    ]
