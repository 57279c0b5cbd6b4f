"""How long estimation and supervision take each tick; printed as rows (run with -s)."""

import time
from pathlib import Path

import numpy as np
import pytest

import drake_tc.models
from drake_tc.estimation.joint_torque import JointTorqueEstimator, MomentumResidual
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.robot.robot import load_robot
from drake_tc.sensor_validation.fault_monitor import FaultMonitor

from .machine import require

pytestmark = pytest.mark.benchmark
MODELS = Path(next(iter(drake_tc.models.__path__)))
ROBOTS = {"leg": MODELS / "hrp2_like" / "hrp2_like_leg.yaml", "humanoid": MODELS / "hrp2_like" / "hrp2_like.yaml"}
TICK = 1e-3


@pytest.fixture(scope="module", params=list(ROBOTS))
def case(request):
    """(name, robot, kernel)."""
    robot = load_robot(ROBOTS[request.param])
    return request.param, robot, TorqueModel(robot)


def test_torque_model(case):
    name, _, model = case
    n = model.size
    rng = np.random.default_rng(0)
    q, v, vdot = rng.normal(size=(3, n))
    imu, gyro_dot, wrench = rng.normal(size=6), rng.normal(size=3), rng.normal(size=6 * model.num_sensors)
    row = f"TorqueModel.estimate, {name}"

    def estimates():
        seconds = []
        for k in range(1000):
            q[0] = 1e-6 * k
            start = time.perf_counter()
            model.estimate(MeasuredMotion(q, v, vdot, imu, gyro_dot), wrench)
            seconds.append(time.perf_counter() - start)
        return {row: seconds}

    require({row: 15e-6 if name == "leg" else 25e-6}, estimates)


def test_joint_torque_estimator(case):
    name, _, model = case
    system = JointTorqueEstimator(model)
    context = system.CreateDefaultContext()
    rng = np.random.default_rng(0)
    joint = rng.normal(size=3 * model.size)
    system.GetInputPort("imu_estimate").FixValue(context, rng.normal(size=12))
    system.GetInputPort("wrench_estimate").FixValue(context, rng.normal(size=6 * model.num_sensors))
    ports = [system.get_output_port(i) for i in range(system.num_output_ports())]
    row = f"JointTorqueEstimator, all ports, {name}"

    def estimates():
        seconds = []
        for k in range(1000):
            joint[0] = 1e-6 * k
            system.GetInputPort("joint_estimate").FixValue(context, joint)
            start = time.perf_counter()
            for port in ports:
                port.Eval(context)
            seconds.append(time.perf_counter() - start)
        return {row: seconds}

    require({row: 25e-6 if name == "leg" else 30e-6}, estimates)


def require_update(row: str, system, values, goal: float) -> None:
    """Require a goal of each periodic update, the inputs changed before each."""
    context = system.CreateDefaultContext()

    def updates():
        seconds = []
        for k in range(500):
            for port, value in values.items():
                system.GetInputPort(port).FixValue(context, value + 1e-6 * k)
            start = time.perf_counter()
            context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))
            seconds.append(time.perf_counter() - start)
        return {row: seconds}

    require({row: goal}, updates)


def test_momentum_residual(case):
    name, _, model = case
    n = model.size
    values = {"joint_state": np.zeros(2 * n), "torque": np.zeros(n), "imu_estimate": np.ones(12)}
    goal = 80e-6 if name == "leg" else 180e-6
    require_update(f"MomentumResidual update, {name}", MomentumResidual(model, 30.0, TICK), values, goal)


def test_fault_monitor(case):
    name, robot, model = case
    n, k = model.size, model.num_sensors
    still = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.81])
    for what, imu in (("nothing wrong", still), ("IMU inconsistent", np.ones(6))):
        values = {"position": np.zeros(n), "imu": imu, "wrench": np.ones(6 * k), "torque_residual": np.zeros(n)}
        require_update(f"FaultMonitor update, {name}, {what}", FaultMonitor(robot, dt=TICK), values, 18e-6)
