"""An MJCF tree and the height of a tip against Drake; `test_importers` has the imported sets."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.errors import LogError
from tests.benchmarks.importers.mjcf import urdf_of_mjcf
from tests.benchmarks.importers.so101 import tip_height

MJCF = """<mujoco model="small">
  <compiler angle="radian"/>
  <default>
    <default class="arm">
      <joint axis="0 1 0" range="-1 2"/>
      <default class="turned"><joint axis="1 0 0"/></default>
    </default>
  </default>
  <worldbody>
    <body name="base" childclass="arm">
      <inertial pos="0 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>
      <body name="a" pos="0.1 0.2 0.3" quat="0.9 0.1 -0.2 0.3">
        <inertial pos="0.01 -0.02 0.05" quat="0.8 0.2 0.5 -0.1" mass="1.5" diaginertia="0.02 0.015 0.01"/>
        <joint name="a_joint" class="turned"/>
        <body name="b" pos="0 0 -0.2">
          <inertial pos="0 0.01 -0.1" mass="0.7" fullinertia="0.01 0.012 0.004 0.001 -0.002 0.0005"/>
          <joint name="b_joint"/>
        </body>
      </body>
      <body name="c" pos="-0.1 0 0">
        <inertial pos="0 0 0.1" mass="0.4" diaginertia="0.003 0.003 0.001"/>
        <joint name="c_joint" axis="0 0 1" range="-0.5 0.5"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""

JOINTS = "".join(
    f'<link name="l{i}"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    "</inertial></link>"
    f'<joint name="{{}}" type="revolute"><parent link="{parent}"/><child link="l{i}"/><axis xyz="0 1 0"/>'
    f'<origin xyz="0.0{i} 0.02 -0.1" rpy="0.{i} 0.2 -0.{i}"/>'
    '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
    for i, parent in enumerate(["base_link", "l0", "l1", "l2", "l3", "l4"])
)


TIP = """<link name="gripper_frame_link"/><joint name="tip" type="fixed"><parent link="l4"/>
<child link="gripper_frame_link"/><origin xyz="0.1 0.02 0.3" rpy="0.1 -0.2 0.3"/></joint>"""


def urdf_of(joints: list[str]) -> str:
    return f'<robot name="r"><link name="base_link"/>{JOINTS.format(*joints)}{TIP}</robot>'


def plant_of(text: str, file_type: str) -> MultibodyPlant:
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, file_type)
    if file_type == "urdf":  # an MJCF body without a joint is welded to the world
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant


def test_a_converted_tree_moves_as_drake_reads_the_mjcf() -> None:
    text, base, hinges = urdf_of_mjcf(MJCF, "small.xml")
    assert base == "base" and hinges == ["a_joint", "b_joint", "c_joint"]
    ours, theirs = plant_of(text, "urdf"), plant_of(MJCF, "xml")
    rng = np.random.default_rng(2)
    for _ in range(5):
        sides = []
        values = dict(zip(hinges, rng.uniform(-1.0, 1.0, (3, 3)), strict=True))
        for plant in (ours, theirs):
            context, order = plant.CreateDefaultContext(), []
            q, v, vdot = (np.zeros(plant.num_velocities()) for _ in range(3))
            for name, state in values.items():
                place = plant.GetJointByName(name).velocity_start()
                q[place], v[place], vdot[place] = state
                order.append(place)
            plant.SetPositions(context, q)
            plant.SetVelocities(context, v)
            gravity = plant.CalcGravityGeneralizedForces(context)
            bias = plant.CalcBiasTerm(context)
            tau = plant.CalcMassMatrix(context) @ vdot + bias - gravity
            sides.append(tau[order])
        assert_allclose(sides[0], sides[1], rtol=1e-7, atol=1e-9)  # the URDF has nine digits
    for name, (low, high) in {"a_joint": (-1, 2), "b_joint": (-1, 2), "c_joint": (-0.5, 0.5)}.items():
        joint = ours.GetJointByName(name)
        assert_allclose([joint.position_lower_limits()[0], joint.position_upper_limits()[0]], [low, high])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<mujoco", "not XML"),
        ("<robot/>", "a body in its worldbody"),
        ("<mujoco><worldbody><body name='a'/></worldbody></mujoco>", "no hinge"),
        (MJCF.replace('pos="0 0 -0.2"', 'pos="0 0"'), "expected 3 numbers"),
        (MJCF.replace('axis="0 0 1" range', 'type="slide" range'), "is a slide"),
    ],
)
def test_what_is_not_a_tree_of_hinges_is_refused(text: str, said: str) -> None:
    with pytest.raises(LogError, match=said):
        urdf_of_mjcf(text, "small.xml")


def test_the_height_of_the_tip_is_that_of_drakes_kinematics() -> None:
    rng = np.random.default_rng(5)
    angles = {name: rng.uniform(-1.0, 1.0, 4) for name in "abcde"}
    heights = tip_height(urdf_of([*"abcdef"]), angles, "small.urdf")
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(urdf_of([*"abcdef"]), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for k, height in enumerate(heights):
        for name, values in angles.items():
            plant.GetJointByName(name).set_angle(context, values[k])
        pose = plant.GetFrameByName("gripper_frame_link").CalcPoseInWorld(context)
        assert_allclose(height, pose.translation()[2], rtol=0, atol=1e-12)
    with pytest.raises(LogError, match="no link 'gripper_frame_link'"):
        tip_height('<robot name="r"><link name="base_link"/></robot>', angles, "small.urdf")
