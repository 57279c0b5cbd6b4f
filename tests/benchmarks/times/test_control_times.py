"""What one tick of the control systems costs for six joints; printed as rows (run with -s)."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import drake_tc.models
from drake_tc.actuation.model_file import load_models
from drake_tc.control.gains import TorqueGains
from drake_tc.control.guard import CommandGuard
from drake_tc.control.inverse_dynamics import InverseDynamics
from drake_tc.control.torque_control import TorqueControl
from drake_tc.robot.robot import load_robot

from .machine import require

pytestmark = pytest.mark.benchmark
ROBOT = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_leg.yaml"


def evaluations(system, output: str, count: int = 800) -> list[float]:
    """Seconds of each evaluation of an output, all inputs changed before it."""
    context = system.CreateDefaultContext()
    ports = [system.get_input_port(i) for i in range(system.num_input_ports())]
    waves = [np.arange(port.size()) for port in ports]
    out = system.GetOutputPort(output)
    seconds = []
    for k in range(count):
        for port, wave in zip(ports, waves, strict=True):
            port.FixValue(context, np.zeros(1) if port.get_name() == "fault" else 0.1 * np.sin(0.01 * k + wave))
        start = time.perf_counter()
        out.Eval(context)
        seconds.append(time.perf_counter() - start)
        if system.num_discrete_state_groups():
            context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
    return seconds


@pytest.fixture(scope="module")
def leg():
    robot = load_robot(ROBOT)
    models = load_models(robot.actuators)
    models = [models[name] for name in robot.joints]
    gains = TorqueGains.from_servo(models, 1.0, 0.01, 2.0, kf=np.ones(6 * len(robot.force_torque)))
    return robot, models, gains


def test_inverse_dynamics(leg):
    robot, _, gains = leg
    row, system = "InverseDynamics, 6 joints, 1 contact", InverseDynamics(robot, gains)
    require({row: 50e-6}, lambda: {row: evaluations(system, "desired_torque")})


def test_torque_control(leg):
    _, models, gains = leg
    system = TorqueControl(models, replace(gains, ki=np.ones(6)), np.full(6, 200.0))
    command, components = "TorqueControl, 6 joints of 5 effects, command", "TorqueControl, components, for a log only"
    outputs = {command: "command", components: "components"}
    goals = {command: 20e-6, components: 45e-6}
    require(goals, lambda: {row: evaluations(system, output) for row, output in outputs.items()})


def test_guard():
    row, system = "CommandGuard, 6 joints", CommandGuard(6, 1e-3)
    require({row: 12e-6}, lambda: {row: evaluations(system, "command")})
