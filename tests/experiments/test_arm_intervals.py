"""`bench design-arm`: the motions that are compared, what is recorded of them, and the rows of made-up reports."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from optional import skip_without_robots

from drake_tc.experiments.design.criteria import Expected
from drake_tc.experiments.design.robot import RobotDesign
from drake_tc.robot.rigid_regressor import link_tree, regressor
from tests.benchmarks.blind_arm.arms import REFERENCE, arm_named
from tests.benchmarks.blind_arm.cases import rig_file, simulated_arm, sound_case, write_files
from tests.benchmarks.blind_arm.recorder import EVERY, STEP, record_motion
from tests.benchmarks.evidence.arm_intervals import (
    compared,
    comparison_rows,
    intervals_of,
)
from tests.benchmarks.evidence.arm_runs import (
    MOTIONS,
    ArmRuns,
    compared_motions,
    predicted_widths,
    true_values,
)

TRUTH = {
    "links": {"link/m": 2.0, "link/mx": 0.5},
    "friction": {"joint": {"viscous": 1.0, "coulomb": 3.0}},
    "rotor": {"joint": 0.3},
}
WIDTHS = {"joint/rotor_inertia": (0.6, 2.0), "link/m": (0.2, 1.0), "link/mx": (0.4, 1.0)}


def report(width, names=("link/m", "link/mx")):
    """A report whose intervals lie about the truth."""

    def about(value):
        return [value - 0.5 * width, value + 0.5 * width]

    joint = {"viscous": 1.0, "coulomb": 3.0, "rotor_inertia": 0.3}
    base = [{"name": name, "weights": {name: 1.0}, "ci95": about(TRUTH["links"][name])} for name in names]
    return {
        "links": {"base": base},
        "final_parameters": {"joint": {key: {key: {"value": v, "ci95": about(v)}} for key, v in joint.items()}},
        "joints": {"joint": {"effects": []}},
        "shared": [],
    }


def comparison(designed, sinusoids, predicted=None):
    runs = ArmRuns({}, TRUTH, predicted or {}, 12.0)
    return compared("arm", runs, dict(zip(MOTIONS, (designed, sinusoids), strict=True)))


def rows_of(made):
    return {row.name: row for row in comparison_rows(made)}


def design(joints=2, knots=31):
    """A design with an analytic motion in place of the designed one."""
    time = 0.05 * np.arange(knots)
    phase = time[:, None] + np.arange(joints)

    class Analytic(RobotDesign):
        def motion(self, rate_hz):
            fine = np.arange(2000) / rate_hz
            return fine, {name: np.stack([k + fine, 0 * fine, fine, fine]) for k, name in enumerate(self.joints)}

    expected = (Expected("link/m, half 95 % interval", "SI", float("nan"), 4.0, 1.0),)
    names = tuple(f"joint{i}" for i in range(joints))
    sinusoids = np.stack([np.sin(phase), np.cos(phase), -np.sin(phase)])
    return Analytic(names, (), (), np.zeros((joints, 1)), 1, expected, (), 0.0, 0.0, 0, 0.01, sinusoids)


def test_both_motions_have_the_same_length_and_the_sinusoids_their_own_derivatives():
    made = design()
    time, motions = compared_motions(made)
    assert time[-1] == pytest.approx(0.05 * 30) and time[1] == STEP
    assert {each.shape for motion in motions.values() for each in motion} == {(time.size, 2)}
    phase = time[:, None] + np.arange(2)
    # the quintic spline errs by h^6/46080 times the sixth derivative; its second derivative by about h^4/384
    assert_allclose(motions["sinusoids"][0], np.sin(phase), atol=1e-11)
    assert_allclose(motions["sinusoids"][2], -np.sin(phase), atol=1e-7)
    assert_allclose(motions["designed"][0][:, 1], 1.0 + time)
    assert_allclose(motions["designed"][2][:, 0], time)
    assert predicted_widths(made)["link/m"] == pytest.approx((2.0 / np.sqrt(2.0), 8.0 / np.sqrt(2.0)))  # two runs


def test_the_recorded_currents_are_those_of_links_rotors_and_friction(tmp_path):
    """By the regressor, which shares nothing with Drake's inverse dynamics."""
    skip_without_robots()
    case = sound_case(arm_named(REFERENCE), 1)
    arm = simulated_arm(case, write_files(case, tmp_path, rig_file(case)), np.random.default_rng(case.seed))
    truth = true_values(arm)
    time = np.arange(101) * STEP
    phase = 2.0 * time[:, None] + 0.3 * np.arange(6)
    q, v, a = np.sin(phase), 2.0 * np.cos(phase), -4.0 * np.sin(phase)
    log, again = (record_motion(arm, 0, np.random.default_rng(3), time, (q, v, a)) for _ in range(2))
    rigid = regressor(link_tree(arm.plant), q, v, a) @ np.array(list(truth["links"].values()))
    for i, (joint, true) in enumerate(case.joints.items()):
        own = truth["friction"][joint]
        torque = rigid[:, i] + truth["rotor"][joint] * a[:, i] + own["viscous"] * v[:, i]
        torque += own["coulomb"] * np.tanh(v[:, i] / 1e-3)
        noise = arm.noise.effort[joint]
        assert_allclose(log[f"{joint}/current"], true.gain * torque[::EVERY], atol=5.0 * noise)
        assert_allclose(log[f"{joint}/current"], again[f"{joint}/current"], rtol=0.0, atol=0.0)
        assert not true.effect


def test_ratios_are_of_parameters_that_both_fits_have_and_rotors_of_those_that_the_design_counts():
    made = comparison(report(0.1), report(0.4, names=("link/mx",)), {"joint/viscous": (0.2, 1.0)})
    assert made.ratios("base parameters") == pytest.approx({"link/mx": 0.25})
    assert made.ratios("friction") == pytest.approx({"joint/viscous": 0.25, "joint/coulomb": 0.25})
    assert made.ratios("rotor inertias") == {}
    counted = comparison(report(0.1), report(0.4), WIDTHS)
    assert counted.ratios("rotor inertias") == pytest.approx({"joint/rotor_inertia": 0.25})
    rows = rows_of(counted)
    assert rows["base parameters: ratio"].value == pytest.approx(0.25)
    assert rows["base parameters: ratio"].met
    assert rows["base parameters: predicted ratio"].value == pytest.approx(0.3)
    assert rows["rotor inertias: predicted ratio"].value == pytest.approx(0.3)
    assert rows["rotor inertias: design over report"].value == pytest.approx(6.0)
    assert rows["rotor inertias: factor between both"].met is False
    assert rows["all parameters: ratio"].value == pytest.approx(0.25) and rows["all parameters: ratio"].n == 5
    assert rows["all parameters: predicted ratio"].value == pytest.approx(0.3)
    assert rows["all parameters: wider intervals"].value == 0.0
    assert "friction: predicted ratio" not in rows
    assert rows["design, processor time"].value == 12.0


def test_a_width_that_the_design_states_too_narrow_misses_the_goal_as_one_too_wide_does():
    for stated, factor in ((0.06, 10.0 / 6.0), (0.16, 1.6), (0.09, 10.0 / 9.0), (0.12, 1.2)):
        row = rows_of(comparison(report(0.1), report(0.1), {"joint/viscous": (stated, 1.0)}))[
            "friction: factor between both"
        ]
        assert row.value == pytest.approx(factor) and row.met is (factor < 1.5)


def test_intervals_are_held_against_the_truth_and_unbounded_ones_do_not_count():
    moved = report(0.1)
    moved["links"]["base"][0]["ci95"] = [2.1, 2.2]
    moved["links"]["base"][1]["ci95"] = [None, 1.0]
    made = comparison(moved, report(0.2))
    assert [each.holds for each in intervals_of(moved, TRUTH)] == [False, False, True, True, True]
    assert made.ratios("base parameters") == pytest.approx({"link/m": 0.5})
    rows = rows_of(made)
    assert rows["designed: hold the truth, base parameters"].value == 0.0
    assert rows["designed: hold the truth, friction"].value == 1.0
    assert rows["sinusoids: hold the truth, base parameters"].value == 1.0
