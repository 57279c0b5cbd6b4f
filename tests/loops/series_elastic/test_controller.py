"""The series-elastic torque control without a plant commands what the simulated loop has commanded."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial

import drake_tc.models
from drake_tc.actuation.model_file import load_models
from drake_tc.actuation.recorded_run import Link
from drake_tc.hardware.stepper import ControllerStepper
from drake_tc.loops.joint_bench import JOINT, make_plant
from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec
from drake_tc.loops.series_elastic.wiring import INPUTS, add_series_elastic_loop, series_elastic_controller

ACTUATORS = Path(drake_tc.models.__file__).parent / "coman_like" / "coman_like_actuators.yaml"


@pytest.mark.parametrize("source", ["gauge", "deflection"])
def test_commands_are_those_of_the_simulated_loop(source):
    model = replace(next(iter(load_models(ACTUATORS).values())), joint=JOINT)
    spec = SeriesElasticLoopSpec(torque_from=source)
    path = PiecewisePolynomial.FirstOrderHold([0.0, 0.1, 0.2], np.array([[0.0, 5.0, -3.0]]))
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", make_plant(Link(0.5, 5.0), spec.dt))
    loop = add_series_elastic_loop(builder, plant, [model], path, spec)
    log = loop.add_log(builder, *INPUTS, "voltage")
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.2)
    signals = log.recorded(simulator.get_context())[1]
    controller = series_elastic_controller([JOINT], [model], path, spec, fused=source == "gauge")
    stepper = ControllerStepper(controller, spec.dt, ["command", "measured_torque"])
    assert set(stepper.inputs) == {"motor_position", "spring_torque" if source == "gauge" else "position"}
    read = [name for name, port in INPUTS.items() if port in stepper.inputs]
    ticks = range(len(signals["voltage"]))
    found = [stepper.tick({INPUTS[name]: signals[name][k] for name in read})["command"] for k in ticks]
    assert np.ptp(found) > 1.0
    assert_array_equal(found, signals["voltage"])
