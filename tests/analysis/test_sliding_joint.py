"""Loops of joints that slide: what they move, and the plant of a rig without a robot."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.analysis.before_after.case import Slide, Swing, fitted_slide, write_pendulum_robot
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.coupling import coupling
from drake_tc.robot.robot import load_robot

TIME = np.linspace(0.0, 10.0, 2000)
VELOCITY, ACCELERATION = np.cos(TIME), -np.sin(TIME)


@pytest.fixture
def robot_file(tmp_path):
    """A level pendulum and a mass of 12 kg on an axis that rises by 30 degrees."""
    return write_pendulum_robot({"swing": Swing(0.3, 4.0), "z": Slide(12.0, 6.0 * 9.81)}, tmp_path)


@pytest.fixture
def two_joints(robot_file):
    """Their plant."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(robot_file.with_name("pendulums.urdf")))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant


def test_the_plant_of_a_sliding_mass_has_its_mass_and_weight(two_joints):
    context = two_joints.CreateDefaultContext()
    at = two_joints.GetJointByName("z").velocity_start()
    assert two_joints.CalcMassMatrix(context)[at, at] == pytest.approx(12.0, rel=1e-9)
    for position in (0.0, 0.7):
        two_joints.SetPositions(context, np.full(2, position))
        assert -two_joints.CalcGravityGeneralizedForces(context)[at] == pytest.approx(6.0 * 9.81, rel=1e-6)


def test_gravity_has_no_stiffness_along_an_axis(robot_file):
    found = coupling(load_robot(robot_file), np.array([0.2, 0.1]))
    assert found.inertia[1, 1] == pytest.approx(12.0, rel=1e-9)
    assert found.inertia[0, 1] == found.gravity[0, 1] == found.gravity[1, 1] == 0.0
    assert found.gravity[0, 0] == pytest.approx(4.0 * np.cos(0.2), rel=1e-6)


def test_a_measured_load_is_a_mass_with_its_weight():
    slide, share = fitted_slide(VELOCITY, ACCELERATION, 12.0 * ACCELERATION + 58.9)
    assert (slide.mass, slide.weight, share) == (pytest.approx(12.0), pytest.approx(58.9), pytest.approx(1.0))


def test_another_load_is_none():
    process = 12.0 * ACCELERATION + 80.0 * np.sin(3.3 * TIME)
    assert fitted_slide(VELOCITY, ACCELERATION, process) is None
    assert fitted_slide(VELOCITY, ACCELERATION, 1.0 * ACCELERATION + 200.0) is None  # no weight of 1 kg


def test_a_weight_beyond_the_mass_is_refused():
    with pytest.raises(ParamsError, match="sliding mass"):
        Slide(1.0, 20.0)
