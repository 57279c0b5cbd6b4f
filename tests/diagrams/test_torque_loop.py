"""The torque loop to copy, held against the one that a scenario builds."""

import json

import numpy as np
from numpy.testing import assert_allclose
from pydrake.systems.analysis import Simulator
from typer.testing import CliRunner

from drake_tc.cli.main import app
from drake_tc.diagrams import torque_loop
from drake_tc.loops.scenarios import GainSpec, MotionSpec
from drake_tc.loops.torque.running import simulate_scenario
from drake_tc.loops.torque.scenario import Scenario

NAME = "drake_tc.diagrams.torque_loop:build"


def test_it_is_the_loop_of_a_scenario_of_the_same_numbers():
    duration = 1.3
    knots = {joint: list(values) for joint, values in torque_loop.KNOTS.items()}
    scenario = Scenario(str(torque_loop.ROBOT), duration=duration, tare=0.0).changed(
        motion=_motion(knots), gains=GainSpec(k6=1.0, k7=0.01, kp=2.0)
    )
    recording = simulate_scenario(scenario)
    diagram = torque_loop.build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(duration)
    state = diagram.GetSubsystemByName("log_joint_state").FindLog(simulator.get_context()).data().T
    assert_allclose(
        state, recording["joint_state"], rtol=0, atol=2e-6
    )  # inertias of the drives, at another default posture
    assert np.ptp(state[:, 3]) > 0.5  # the knee did move


def _motion(knots):
    rest = {joint: values[0] for joint, values in knots.items()}
    return MotionSpec(
        {f"r_{name}": 0.0 for name in ("hip_yaw", "hip_roll", "ankle_roll")} | rest, torque_loop.TIMES, knots
    )


def test_commands_take_it():
    outcome = CliRunner().invoke(app, ["graph", NAME, "--format", "json"], catch_exceptions=False)
    blocks = {block["name"] for block in json.loads(outcome.stdout)["blocks"]}
    assert blocks >= {"inverse_dynamics", "torque_control", "torque_estimator", "guard", "fault_monitor", "filter"}


def test_its_program_prints_small_errors(capsys, monkeypatch):
    monkeypatch.setattr(torque_loop, "DURATION", 1.3)
    torque_loop.main()
    errors = [float(line.split()[1]) for line in capsys.readouterr().out.splitlines()]
    assert len(errors) == 6 and max(errors) < 3.0  # mrad
