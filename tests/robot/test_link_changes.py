"""What `close-loop` found of links reaches every plant: the robot file's actuators name it, nothing else is needed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from robot_files import write_robot

from drake_tc.actuation.model import ActuatorModel, Drive
from drake_tc.actuation.model_file import ModelFile
from drake_tc.errors import ParamsError
from drake_tc.robot.link_changes import NAMES, parameters_of
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import load_robot
from tests.robot.robots import ARM

JOINTS = ["shoulder", "slide", "spin", "wrist"]
"""`hand` hangs on `wrist`, `mark` is welded to `wheel`."""


def written(folder, shared=(), links=None):
    models = {joint: ActuatorModel(joint, Drive("current", 0.5)) for joint in JOINTS}
    ModelFile(models, shared=shared, links=links).save(folder / "model_after.yaml")
    return write_robot(folder, ARM, JOINTS, actuators="model_after.yaml")


def weight_of(robot, q):
    """(n,) torques of gravity."""
    plant = make_plant(robot, 0.0)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    return -plant.CalcGravityGeneralizedForces(context), plant.CalcMassMatrix(context)


def test_a_payload_is_a_point_mass_on_its_link(tmp_path):
    """Independent: Drake's own plant with a body welded there."""
    payload = {"effect": "payload", "where": "hand", "mass": 1.3, "com_x": 0.02, "com_y": -0.04, "com_z": -0.1}
    robot = load_robot(written(tmp_path, [payload, {"effect": "ft_bias", "where": "wrist", "fx": 3.0}]))
    extra = (
        '<link name="load"><inertial><mass value="1.3"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
        '</inertial></link><joint name="held" type="fixed"><parent link="hand"/><child link="load"/>'
        '<origin xyz="0.02 -0.04 -0.1"/></joint></robot>'
    )
    (other := tmp_path / "other").mkdir()
    loaded = write_robot(other, ARM.replace("</robot>", extra), JOINTS)
    q = np.array([0.3, 0.2, 0.5, -0.7])
    for found, expected in zip(weight_of(robot, q), weight_of(load_robot(loaded), q), strict=True):
        assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    bare = load_robot(robot.source, found_links=False)
    assert np.abs(weight_of(bare, q)[0] - weight_of(robot, q)[0]).max() > 0.5


def test_masses_and_centres_move_the_link_with_what_is_welded_to_it(tmp_path):
    shared = [
        {"effect": "link_mass", "where": "upper", "mass": 0.5},
        {"effect": "link_com", "where": "upper", "com_x": 0.01, "com_y": 0.0, "com_z": -0.02},
    ]
    found = parameters_of(make_plant(load_robot(written(tmp_path, shared)), 0.0), "upper")[1]
    before = parameters_of(make_plant(load_robot(tmp_path / "arm.yaml", found_links=False), 0.0), "upper")[1]
    assert_allclose(found[0], before[0] + 0.5, rtol=1e-12)
    assert_allclose(found[1:4] / found[0], before[1:4] / before[0] + [0.01, 0.0, -0.02], atol=1e-12)


def test_fitted_parameters_are_those_of_the_plant(tmp_path):
    pi = np.array([0.9, 0.05, 0.01, -0.02, 0.02, 0.0, 0.001, 0.03, 0.0, 0.02])
    links = {"wheel": dict(zip(NAMES, pi.tolist(), strict=True))}
    robot = load_robot(written(tmp_path, links=links))
    assert_allclose(parameters_of(make_plant(robot, 0.0), "wheel")[1], pi, atol=1e-12)


@pytest.mark.parametrize(
    ("cause", "says"),
    [
        ({"effect": "link_mass", "where": "nowhere", "mass": 1.0}, "no link 'nowhere' in the robot"),
        ({"effect": "link_mass", "where": "hand", "mass": -0.7}, r"link 'hand' of 0\.5 kg cannot be changed by"),
        ({"effect": "payload", "where": "hand", "mass": 1.0}, "missing: com_x, com_y, com_z"),
        ({"effect": "link_mass", "where": "hand", "mas": 0.2}, "expected the numbers mass, got mas: 0.2"),
    ],
)
def test_what_cannot_be_is_refused_with_the_file(tmp_path, cause, says):
    with pytest.raises(ParamsError, match=rf"model_after\.yaml.*{says}"):
        make_plant(load_robot(written(tmp_path, [cause])), 0.0)
