"""Beside each parameter: where it is possible."""

from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from drake_tc.cli.close_loop_command import print_summary
from drake_tc.diagnosis.problem.parameters import PlausibleRange, plausible_ranges
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.effects.base import Context
from drake_tc.report.data_files import result_json
from drake_tc.report.numbers import interval
from drake_tc.report.tables import parameter_rows

RIG = Context("current", "torque", frozenset(), max_speed=2.0, effort_span=(-3.0, 4.0), torque_span=(-10.0, 8.0))


def test_ranges_are_those_of_the_effects_on_this_rig(joint: JointResult) -> None:
    ranges = plausible_ranges(joint.final, RIG)
    most = 4.0 / joint.final.gain + 10.0  # what drive and load put in [N m]
    assert_allclose((ranges["coulomb"]["coulomb"].lower, ranges["coulomb"]["coulomb"].upper), (0.0, most))
    assert_allclose(ranges["viscous"]["viscous"].upper, most / 2.0)
    assert "dissipates" in ranges["coulomb"]["coulomb"].source
    assert "drive" not in ranges
    assert {"stribeck", "stribeck_velocity", "stribeck_exponent"} == set(ranges["stribeck"])


@pytest.mark.parametrize(
    ("value", "inside"), [(0.0, True), (2.0, True), (2.0 + 1e-10, True), (2.1, False), (-1.0, False)]
)
def test_a_value_at_a_limit_is_inside(value: float, inside: bool) -> None:
    assert PlausibleRange(0.0, 2.0, "a law").holds(value) is inside


def test_the_table_marks_what_lies_outside(joint: JointResult) -> None:
    narrow = {
        "stribeck": {
            "stribeck": PlausibleRange(0.0, 1.0, "a law"),
            "stribeck_exponent": PlausibleRange(0.5, float("inf"), "x"),
        }
    }
    rows = {(r["effect"], r["name"]): r for r in parameter_rows(replace(joint, plausible=narrow))}
    row = rows["Stribeck friction", "stribeck"]
    assert (row["possible"], row["source"], row["outside"]) == ("0 to 1.00", "a law", True)
    assert rows["Stribeck friction", "stribeck exponent"]["possible"] == "0.500 or more"
    assert rows["viscous friction", "viscous"]["possible"] == ""
    assert not rows["viscous friction", "viscous"]["outside"]


def test_a_parameter_that_acts_as_the_others_do_is_called_not_identified(joint: JointResult, capsys, tmp_path) -> None:
    """A number without an interval would look certain."""
    free = {key: dict(group) for key, group in joint.final_parameters.items()}
    velocity = replace(free["stribeck"]["stribeck_velocity"], ci95=(0.0, float("inf")))
    free["stribeck"]["stribeck_velocity"] = velocity
    effects = tuple(replace(e, parameters=free[e.id]) for e in joint.effects)
    unknown = replace(joint, final_parameters=free, effects=effects)
    row = next(r for r in parameter_rows(unknown) if r["name"] == "stribeck velocity")
    assert row["after"] == (interval(velocity.value, *velocity.ci95)[0], "not identified")
    result = CloseLoopResult({"knee": unknown}, "effects_found", 1.0, (), (), "rig.yaml")
    assert result_json(result)["joints"]["knee"]["effects"]  # type: ignore[index]
    print_summary(result, tmp_path)
    told = " ".join(capsys.readouterr().out.split())
    assert f"stribeck_velocity {velocity.value:.4g} rad/s (not identified)" in told
