"""`bench arms`: what the simulated arms do, what their files say, how base parameters are scored."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose
from optional import skip_without_robots
from pydrake.multibody.tree import MultibodyForces

from drake_tc.effects.base import Context
from drake_tc.effects.library import effect
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.rig import load_rig
from drake_tc.robot.plant import make_plant
from drake_tc.robot.rigid_regressor import link_tree, regressor
from drake_tc.robot.robot import load_robot
from tests.benchmarks.arm_rigs import BASE_INTERVALS, ArmScore, arm_benchmark, arm_rows, base_intervals
from tests.benchmarks.blind_arm.arms import ARMS, LinkError, apply_errors, link_parameters, moving_links
from tests.benchmarks.blind_arm.cases import (
    MASS_TOLERANCE,
    ROUND,
    SENSORS,
    arm_case,
    effect_name,
    record_case,
    rig_file,
)
from tests.benchmarks.blind_arm.physics import TORQUES, JointMotion, JointTruth, effort
from tests.benchmarks.blind_arm.recorder import MOST_ACCELERATION, MOST_TRAVEL, fourier
from tests.benchmarks.robot_rigs import RobotScore

PLAIN = JointTruth(viscous=2.0, coulomb=3.0, rotor_inertia=0.5, gain=0.1)


def motion(size=4000):
    time = np.arange(size) * 1e-3
    q, v, a = np.sin(time), np.cos(time), -np.sin(time)
    return JointMotion(time, q, v, a, 20.0 * np.sin(q), np.full(size, 35.0))


def test_a_joint_without_an_effect_bears_load_rotor_and_friction():
    m = motion()
    expected = 0.1 * (m.load + 0.5 * m.a + 2.0 * m.v + 3.0 * np.sign(m.v))
    fast = np.abs(m.v) > 0.05  # Coulomb friction has turned over
    assert_allclose(effort(PLAIN, m)[fast], expected[fast], atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "numbers", "added"),
    [
        ("load_dependent_friction", {"load_friction": 0.2}, lambda m: 0.2 * np.abs(m.load) * np.sign(m.v)),
        ("quadratic_viscous", {"quadratic_viscous": 1.5}, lambda m: 1.5 * np.abs(m.v) * m.v),
        ("cable_spring", {"spring_stiffness": 2.0, "spring_preload": -1.0}, lambda m: 2.0 * m.q - 1.0),
        ("current_offset", {"offset": 0.7}, lambda m: 0.7 + 0.0 * m.q),
        (
            "thermal_friction",
            {"coulomb_per_kelvin": -0.1, "viscous_per_kelvin": 0.05},
            lambda m: 10.0 * (-0.1 * np.sign(m.v) + 0.05 * m.v),
        ),
    ],
)
def test_an_effect_adds_its_torque(kind, numbers, added):
    m = motion()
    fast = np.abs(m.v) > 0.05  # Coulomb friction has turned over
    with_effect = JointTruth(2.0, 3.0, 0.5, 0.1, kind, numbers)
    assert_allclose((effort(with_effect, m) - effort(PLAIN, m))[fast], 0.1 * added(m)[fast], atol=1e-9)


def test_errors_of_the_drive_are_undone_by_their_own_equations():
    m = motion()
    clean = effort(PLAIN, m)
    dead = effort(JointTruth(2.0, 3.0, 0.5, 0.1, "deadzone", {"deadzone": 0.2}), m)
    assert_allclose(np.sign(dead) * np.maximum(np.abs(dead) - 0.2, 0.0), clean, atol=1e-12)
    late = effort(JointTruth(2.0, 3.0, 0.5, 0.1, "delay", {"delay": 0.02}), m)
    assert_allclose(late[:-20], clean[20:], atol=1e-9)
    lagged = effort(JointTruth(2.0, 3.0, 0.5, 0.1, "current_lag", {"lag": 0.03}), m)
    followed, out = clean[0], []
    for y in lagged:  # T dx/dt + x = y, backward Euler
        followed = (followed + y * 1e-3 / 0.03) / (1.0 + 1e-3 / 0.03)
        out.append(followed)
    smooth = np.abs(m.v) > 0.1
    assert_allclose(np.array(out)[smooth], clean[smooth], atol=0.01 * np.abs(clean).max())


def test_motions_stay_within_travel_speed_and_acceleration_and_derivatives_agree():
    time = np.arange(0.0, 20.0, 1e-3)
    q, v, a = fourier(time, -3.0, 1.0, 1.2, np.random.default_rng(0))
    assert np.abs(q + 1.0).max() <= MOST_TRAVEL + 1e-9
    assert np.abs(v).max() <= 1.2 + 1e-9
    assert np.abs(a).max() <= MOST_ACCELERATION + 1e-9
    assert_allclose(np.gradient(q, time)[1:-1], v[1:-1], atol=1e-5)
    assert_allclose(np.gradient(v, time)[1:-1], a[1:-1], atol=1e-4)


def test_a_round_holds_every_kind_and_both_drives():
    cases = [arm_case(number, 3) for number in range(4 * len(ROUND))]
    assert {case.kind for case in cases} == set(ROUND)
    assert {case.arm.name for case in cases} == {arm.name for arm in ARMS}
    assert len({case.name for case in cases}) == len(cases)
    assert 0.2 < np.mean([case.drive == "position_servo" for case in cases]) < 0.45
    for case in cases:
        wrong = [joint for joint, truth in case.joints.items() if truth.effect] + [j for j, d in case.late.items() if d]
        assert wrong == ([case.where] if case.kind else [])
        assert not (case.kind == "late_encoder" and case.drive == "position_servo")
    assert set(SENSORS) <= set(TORQUES) | {"late_encoder"}
    assert arm_case(3, 3) == cases[3]
    assert arm_case(3, 4) != cases[3]


def test_the_offset_of_an_effort_is_known_by_the_effect_that_its_drive_allows():
    """`effort_bias` cannot be looked for in a position servo, and says by which effect it is covered there."""
    cases = [arm_case(number, 3) for number in range(6 * len(ROUND))]
    names = {case.drive: effect_name(case) for case in cases if case.kind == "current_offset"}
    assert names == {"current": "effort_bias", "position_servo": "encoder_offset"}
    for drive, name in names.items():
        context = Context(drive=drive, load="links", recorded=frozenset())
        assert effect(name).unavailable(context) is None
        assert (effect("effort_bias").unavailable(context) is None) == (name == "effort_bias")


@pytest.mark.parametrize("number", range(4))
def test_rig_files_are_short_and_do_not_tell(tmp_path, number):
    skip_without_robots()
    case = arm_case(number, 0)
    text = rig_file(case)
    assert len(text.splitlines()) <= 15
    assert len(case.arm.robot_file().splitlines()) <= 12
    assert case.kind not in text
    (tmp_path / "arm.yaml").write_text(case.arm.robot_file(), encoding="utf-8")
    (tmp_path / "rig.yaml").write_text(text, encoding="utf-8")
    rig = load_rig(tmp_path / "rig.yaml")
    assert rig.joints == case.arm.joints
    assert set(rig.drive.values()) == {case.drive}


def test_the_truth_of_the_links_gives_the_torques_of_the_recorded_arm(tmp_path):
    """By the regressor, which shares nothing with Drake's inverse dynamics."""
    skip_without_robots()
    case = arm_case(0, 1)
    (tmp_path / "arm.yaml").write_text(case.arm.robot_file(), encoding="utf-8")
    robot = load_robot(tmp_path / "arm.yaml")
    plant = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    links = moving_links(plant, robot)
    before = link_parameters(plant, context, links)
    apply_errors(plant, context, {link: LinkError(1.3, 0.6, (0.02, -0.01, 0.03)) for link in links})
    after = link_parameters(plant, context, links)
    for link in links[:-1]:  # the last one carries the hand, which stays
        assert_allclose(after[f"{link}/m"], 1.3 * before[f"{link}/m"], rtol=1e-12)
    q, v, a = np.random.default_rng(2).normal(size=(3, 5, 7))
    torque = []
    for row in zip(q, v, a, strict=True):
        plant.SetPositions(context, row[0])
        plant.SetVelocities(context, row[1])
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        torque.append(plant.CalcInverseDynamics(context, row[2], forces))
    pi = np.array(list(after.values()))
    assert_allclose(regressor(link_tree(plant), q, v, a) @ pi, torque, atol=1e-8)


def test_records_are_what_the_files_say(tmp_path):
    skip_without_robots()
    case = arm_case(13, 0)
    assert case.kind == "late_encoder"
    truth = record_case(case, tmp_path)
    assert truth["id"] == "delay"
    assert truth["estimated"] == {"delay": case.late[case.where]}
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        *("arm.yaml", "rig.yaml", "run_1.npz", "run_2.npz", "run_3.npz", "run_held.npz"),
    ]
    log = read_table(tmp_path / "run_1.npz")
    assert {f"{j}/{c}" for j in case.arm.joints for c in ("position", "current", "temperature")} < set(log.columns)
    robot = load_robot(tmp_path / "arm.yaml")
    plant = make_plant(robot, 0.0)
    file = link_parameters(plant, plant.CreateDefaultContext(), moving_links(plant, robot))
    masses = [(truth["links"][name], value) for name, value in file.items() if name.endswith("/m")]
    shares = np.array([true / value - 1.0 for true, value in masses])
    assert (np.abs(shares) <= MASS_TOLERANCE).all()
    assert np.abs(shares).max() > 0.1


def test_base_parameters_are_scored_by_the_combination_of_the_true_ones():
    truth = {"links": {"a/m": 2.0, "b/m": 3.0}}
    base = [
        {"weights": {"a/m": 1.0, "b/m": 0.5}, "ci95": [3.4, 3.6]},
        {"weights": {"b/m": 1.0}, "ci95": [2.0, 2.9]},
        {"weights": {"b/m": 1.0}, "ci95": [None, 5.0]},
    ]
    assert base_intervals(truth, {"links": {"base": base}}) == (True, False, False)
    assert base_intervals(truth, {"links": None}) == ()


def test_intervals_are_counted_by_drive():
    def score(drive, base, friction):
        robot = RobotScore("case", "", "", True, True, (), friction_intervals=friction)
        return ArmScore(robot, base, drive, "no_missing_effect", 1.0)

    scores = [score("current", (True, True, False, True), (True,)), score("position_servo", (), (True, False))]
    rows = {row.name: row for row in arm_rows(scores)}
    assert rows[BASE_INTERVALS].value == rows["base parameters, current"].value == 0.75
    assert rows[BASE_INTERVALS].goal == "90 to 99 %"
    assert (rows["friction, current"].value, rows["friction, position_servo"].value) == (1.0, 0.5)
    assert rows["friction, position_servo"].n == 2
    assert "base parameters, position_servo" not in rows


@pytest.mark.slow
def test_a_few_arms_are_diagnosed_from_their_files(tmp_path):
    skip_without_robots()
    wanted = [ROUND.index(kind) for kind in ("stribeck", "deadzone", "torque_ripple", "")]
    with ThreadPoolExecutor(1) as pool:
        scores = arm_benchmark(tmp_path, wanted, 11, pool, lambda text, share: None)
    assert [s.robot.failure for s in scores if s.robot.failure] == []
    assert [s.robot.name for s in scores if not s.robot.first] == []
    rows = {row.name: row for row in arm_rows(scores)}
    assert rows[BASE_INTERVALS].value >= 0.9
    assert json.loads((tmp_path / "seed.json").read_text(encoding="utf-8")) == 11
