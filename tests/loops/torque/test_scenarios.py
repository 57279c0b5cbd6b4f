"""Scenario files: what is committed runs; what is misspelt is refused in one line that names file and field."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from drake_tc.actuation.model_file import ModelFile
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import read_mapping, scenario_names
from drake_tc.loops.torque.running import build_loop, simulate_scenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import actuator_models, loop_robot
from drake_tc.registry import diagram_entry, diagrams
from drake_tc.robot.plant import joint_limits

COMMITTED = [(entry.name, name) for entry in diagrams("torque").values() for name in entry.scenarios()]
SHORT = "{duration: 0.15, tare: 0.02, guard: {start_time: 0.05}}"


@pytest.mark.parametrize(("diagram", "name"), COMMITTED, ids=["-".join(pair) for pair in COMMITTED])
def test_every_committed_scenario_runs_and_stays_finite(diagram, name):
    scenario = diagram_entry(diagram).scenario(name, text=SHORT)
    recording = simulate_scenario(scenario)
    assert recording.time.size == 151
    assert all(np.isfinite(values).all() for values in recording.signals.values())
    limits = joint_limits(recording.robot)
    reference = recording["reference"][:, : recording.size]
    assert ((limits.lower <= reference) & (reference <= limits.upper)).all()


@pytest.mark.parametrize(("diagram", "name"), COMMITTED, ids=["-".join(pair) for pair in COMMITTED])
def test_no_committed_motion_leaves_the_limits(diagram, name):
    from drake_tc.loops.torque.references import references
    from drake_tc.robot.robot import load_robot

    scenario = diagram_entry(diagram).scenario(name)
    robot = load_robot(scenario.path(scenario.robot))
    limits, n = joint_limits(robot), len(robot.joints)
    motion = references(scenario, robot).motion
    assert (limits.lower <= motion[:, :n]).all()
    assert (motion[:, :n] <= limits.upper).all()
    assert (np.abs(motion[:, n : 2 * n]) <= limits.velocity).all()


def test_same_seed_same_numbers_and_another_seed_other_noise():
    entry = diagram_entry("hrp2_leg")
    one, two = (simulate_scenario(entry.scenario("hanging", text=SHORT)) for _ in range(2))
    for name, values in one.signals.items():
        assert_array_equal(values, two[name], err_msg=name)
    other = simulate_scenario(entry.scenario("hanging", text=SHORT).changed(seed=1))
    for name in ("encoder", "imu", "force_torque"):
        assert np.all(np.ptp(one[name] - other[name], axis=0) > 0.0)
    assert_array_equal(one["reference"], other["reference"])


def test_one_loop_gives_the_same_run_twice():
    from drake_tc.loops.torque.running import run_loop

    loop = build_loop(diagram_entry("hrp2_leg").scenario("hanging", text=SHORT))
    first, second = run_loop(loop), run_loop(loop)
    assert_array_equal(first["joint_state"], second["joint_state"])
    assert_array_equal(first["flags"], second["flags"])


FILE = """
one:
  robot: r.yaml
  gains: {k6: 0.5, by_joint: {knee: {kp: 1.0}}}
  motion: {times: [0.0, 1.0], knots: {knee: [0.0, 1.0]}}
two: {extends: one, gains: {k7: 0.1, by_joint: {hip: {kp: 2.0}}}}
three: {extends: two, duration: 5.0, motion: {times: [0.0, 2.0]}}
ring: {extends: rung, robot: r.yaml}
rung: {extends: ring}
lost: {extends: nowhere}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(FILE)
    return path


def test_extends_changes_field_by_field(file):
    three = Scenario.load(file, "three", "{gains: {k6: 2.0}}")
    assert (three.robot, three.duration, three.dt) == ("r.yaml", 5.0, Scenario("x").dt)
    assert (three.gains.k6, three.gains.k7, three.gains.kp) == (2.0, 0.1, 2.0)
    assert three.gains.by_joint == {"knee": {"kp": 1.0}, "hip": {"kp": 2.0}}
    assert (three.motion.times, three.motion.knots) == ((0.0, 2.0), {"knee": (0.0, 1.0)})
    assert Scenario.load(file, "one").gains.k7 == 0.0
    assert three.path("a/b.yaml") == file.parent / "a" / "b.yaml"
    assert scenario_names(file) == ["one", "two", "three", "ring", "rung", "lost"]
    assert three.changed(duration=None, seed=4) == Scenario.load(file, "three", "{gains: {k6: 2.0}, seed: 4}")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("none", None, "no scenario 'none'; did you mean 'one'[?]; scenarios here: one, two, three, ring, rung, lost"),
        ("lost", None, "no scenario 'nowhere'"),
        ("ring", None, r"extends itself \(ring -> rung -> ring\)"),
        (
            "one",
            "{durration: 1.0}",
            r"s\.yaml: one: unknown key 'durration'; did you mean 'duration'[?]; allowed: robot, controller, dt",
        ),
        ("one", "{gains: {k5: 1.0}}", r"one\.gains: unknown key 'k5'; allowed: k6, k7, kp, ki, kf, by_joint"),
        ("one", "{pushes: [{link: foot}]}", r"one\.pushes\[0\]: begin is missing"),
        ("one", "{duration: long}", r"one\.duration: expected a finite number, got 'long'"),
        ("one", "{duration: 0.0}", r"one\.duration: expected a positive number"),
        ("one", "{duration: .nan}", r"one\.duration: expected a finite number, got nan"),
        ("one", "{seed: 1.5}", r"one\.seed: expected a whole number, got 1\.5"),
        ("one", "{log_truth: 1}", r"one\.log_truth: expected true or false, got 1"),
        ("one", "{plant_step: 3.0e-4}", r"one\.plant_step: expected dt = 0\.001 s over a whole number"),
        ("one", "{controller: both}", "controller: expected one of torque, servo, got 'both'"),
        ("one", "{torque_from: nowhere}", "torque_from: expected one of estimate, sensor"),
        ("one", "{faults: {gps: []}}", "faults: no sensor 'gps'; possible: encoder, imu, force_torque"),
        (
            "one",
            "{faults: {imu: [{kind: gone}]}}",
            r"faults\.imu\[0\]\.kind: expected one of frozen, dropped, biased, nan",
        ),
        ("one", "{force: {a: {offset: [1.0]}}}", r"force\.a\.offset: expected six finite numbers"),
        ("one", "{guard: {start_rate: 0.0}}", r"guard\.start_rate: expected finite numbers > 0"),
        ("one", "{monitor: {hold: 0.0}}", "hold: expected a positive number"),
        ("one", "[1, 2]", r"scenario text: expected a mapping of fields, got '\[1, 2\]'"),
        ("one", "{a: [", "scenario text: not valid YAML"),
    ],
)
def test_what_a_scenario_file_cannot_say(file, name, text, message):
    with pytest.raises(ParamsError, match=message) as caught:
        Scenario.load(file, name, text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{robot: nothing.yaml}", r"nothing\.yaml"),
        (
            "{robot: ../models/hrp2_like/hrp2_like.yaml}",
            "angular_acceleration: expected gyro or neglected, as the base",
        ),
        ("{actuators: nothing.yaml}", r"nothing\.yaml"),
        ("{sensors: superb}", r"sensors\.preset: expected one of perfect, realistic, got 'superb'"),
        ("{sensors: {encoder: {hue: 1}}}", r"sensors\.encoder: unknown .*hue"),
        ("{motion: {posture: {elbow: 1.0}}}", "motion.posture: no joint 'elbow'; joints of hrp2_like_leg"),
        ("{motion: {knots: {elbow: [1, 2, 3, 4]}}}", r"motion\.knots: no joint 'elbow'"),
        ("{motion: {knots: {r_knee: [1, 2]}}}", r"motion\.knots\.r_knee: expected 4 positions, got 2"),
        ("{motion: {times: [0.0, 2.0, 1.0, 3.0]}}", "times"),
        ("{motion: {sinusoids: {elbow: {frequency_hz: 1.0}}}}", r"motion\.sinusoids: no joint 'elbow'"),
        ("{gains: {by_joint: {elbow: {k6: 1.0}}}}", r"gains\.by_joint: no joint 'elbow'"),
        ("{gains: {by_joint: {r_knee: {k9: 1.0}}}}", r"gains\.by_joint\.r_knee: no gain 'k9'"),
        ("{force: {left_ankle: {}}}", "force: no F/T sensor 'left_ankle'; those of hrp2_like_leg: right"),
        ("{pushes: [{link: tail, begin: 0, duration: 1}]}", "pushes: no link 'tail'"),
        (
            "{pushes: [{link: r_foot, begin: 0, duration: 0}]}",
            r"pushes\[0\].duration: expected a positive number \[s\], got 0",
        ),
        ("{pushes: [{link: r_foot, begin: 0, duration: 1, force: [1, 2]}]}", "force: expected three finite"),
        ("{masses: {r_foot: -1}}", "masses.r_foot: expected a positive factor"),
        ("{seed: -1}", "seed: expected a whole number from 0 to"),
        ("{gains: {kf: [1, 2]}}", "kf: expected one number or six"),
        ("{motion: {posture: {r_knee: 9}}}", "r_knee: expected 0 to 2.618 rad"),
        (
            "{objects: [{size: [1, 1, .nan], xyz: [0, 0, 0]}]}",
            r"objects\[0\]\.size\[2\]: expected a finite number, got nan",
        ),
        ("{objects: [{size: [1, 1, 1], xyz: [0, 0, 0], friction: -1}]}", "friction: expected a number >= 0"),
        ("{masses: {tail: 1.1}}", "masses: no link 'tail' in hrp2_like_leg"),
        ("{objects: [{size: [1, 1], xyz: [0, 0, 0]}]}", r"objects\[0\].size: expected three positive numbers"),
        ("{objects: [{size: [1, 1, 0], xyz: [0, 0, 0]}]}", r"objects\[0\].size: expected three positive numbers"),
        ("{faults: {imu: [{kind: nan, channels: [7]}]}}", "expected 0 to 5, got 7"),
        ("{filters: {window: 2}}", "window"),
        ("{tare: -1.0}", "tare: expected"),
    ],
)
def test_what_does_not_fit_the_robot_is_refused(text, message):
    with pytest.raises(ParamsError, match=message) as caught:
        build_loop(diagram_entry("hrp2_leg").scenario(text=text))
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(ParamsError, match=r"none\.yaml: no such YAML file"):
        read_mapping(tmp_path / "none.yaml")
    for name, text, message in (("bad", "a: [", "not (valid )?YAML"), ("list", "- 1", "expected a mapping, got")):
        path = Path(tmp_path / f"{name}.yaml")
        path.write_text(text)
        with pytest.raises(ParamsError, match=message):
            read_mapping(path)


def test_a_payload_in_a_model_file_reaches_plant_and_controller(tmp_path):
    """The leg carries 6 kg more at its shank: a controller that knows it holds, one that does not sags."""
    entry = diagram_entry("hrp2_leg")
    scenario = entry.scenario("hanging", text="{duration: 1.2, sensors: perfect, tare: 0.0, base_from: fixed}")
    robot = loop_robot(scenario)
    models = actuator_models(scenario, robot)
    payload = {"effect": "payload", "where": "r_shank", "mass": 6.0, "com_x": 0.1, "com_y": 0.0, "com_z": -0.1}
    for name, shared in (("after", [payload]), ("before", [])):
        ModelFile(models, shared=shared).save(tmp_path / f"{name}.yaml")
    known = replace(scenario, actuators=str(tmp_path / "after.yaml"))
    unknown = replace(known, model=str(tmp_path / "before.yaml"))
    errors = {}
    for name, each in (("plain", scenario), ("known", known), ("unknown", unknown)):
        recording = simulate_scenario(each)
        errors[name] = np.abs(recording.tracking_error[-1]).max()
    assert errors["known"] < 1.5 * errors["plain"]
    assert errors["unknown"] > 3.0 * errors["known"]
