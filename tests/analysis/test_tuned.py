"""Tuned settings in a scenario, and the perturbed plants that they are confirmed on."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.framework import DiagramBuilder

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_models, save_models
from drake_tc.analysis.torque_loop import tuned
from drake_tc.analysis.torque_loop.tuned import (
    Compared,
    Spread,
    compare_on_plant,
    confirm_function,
    function_tasks,
    joint_tasks,
    tuned_scenario,
)
from drake_tc.analysis.tuning import Goal, SearchSpace, default_goals, setting_of, tune
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.loops.function_diagram import function_entry
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.running import TorqueRecording
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.stages import actuator_models, loop_robot, torque_gains
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.registry import diagram_entry
from drake_tc.robot.robot import load_robot
from tests.robot_files import joint_tag, link_tag, urdf, write_robot

LEG = diagram_entry("hrp2_leg")


@pytest.fixture
def seen(monkeypatch):
    """Scenarios that are simulated, with their actuators; a simulation returns a made-up recording."""
    kept = []

    def simulate(scenario, allow_runaway):
        robot = loop_robot(scenario)
        kept.append((scenario, actuator_models(scenario, robot), actuator_models(scenario, robot, controller=True)))
        time = np.arange(0.0, scenario.duration, scenario.dt)
        state, reference = np.zeros((time.size, 12)), np.full((time.size, 18), 2e-3)
        return TorqueRecording(
            robot=robot, models={}, time=time, signals={"joint_state": state, "reference": reference}, seconds=0.0
        )

    monkeypatch.setattr(tuned, "simulate_scenario", simulate)
    return kept


def test_a_plant_is_drawn_from_its_seed_alone_and_the_controller_keeps_its_model(seen):
    scenario = LEG.scenario("brisk_swing")
    other = replace(scenario, gains=replace(scenario.gains, kp=1.0))
    point = Compared((scenario, other), Spread(), 0.3)
    errors = compare_on_plant(point, 5)
    assert_allclose(errors, 2e-3, rtol=1e-12)
    compare_on_plant(point, 5)
    compare_on_plant(point, 6)
    (first, drawn, model), (second, same, _), (_, again, _), _, (fifth, another, _), _ = seen
    assert drawn == same == again and another != drawn
    assert (first.masses, first.seed) == (second.masses, second.seed) != (fifth.masses, fifth.seed)
    assert (first.gains.kp, second.gains.kp) == (2.0, 1.0)
    assert model == {j: load_models(scenario.path(scenario.model))[j] for j in model}
    truth = actuator_models(scenario, loop_robot(scenario))
    for joint, found in drawn.items():
        gain = found.drive.gain / truth[joint].drive.gain
        was, now = ({e.key: e.parameters for e in m.effects} for m in (truth[joint], found))
        assert 0.85 <= gain <= 1.15
        assert 0.85 <= gain * now["viscous"]["viscous"] / was["viscous"]["viscous"] <= 1.15
        dry = {k: now[k][k] / was[k][k] for k in ("coulomb", "deadzone")}
        assert 0.5 <= dry["coulomb"] <= 1.5 and dry["coulomb"] == pytest.approx(dry["deadzone"])
        assert now["rotor_inertia"] == was["rotor_inertia"]
    assert len(first.masses) == 6 and all(0.9 <= factor <= 1.1 for factor in first.masses.values())


def test_without_a_model_the_controller_takes_the_unperturbed_actuators(seen):
    scenario = replace(LEG.scenario("brisk_swing"), model=None)
    compare_on_plant(Compared((scenario,), Spread(), 0.3), 1)
    ((_, drawn, model),) = seen
    assert model == actuator_models(scenario, loop_robot(scenario)) != drawn


def test_a_runaway_counts_as_an_infinite_error(monkeypatch):
    scenario = LEG.scenario("brisk_swing")

    def stopped(changed, allow_runaway):
        time = np.arange(0.0, 0.9, changed.dt)
        signals = {"joint_state": np.zeros((time.size, 12)), "reference": np.zeros((time.size, 18))}
        return TorqueRecording(robot=loop_robot(changed), models={}, time=time, signals=signals, seconds=0.0)

    monkeypatch.setattr(tuned, "simulate_scenario", stopped)
    errors = compare_on_plant(Compared((scenario,), Spread(), 0.3), 0)
    assert_array_equal(errors, np.full((1, 6), np.inf))


def test_tasks_say_what_the_scenario_says():
    scenario = LEG.scenario("brisk_swing", text="{gains: {by_joint: {r_knee: {kp: 3.0, ki: 4.0}}}}")
    robot = loop_robot(scenario)
    gains = torque_gains(scenario, robot)
    tasks = joint_tasks(scenario, 0.3)
    assert [task.joint for task in tasks] == list(robot.joints)
    assert_array_equal([task.loops[0].ks for task in tasks], gains.ks)
    knee = setting_of(tasks[3].loops[0])
    assert (knee.window, knee.order, knee.kp, knee.ki) == (80, 2, 3.0, 4.0)
    assert knee.k7 == pytest.approx(0.01)
    assert all(task.begin == 300 and len(task.loops) == 3 for task in tasks)
    least, most = (np.array([task.loops[k].link_inertia for task in tasks]) for k in (1, 2))
    assert np.all(least <= [task.loops[0].link_inertia for task in tasks]) and np.all(least <= most)
    with pytest.raises(ParamsError, match="expected a loop in torque control"):
        joint_tasks(LEG.scenario("stairs_swing_servo"))


def test_only_position_servos_are_tuned(tmp_path):
    scenario = LEG.scenario("brisk_swing")
    models = actuator_models(scenario, loop_robot(scenario))
    knee = models["r_knee"]
    save_models(models | {"r_knee": replace(knee, drive=replace(knee.drive, kind="current"))}, tmp_path / "drives.yaml")
    with pytest.raises(ParamsError, match="expected position servos; r_knee is a current drive"):
        joint_tasks(replace(scenario, actuators=str(tmp_path / "drives.yaml")))


def test_a_tuned_scenario_has_the_settings_and_keeps_the_others():
    scenario = LEG.scenario("brisk_swing", text="{gains: {by_joint: {r_knee: {k6: 0.5}, r_hip_yaw: {kp: 1.0}}}}")
    knee = [task for task in joint_tasks(scenario, 0.3) if task.joint == "r_knee"]
    space = SearchSpace(windows=(40,), kp=(1.0,), ki=(2.0,), k7=(1.0,), rounds=0)
    found = tune(knee, [Goal(noise=default_goals(knee)[0].noise)], space)
    changed = tuned_scenario(scenario, found)
    chosen = found.joints[0].after.setting
    assert changed.filters.window == 40
    given = changed.gains.by_joint["r_knee"]
    assert (given["k6"], given["kp"], given["ki"]) == (0.5, 1.0, 2.0)
    assert given["k7"] == pytest.approx(chosen.k7, rel=1e-5)
    assert changed.gains.by_joint["r_hip_yaw"] == {"kp": 1.0}


@pytest.fixture
def small_robots(tmp_path):
    """Robot files: an axis that slides with a pole on it, and an arm whose weight hangs on two joints."""
    cart = urdf(
        link_tag("car", (0, 0, 0), 4.0, (0.01, 0.01, 0.01)),
        link_tag("rod", (0, 0, -0.25), 0.5, (0.01, 0.01, 1e-4)),
        joint_tag("slide", "base", "car", axis=(1, 0, 0), kind="prismatic"),
        joint_tag("pole", "car", "rod", axis=(0, 1, 0)),
    )
    arm = urdf(
        link_tag("upper", (0.15, 0, 0), 1.5, (0.002, 0.015, 0.015)),
        link_tag("fore", (0.12, 0, 0), 0.4, (0.001, 0.004, 0.004)),
        joint_tag("shoulder", "base", "upper", axis=(0, 1, 0)),
        joint_tag("elbow", "upper", "fore", axis=(1, 0, 0), xyz=(0.3, 0, 0)),
    )
    files = {}
    for name, text, joints in (("cart", cart, ["slide", "pole"]), ("arm", arm, ["shoulder", "elbow"])):
        (tmp_path / name).mkdir()
        files[name] = write_robot(tmp_path / name, text, joints)
    return files


@pytest.mark.parametrize(("name", "k6"), [("cart", 0.5), ("arm", 0.5)])
def test_what_is_predicted_is_what_is_simulated(small_robots, name, k6):
    """Starts, stops and turns under dry friction, and joints that sag before they are controlled: within a fifth."""
    robot = load_robot(small_robots[name])
    kinds = {"slide": "prismatic"}
    effects = {"viscous": 5.0, "coulomb": 2.0, "rotor_inertia": 0.25}
    models = {
        joint: ActuatorModel(
            joint,
            Drive("position_servo", 4e-4),
            tuple(EffectValue(key, {key: value}) for key, value in effects.items()),
            kinds.get(joint, "revolute"),
        )
        for joint in robot.joints
    }

    def loop(spec=None, gains=None):
        builder = DiagramBuilder()
        plant = add_robot_plant(builder, robot)
        swing = knot_trajectory([0.5, 1.1, 1.7], [[0.0, 0.0], [0.2, 0.2], [0.0, 0.0]])
        given = TorqueGains.from_servo(models, k6=k6, kp=1.0, k7=0.001) if gains is None else gains
        made = add_torque_loop(builder, plant, robot, models, swing, spec or TorqueLoopSpec(), gains=given)
        return builder.Build(), made

    entry = function_entry("loop", loop)
    scenario = entry.scenario(None, None, "{duration: 1.8}")
    tasks = function_tasks(entry, scenario, 0.5)
    space = SearchSpace(windows=(30,), kp=(0.5, 1.0), ki=(0.0, 5.0), k7=(0.8, 1.1), rounds=0)
    found = tune(tasks, [Goal(5.0)] * 2, space)
    simulated = confirm_function(entry, scenario, found, 0.5).nominal[0]
    predicted = [[joint.before.error for joint in found.joints], [joint.after.error for joint in found.joints]]
    assert_allclose(predicted, simulated, rtol=0.2)
