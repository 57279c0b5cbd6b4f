"""Limits of a designed motion of joints that slide."""

import numpy as np
import pytest

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.robot import robot_limits
from drake_tc.robot.robot import load_robot

URDF = """<robot name="axis"><link name="base"/><link name="carriage"><inertial><mass value="12"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="1 0 0"/>{limit}</joint></robot>
"""


@pytest.fixture
def axis(tmp_path):
    def made(limit):
        (tmp_path / "axis.urdf").write_text(URDF.format(limit=limit))
        path = tmp_path / "axis.yaml"
        path.write_text("{name: axis, urdf: axis.urdf, base: base, fixed_base: true, joints: [x]}")
        return load_robot(path)

    return made


def test_a_joint_that_slides_without_limits_is_not_moved_blindly(axis):
    with pytest.raises(ParamsError, match="joint x is prismatic and has no position limits"):
        robot_limits(axis(""))


def test_its_limits_are_in_metres_and_its_speed_is_that_of_an_axis(axis):
    (found,) = robot_limits(axis('<limit lower="-0.3" upper="0.4" effort="100" velocity="0"/>'))
    np.testing.assert_allclose(found.position, (-0.3, 0.4), rtol=1e-12)
    assert found.velocity == 0.2
    assert found.units.position == "m"
