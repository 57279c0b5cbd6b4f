"""Effects whose sizes may all be zero by the uncertainty of the links are withdrawn, unless they gain much."""

from dataclasses import dataclass, field, replace

import pytest

from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.joint_result import FoundEffect
from drake_tc.diagnosis.robot.uncertain_sizes import without_uncertain_sizes
from drake_tc.diagnosis.selection.withdrawal import SizesMayBeZero

ZERO, SURE = (-0.5, 1.5), (0.4, 0.6)


@dataclass(frozen=True)
class Diagnosis:
    """Of a joint's result what the rule looks at."""

    effects: tuple[FoundEffect, ...]
    did_not_hold: tuple = field(default=())


def wave(gain, cosine, sine):
    sizes = {"ripple_cosine": cosine, "ripple_sine": sine, "cycles_per_turn": (17.9, 18.1)}
    values = {name: Estimate(0.5 * sum(ci), "-", ci, at_bound=False) for name, ci in sizes.items()}
    return FoundEffect("torque_ripple", "torque_ripple", "torque ripple", values, gain, 1.0, 0.1)


def made(*effects):
    return {"knee": Diagnosis(effects)}


def test_it_goes_where_all_sizes_may_be_zero_and_is_told_why():
    before, after = made(wave(0.007, SURE, SURE)), made(wave(0.007, ZERO, ZERO))
    left = without_uncertain_sizes(before, after)["knee"]
    assert left.effects == ()
    (gone,) = left.did_not_hold
    assert (gone.key, gone.objection, gone.reason) == ("torque_ripple", SizesMayBeZero(0.007), "below_resolution")


@pytest.mark.parametrize(
    ("gain", "cosine", "sine"),
    [(0.007, SURE, ZERO), (0.3, ZERO, ZERO)],
    ids=["one size is certain", "it lowers the held-out error by much"],
)
def test_it_stays(gain, cosine, sine):
    each = made(wave(gain, cosine, sine))
    assert without_uncertain_sizes(each, each) is None


def test_others_of_the_robot_stay_as_they_are():
    doubtful, sure = wave(0.007, ZERO, ZERO), wave(0.3, SURE, SURE)
    two = made(doubtful) | {"hip": Diagnosis((sure, replace(doubtful, key="encoder_ripple", id="encoder_ripple")))}
    left = without_uncertain_sizes(two, two)
    assert left["knee"].effects == ()
    assert left["hip"].effects == (sure,)
