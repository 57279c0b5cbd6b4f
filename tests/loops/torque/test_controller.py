"""The torque controller without a plant commands what the simulated loop whose readings it gets has commanded."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LinearSystem
from sweeps import slow_but

import drake_tc.diagrams
import drake_tc.models
from drake_tc.actuation.model_file import load_models
from drake_tc.actuation.wiring import sliding
from drake_tc.analysis.sampled import linearise
from drake_tc.control.gains import TorqueGains
from drake_tc.control.trajectories import knot_trajectory
from drake_tc.errors import ParamsError
from drake_tc.estimation.disturbance_observer import ObserverSpec, PredictorSpec
from drake_tc.hardware.stepper import ControllerStepper
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.running import build_loop, run_loop
from drake_tc.loops.torque.scenario import Scenario, TorqueLoopSpec
from drake_tc.loops.torque.wiring import INPUTS, add_torque_loop, scenario_controller, torque_controller
from drake_tc.report.block_graph.graph import block_graph
from drake_tc.robot.robot import load_robot
from drake_tc.sensing.spec import SensorFault

DIAGRAMS = Path(next(iter(drake_tc.diagrams.__path__)))
LEG = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_leg.yaml"
N, DT = 6, 1e-3
SPECS = {
    "defaults": (TorqueLoopSpec(), 0.0),
    "forces": (TorqueLoopSpec(log_components=True), 0.3),
    "servo": (TorqueLoopSpec(controller="servo"), 0.0),
    "sensor": (TorqueLoopSpec(torque_from="sensor", sensors="perfect"), 0.0),
    "observer": (TorqueLoopSpec(predictor=PredictorSpec(), observer=ObserverSpec()), 0.0),
    "encoder_lost": (TorqueLoopSpec(faults={"encoder": (SensorFault("dropped", 0.25, 0.3, channels=(3,)),)}), 0.0),
}


def scaled(factor):
    nil = np.zeros((0, N))
    return LinearSystem(np.zeros((0, 0)), nil, nil.T, factor * np.eye(N), DT)


def swing(robot):
    there = robot.posture + np.array([0.0, 0.0, -0.2, 0.3, -0.1, 0.0])
    return knot_trajectory([0.1, 0.4], np.array([robot.posture, there]))


def simulated(spec, feedback, duration=0.4, **options):
    """Readings and commands of the simulated loop, at each tick."""
    robot, builder = load_robot(LEG), DiagramBuilder()
    models = load_models(robot.actuators)
    plant = add_robot_plant(builder, robot)
    gains = TorqueGains.from_servo(models, k6=1.0, k7=0.01, kp=2.0, kf=np.full(6, feedback))
    loop = add_torque_loop(builder, plant, robot, models, swing(robot), spec, gains=gains, **options)
    log = loop.add_log(builder, *{*INPUTS, "command"})
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(duration)
    return robot, models, gains, log.recorded(simulator.get_context())[1]


def commands(controller, signals):
    stepper = ControllerStepper(controller, DT)
    nothing = {"force_reference": np.zeros(6)} if "force_reference" in stepper.inputs else {}
    ports = [name for name, port in INPUTS.items() if port in stepper.inputs]
    assert set(stepper.inputs) == {INPUTS[name] for name in ports} | set(nothing)
    ticks = range(len(signals["command"]))
    given = ({INPUTS[name]: signals[name][k] for name in ports} | nothing for k in ticks)
    return np.array([stepper.tick(readings)["command"] for readings in given])


@pytest.mark.parametrize(
    ("name", "fused"),
    slow_but(product(SPECS, (False, True)), ("forces", True), ("observer", False), ("encoder_lost", True)),
)
def test_commands_are_those_of_the_simulated_loop(name, fused):
    spec, feedback = SPECS[name]
    robot, models, gains, signals = simulated(spec, feedback)
    controller = torque_controller(robot, models, swing(robot), spec, gains=gains, fused=fused)
    found = commands(controller, signals)
    assert np.ptp(found, axis=0).max() > 0.02  # the leg was moved
    assert_array_equal(found, signals["command"])


def test_a_stage_of_ones_own_and_one_between_stand_in_the_controller_as_in_the_loop():
    between = "inverse_dynamics.desired_torque"
    robot, models, gains, signals = simulated(TorqueLoopSpec(), 0.0, stages={between: scaled(0.5)})
    controller = torque_controller(robot, models, swing(robot), gains=gains, stages={between: scaled(0.5)})
    assert_array_equal(commands(controller, signals), signals["command"])
    plain = torque_controller(robot, models, swing(robot), gains=gains)
    assert np.abs(commands(plain, signals) - signals["command"]).max() > 1e-3
    with pytest.raises(ParamsError, match="no stage or port 'guards' in this loop"):
        torque_controller(robot, models, stages={"guards": scaled(1.0)})


def test_the_reference_can_come_in_through_a_port():
    robot, models, gains, signals = simulated(TorqueLoopSpec(), 0.0)
    stepper = ControllerStepper(torque_controller(robot, models, "input", gains=gains), DT)
    path = [swing(robot).MakeDerivative(order) if order else swing(robot) for order in range(3)]
    inputs = ("encoder", "imu", "force_torque")
    for k in range(len(signals["command"])):
        reference = np.concatenate([each.value(k * DT)[:, 0] for each in path])
        if not 0.1 <= k * DT <= 0.4:
            reference[N:] = 0.0
        found = stepper.tick({INPUTS[name]: signals[name][k] for name in inputs} | {"reference": reference})
        np.testing.assert_allclose(found["command"], signals["command"][k], rtol=0.0, atol=1e-9)


def test_graph_and_linear_analysis_take_the_controller():
    """q_d = q + K_tau tau_d with tau_d = ... + Ks (q_ref - q) and K_tau Ks = K6 has the derivative 1 - K6 by q."""
    robot = load_robot(LEG)
    models = sliding(load_models(robot.actuators))
    gains = TorqueGains.from_servo(models, k6=0.4, k7=0.0, kp=0.0)
    controller = torque_controller(robot, models, spec=TorqueLoopSpec(sensors="perfect", tare=0.0), gains=gains)
    one = block_graph(torque_controller(robot, load_models(robot.actuators), fused=True))
    stages = {block.name: block.stage for block in one.blocks}
    assert stages["stages"] == stages["command_output"] == "control"
    assert stages["position"] == stages["imu"] == stages["force_torque"] == "sensing"
    assert stages["reference"] == "reference"
    graph = block_graph(controller)
    named = {block.name for block in graph.blocks}
    assert {"guard", "torque_control", "inverse_dynamics", "position", "command_output"} <= named
    simulator = Simulator(controller)
    context = simulator.get_mutable_context()
    for name, value in {"position": robot.posture, "imu": [0, 0, 0, 0, 0, 9.81], "force_torque": np.zeros(6)}.items():
        controller.GetInputPort(name).FixValue(context, np.array(value, dtype=float))
    simulator.AdvanceTo(1.0)
    system = linearise(controller, context, DT, inputs=["position:y"], outputs=["guard:command"])
    np.testing.assert_allclose(system.d, 0.6 * np.eye(N), atol=1e-6)


def test_the_controller_of_a_scenario_commands_what_its_loop_has_commanded():
    scenario = Scenario.load(DIAGRAMS / "hrp2_leg.scenario.yaml", "stairs_swing", "{duration: 1.2}")
    run = run_loop(build_loop(scenario, fused=True))
    stepper = ControllerStepper(scenario_controller(scenario), scenario.dt)
    read = [name for name, port in INPUTS.items() if port in stepper.inputs]
    ticks = range(len(run.time))
    found = [stepper.tick({INPUTS[name]: run[name][k] for name in read})["command"] for k in ticks]
    assert np.ptp(run["command"], axis=0).max() > 0.1
    assert_array_equal(found, run["command"])
