"""Arguments that do not fit each other, or are of another kind, are told in one line."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough, VectorLogSink

from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.analysis.sampled import linearise
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError
from drake_tc.hardware.loop import RealTimeLoop
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.scenarios import FilterSpec
from drake_tc.loops.torque.wiring import add_torque_loop, torque_controller
from drake_tc.loops.whole_body.scenario import WholeBodySpec
from drake_tc.robot.robot import load_robot
from tests.robot_files import joint_tag, link_tag, urdf, write_robot


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    text = urdf(
        link_tag("upper", (0.1, 0, 0), 1.0, (0.01, 0.01, 0.01)),
        link_tag("fore", (0.1, 0, 0), 0.5, (0.01, 0.01, 0.01)),
        joint_tag("shoulder", "base", "upper", axis=(0, 0, 1)),
        joint_tag("elbow", "upper", "fore", axis=(0, 1, 0), xyz=(0.2, 0, 0)),
    )
    return load_robot(write_robot(tmp_path_factory.mktemp("arm"), text, ["shoulder", "elbow"]))


GAINS = TorqueGains(*[np.ones(2)] * 4)
"""Given, as the default ones are searched for."""


def models(names=("shoulder", "elbow")):
    return [ActuatorModel(name, Drive("position_servo", 1e-3)) for name in names]


def loop(arm, *arguments, given=None, **options):
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, arm)
    return add_torque_loop(
        builder, plant, arm, models() if given is None else given, *arguments, gains=GAINS, **options
    )


CASES = {
    "reference": (lambda arm: loop(arm, np.zeros(2)), "reference: expected a trajectory .* got ndarray"),
    "motion": (lambda arm: torque_controller(arm, models(), "inputs", gains=GAINS), "motion: expected .* got 'inputs'"),
    "motion without output": (
        lambda arm: torque_controller(arm, models(), VectorLogSink(6), gains=GAINS),
        "motion: expected a system with an output port of size 6",
    ),
    "order of models": (
        lambda arm: loop(arm, given=models(("elbow", "shoulder"))),
        "models: expected the order shoulder, elbow, got a list in the order elbow, shoulder",
    ),
    "stage": (lambda arm: loop(arm, stages={"guard": 3}), "stages: 'guard': expected a Drake system, got int"),
    "between": (
        lambda arm: loop(arm, stages={"torque_control.command": ConstantVectorSource(np.zeros(2))}),
        "expected a system with an input and an output port, got ConstantVectorSource",
    ),
    "window": (lambda arm: FilterSpec(window=10.5), "window: expected a whole number from 1 to 10000"),
    "posture": (
        lambda arm: add_robot_plant(DiagramBuilder(), arm, posture_deviation=-1.0),
        "posture_deviation: expected a number >= 0",
    ),
    "state": (lambda arm: WholeBodySpec(state="plants"), "state: expected one of .* got 'plants'"),
    "real-time controller": (lambda arm: RealTimeLoop(arm, object()), "controller: expected .* got Robot"),
    "driver": (
        lambda arm: RealTimeLoop(torque_controller(arm, models(), gains=GAINS), object()),
        r"link: expected an object with read\(\) and write\(\), got none with read\(\)",
    ),
    "period": (
        lambda arm: linearise(d := torque_controller(arm, models(), gains=GAINS), d.CreateDefaultContext(), 0.0),
        "linearise: expected a positive period dt",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_it_is_told_in_one_line(arm, case):
    call, message = CASES[case]
    with pytest.raises(ParamsError, match=message) as error:
        call(arm)
    assert "\n" not in str(error.value)


def test_a_plant_whose_robot_has_another_name_is_told(arm):
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(1e-3))
    Parser(plant).AddModelsFromString(
        arm.urdf.read_text("utf-8").replace('robot name="arm"', 'robot name="r2"'), "urdf"
    )
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    with pytest.raises(ParamsError, match="expected a model instance 'arm', the name in the robot file, got r2"):
        add_torque_loop(builder, plant, arm, models(), gains=GAINS)


def test_a_force_reference_of_another_size_is_told(arm):
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, arm)
    source = builder.AddSystem(ConstantVectorSource(np.zeros(5)))
    with pytest.raises(ParamsError, match="force_reference: expected a port of size 0, six per F/T sensor, got size 5"):
        add_torque_loop(builder, plant, arm, models(), gains=GAINS, force_reference=source.get_output_port())


def test_a_system_in_between_that_fits_is_taken(arm):
    assert "torque_control" in loop(arm, stages={"torque_control.command": PassThrough(2)}).systems


@pytest.mark.parametrize("step", [7e-4, 3e-3])
def test_a_step_of_the_plant_that_does_not_divide_the_period_is_told(arm, step):
    builder = DiagramBuilder()
    plant = add_robot_plant(builder, arm, step)
    with pytest.raises(ParamsError, match=r"plant: expected a time step of 0.001 s, the period of the control"):
        add_torque_loop(builder, plant, arm, models(), gains=GAINS)
