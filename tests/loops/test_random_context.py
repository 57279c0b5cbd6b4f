"""Drake's own randomness: a random context is another robot of its kind, the same for the same generator."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import MonteCarloSimulation, Simulator
from pydrake.systems.framework import DiagramBuilder
from sweeps import slow_but

import drake_tc.models
from drake_tc.actuation.model_file import load_models
from drake_tc.loops.fused import fuse
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.corruption import Corruption
from drake_tc.sensing.spec import SensorSpec

LEG = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_leg.yaml"
SENSORS = ("encoder", "imu", "force_torque")


def built(*, fused=False, sensors="realistic", deviation=0.01):
    robot, builder = load_robot(LEG), DiagramBuilder()
    plant = add_robot_plant(builder, robot, posture_deviation=deviation)
    loop = add_torque_loop(builder, plant, robot, load_models(robot.actuators), None, TorqueLoopSpec(sensors=sensors))
    log = loop.add_log(builder, "joint_state", *SENSORS)
    if fused:
        fuse(builder)
    return builder.Build(), log


def run(diagram, log, seed):
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    if seed is not None:
        diagram.SetRandomContext(context, RandomGenerator(seed))
    simulator.AdvanceTo(0.3)
    return log.recorded(context)[1]


@pytest.mark.parametrize("late", slow_but((0.0, 0.002), 0.002))
def test_noise_biases_and_first_positions_are_drawn_and_fused_stages_draw_the_same(late):
    sensors = {"preset": "realistic", "encoder": {"latency": late}}
    loop = built(sensors=sensors)
    default, one, again, other = (run(*loop, seed) for seed in (None, 1, 1, 2))
    fused = run(*built(sensors=sensors, fused=True), 1)
    for name in ("joint_state", *SENSORS):
        assert_array_equal(one[name], again[name])
        assert not np.array_equal(one[name], other[name]), name
        assert not np.array_equal(one[name], default[name]), name
        assert_array_equal(one[name], fused[name])
    robot = load_robot(LEG)
    start = one["joint_state"][0, :6] - robot.posture
    assert 0.001 < np.abs(start).max() < 0.05
    limits = joint_limits(robot)
    assert ((limits.lower <= one["joint_state"][0, :6]) & (one["joint_state"][0, :6] <= limits.upper)).all()


def test_without_a_deviation_the_robot_starts_in_its_posture():
    assert_array_equal(run(*built(deviation=0.0), 3)["joint_state"][0, :6], load_robot(LEG).posture)


def test_monte_carlo_simulations_differ_and_repeat():
    diagram, _ = built()

    def make(generator):
        simulator = Simulator(diagram)
        simulator.Initialize()
        return simulator

    def output(system, context):
        imu = system.GetSubsystemByName("imu")
        return float(imu.GetOutputPort("reading").Eval(imu.GetMyContextFromRoot(context)).sum())

    runs = [
        [each.output for each in MonteCarloSimulation(make, output, 0.05, 2, RandomGenerator(seed))]
        for seed in (0, 0, 1)
    ]
    assert len({*runs[0]}) == 2
    assert runs[0] == runs[1] != runs[2]


def test_drawn_biases_have_the_described_size():
    sensor = Corruption(1, SensorSpec(bias=2.0, noise=0.1), 1e-3, seed=5)
    biases = np.array([sensor.drawn(draw).offsets(0).mean() for draw in np.linspace(0.1, 3.0, 400)])
    assert abs(biases.mean()) < 0.35 and biases.std() == pytest.approx(2.0, rel=0.12)
    assert sensor.drawn(0.0) is sensor
