"""A force/torque sensor inside a link: the robot stays the same, and its torques are those of Drake's reactions."""

from pathlib import Path

import numpy as np
import pytest
from estimation.machines import Push, Truth
from numpy.testing import assert_allclose
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot, load_robot

from .robots import robot_file

IMU = {"base": {"link": "base", "xyz": [0.1, 0.0, 0.2], "rpy": [0.1, 0.2, 0.3]}}
INSIDE = {"cell": {"link": "wheel", "mass_beyond": 0.3, "xyz": [0.01, 0.02, 0.1], "rpy": [0.3, -0.2, 0.5]}}


def _robot(folder: Path, force_torque: object = None) -> Robot:
    folder.mkdir(exist_ok=True)
    sensors = {} if force_torque is None else {"force_torque": force_torque}
    return load_robot(robot_file(folder, joints=["wrist", "shoulder", "slide"], imu=IMU, **sensors))


def _mass_matrix(robot: Robot) -> np.ndarray:
    plant = MultibodyPlant(0.0)
    add_robot(plant, robot)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.linspace(0.1, 0.25, plant.num_positions()))
    return np.asarray(plant.CalcMassMatrix(context))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_robot_is_the_same_with_the_link_in_one_piece(tmp_path, share):
    cut = {"cell": INSIDE["cell"] | {"mass_beyond": share}}
    whole, split = _mass_matrix(_robot(tmp_path / "a")), _mass_matrix(_robot(tmp_path / "b", cut))
    assert_allclose(split, whole, rtol=1e-12)


def test_torques_and_contacts_are_right_with_the_reading_of_drakes_reaction(tmp_path):
    robot = _robot(tmp_path, INSIDE)
    rng = np.random.default_rng(3)
    (mount,) = robot.force_torque
    assert mount.joint == "cell_inside_wheel" and mount.contact.link == "wheel_beyond_cell"
    push = Push(mount.contact, rng.uniform(-50.0, 50.0, 6))
    instant = Truth(robot).instant(rng, [push])
    model = TorqueModel(robot)
    found = model.estimate(MeasuredMotion(*instant[:5]), instant.readings)
    assert_allclose(found.torque, instant.torque, rtol=1e-8, atol=1e-8)
    assert_allclose(found.contact_wrench, push.wrench, rtol=1e-8, atol=1e-8)


def test_the_share_of_the_mass_matters(tmp_path):
    """At rest and untouched the sensor carries its share of the link and all that hangs on it."""
    readings = []
    for share in (0.25, 0.75):
        robot = _robot(tmp_path / str(share), {"cell": {"link": "wheel", "mass_beyond": share}})
        model = TorqueModel(robot, base="fixed")
        context, zero = model.create_context(), np.zeros(3)
        needed = model.reading_error(context, MeasuredMotion(zero, zero, zero, np.zeros(6), zero), np.zeros(6))
        readings.append(float(np.linalg.norm(needed[:3])) / 9.81)
    assert_allclose(readings, [0.25 * 0.4 + 0.5, 0.75 * 0.4 + 0.5], rtol=1e-9)  # the wheel's 0.4 kg, the hand's 0.5 kg


def test_the_contact_may_name_the_link_itself_and_the_imu_a_joint(tmp_path):
    cell = INSIDE["cell"] | {"contact": {"link": "wheel", "xyz": [0.0, 0.0, 0.1]}}
    robot = load_robot(robot_file(tmp_path, imu={"tip": {"joint": "mark_joint"}}, force_torque={"cell": cell}))
    assert robot.force_torque[0].contact.link == "wheel_beyond_cell"
    assert robot.imu[0].link == "mark"


REFUSED = [
    ({"cell": {"link": "wheel"}}, "force_torque.cell: mass_beyond is missing; expected the share of the link's mass"),
    ({"cell": {"link": "wheel", "mass_beyond": 1.2}}, "mass_beyond: expected a share between 0 and 1, got 1.2"),
    ({"cell": {"link": "weel", "mass_beyond": 0.3}}, "no link 'weel' in the URDF; did you mean 'wheel'?"),
    ({"cell": {"link": "wheel", "joint": "mark_joint", "mass_beyond": 0.3}}, "'joint' and 'link', got both"),
    ({"cell": {}}, "'joint' and 'link', got neither"),
    ({"cell": {"joint": "mark_joint", "mass_beyond": 0.3}}, "force_torque.cell.mass_beyond: it belongs to `link`"),
    ({"cell": {"joint": "mark_jiont"}}, "got 'mark_jiont'; did you mean 'mark_joint'?"),
    (
        {"cell": {"link": "base", "mass_beyond": 0.3}, "b": {"link": "base", "mass_beyond": 0.1}},
        "has the sensor 'cell'",
    ),
    (
        {"cell": INSIDE["cell"] | {"contact": {"link": "upper"}}},
        "expected a link beyond the sensor (hand, mark, wheel_beyond_cell), got 'upper'",
    ),
]


@pytest.mark.parametrize(("force_torque", "said"), REFUSED)
def test_what_cannot_be_is_refused(tmp_path, force_torque, said):
    with pytest.raises(ParamsError) as caught:
        load_robot(robot_file(tmp_path, force_torque=force_torque))
    assert said in str(caught.value) and "\n" not in str(caught.value)
