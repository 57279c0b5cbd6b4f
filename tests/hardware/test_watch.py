"""The models of a controller that runs: learned from a sound run, watched in the next ones."""

import json
from dataclasses import replace

import numpy as np
import pytest

from drake_tc.actuation.model import Drive
from drake_tc.actuation.model_file import load_models
from drake_tc.cli.main import run
from drake_tc.control.guard import GuardSpec
from drake_tc.control.torque_uncertainty_file import load_torque_uncertainty, save_torque_uncertainty
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.hardware.link import CallbackLink
from drake_tc.hardware.loop import RealTimeLoop, RealTimeSpec
from drake_tc.hardware.simulated_robot import SimulatedRobot
from drake_tc.hardware.watch import ModelWatch
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import torque_controller
from drake_tc.loops.whole_body.wiring import whole_body_controller
from drake_tc.robot.robot import load_robot
from drake_tc.tsid.configuration import load_law
from drake_tc.watch.health import ModelHealth
from drake_tc.watch.monitor import CAUSES
from tests.hardware.test_loop import ROBOT, Steps

SPEC = TorqueLoopSpec(dt=1e-3, tare=0.0)
QUICK = RealTimeSpec(arm_time=0.0, stop_time=0.02, guard=GuardSpec(start_time=0.0, offset_limit=0.5, rate_limit=50.0))
SECONDS = 7.5


def swinging():
    """A controller that moves all joints up and down, again and again."""
    made = load_robot(ROBOT)
    away = made.posture + np.array([0.15, 0.12, 0.25, 0.3, 0.25, 0.12])
    times = np.arange(0.3, SECONDS + 2.0, 0.7)
    knots = np.array([made.posture if k % 2 == 0 else away for k in range(times.size)])
    return torque_controller(made, load_models(made.actuators), knot_trajectory(times, knots), SPEC, fused=True)


def watched_run(watch, controller, scale=None, seconds=SECONDS):
    """The report of a run on a simulated leg whose drive gains differ from the models by factors."""
    made, clock = load_robot(ROBOT), Steps()
    models = load_models(made.actuators)
    for joint, factor in (scale or {}).items():
        drive = models[joint].drive
        models[joint] = replace(models[joint], drive=Drive(drive.kind, factor * drive.gain))
    leg = SimulatedRobot(made, models, SPEC)

    def write(sent):
        leg.advance(sent["command"])
        clock.work(0)

    return RealTimeLoop(controller, CallbackLink(leg.read, write), QUICK, clock, watch).run(seconds)


@pytest.fixture(scope="module")
def health(tmp_path_factory):
    controller = swinging()
    watch = ModelWatch(controller)
    report = watched_run(watch, controller)
    assert report.counts.watch_errors == 0 and report.watch["events"] == []
    path = tmp_path_factory.mktemp("watch") / "watch.yaml"
    save_torque_uncertainty(watch.learned().uncertainty(), path)
    return ModelHealth.of(load_torque_uncertainty(path))


def test_a_sound_run_names_nothing_and_a_weaker_motor_is_named_with_its_joint(health):
    controller = swinging()
    assert watched_run(ModelWatch(controller, health), controller, seconds=2.5).watch["events"] == []
    controller = swinging()
    watch = ModelWatch(controller, health)
    report = watched_run(watch, controller, {"r_knee": 1.0 / 0.85}, 3.2)
    document = json.loads(json.dumps(report.to_json()))["watch"]
    assert {event["joint"] for event in document["events"]} == {"r_knee"}
    assert document["events"][0]["begin"] < 3.0
    assert str(watch.events[0]).startswith("r_knee: ")


def test_a_watch_that_fails_ends_and_the_run_goes_on(health):
    controller = swinging()
    watch = ModelWatch(controller, health)

    def fail(found, position):
        raise ValueError("no more")

    watch.tick = fail
    report = watched_run(watch, controller, seconds=1.0)
    assert (report.counts.watch_errors, report.last_error, report.ended) == (1, "ValueError: no more", "duration")


def test_only_torque_control_is_watched_and_health_names_the_joint_that_it_lacks(health):
    law = load_law(ROBOT.parents[1] / "coman_like" / "coman_like_tsid.yaml")
    with pytest.raises(ParamsError, match="expected the torque control of a robot"):
        ModelWatch(whole_body_controller(law), health)
    with pytest.raises(ParamsError, match="no joint 'r_hip_yaw'"):
        ModelWatch(swinging(), ModelHealth(("a",), np.ones(1), np.ones(1), np.zeros((1, len(CAUSES)))))
    with pytest.raises(ParamsError, match="expected a watch without `health`"):
        ModelWatch(swinging(), health).learned()


def test_the_command_watches_and_says_what_a_run_lacks_to_learn_from(health, tmp_path, capsys):
    known, learned = tmp_path / "known.yaml", tmp_path / "learned.yaml"
    save_torque_uncertainty(health.uncertainty(), known)
    loop = ["run", "drake_tc.diagrams.hardware_loop:controller", "--robot", "drake_tc.diagrams.hardware_loop:link"]
    loop += ["--duration", "0.3", "--stop-time", "0.01"]
    assert run([*loop, "--watch", str(known), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["watch"]["events"] == [] and document["counts"]["watch_errors"] == 0
    assert run([*loop, "--watch", str(known)]) == 0
    assert "model: no change" in capsys.readouterr().out
    assert run([*loop, "--learn-watch", str(learned)]) == 2
    told = capsys.readouterr()
    assert "expected at least 5 s of motion" in told.err and not learned.exists()
    assert "ended by" in told.out and "model:" not in told.out
    assert run([*loop, "--learn-watch", str(learned), "--watch", str(known)]) == 2
