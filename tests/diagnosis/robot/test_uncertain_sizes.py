"""Effects whose sizes may all be zero by the uncertainty of the links are withdrawn, unless they gain much."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from fitted_arm import GAIN, JOINTS, URDF, record, rig_file
from robot_files import write_robot

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.joint_result import FoundEffect
from drake_tc.diagnosis.robot import uncertain_sizes
from drake_tc.diagnosis.robot.uncertain_sizes import without_uncertain_sizes
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.selection.withdrawal import SizesMayBeZero
from drake_tc.effects.library import effect
from drake_tc.effects.link_load import link_load
from drake_tc.robot.robot import load_robot

from ..rigs import Joint, problem

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


def test_a_whole_arm_is_diagnosed_again_without_it(tmp_path, monkeypatch):
    """As if the links were so uncertain that nothing of a drag that grows with the square of the speed is certain."""
    robot = load_robot(write_robot(tmp_path, URDF, JOINTS))
    logs = [dragged(record(tmp_path, robot, f"run_{k}", k)) for k in range(3)]
    options = DiagnosisOptions(effects=(effect("quadratic_viscous"),), assess_residual=False)

    def found():
        return close_loop(rig_file(tmp_path), logs[:2], logs[2:], options).joints["turn"]

    assert [each.id for each in found().effects] == ["quadratic_viscous"]
    monkeypatch.setattr(uncertain_sizes, "_may_be_zero", lambda each: True)
    left = found()
    assert left.effects == ()
    assert [each.id for each in left.did_not_hold] == ["quadratic_viscous"]
    assert "quadratic_viscous" not in {term.effect.id for term in left.final.terms}


def dragged(log):
    """The log with 3 N m s^2/rad^2 at the joint that gravity does not load."""
    columns = dict(np.load(log))
    v = np.gradient(columns["turn/position"], columns["time"])
    np.savez(log, **columns | {"turn/current": columns["turn/current"] + GAIN[0] * 3.0 * v * np.abs(v)})
    return log


def test_columns_of_links_follow_the_number_of_open_directions():
    columns = Columns(problem(Joint()).samples)
    assert [columns.of(Term(link_load(size))).shape[1] for size in (2, 3, 2)] == [2, 3, 2]
