"""Joints that follow others by `<mimic>` move and weigh as in Drake's own parse of the whole file."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces
from pydrake.systems.analysis import Simulator

from drake_tc.control.dynamics_terms import DynamicsTerms, FloatingTerms
from drake_tc.errors import ParamsError
from drake_tc.estimation.disturbance_observer import JointInertia
from drake_tc.estimation.off_line import torques_of_motion
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.robot.plant import make_plant
from drake_tc.robot.rigid_regressor import link_model
from drake_tc.robot.robot import load_robot

from .robots import ARM, robot_file

CHAIN = ARM.replace(
    '<axis xyz="1 0 0"/>', '<axis xyz="1 0 0"/><mimic joint="slide" multiplier="-2" offset="0.1"/>'
).replace('<axis xyz="0.3 -0.4 1"/>', '<axis xyz="0.3 -0.4 1"/><mimic joint="wrist" multiplier="0.7" offset="-0.3"/>')
"""The wrist follows the slide, and the spin the wrist."""
SLIDE = ARM.replace(
    '<axis xyz="1 1 0"/>', '<axis xyz="1 1 0"/><mimic joint="shoulder" multiplier="-0.4" offset="0.2"/>'
)
CASES = {
    "a chain": (CHAIN, ["shoulder", "slide"], {"wrist": ("slide", -2.0, 0.1), "spin": ("slide", -1.4, -0.23)}),
    "a slide": (SLIDE, ["wrist", "shoulder"], {"slide": ("shoulder", -0.4, 0.2)}),
}


def whole(text):
    """Drake's own parse, in which a continuous plant leaves followers free."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(re.sub(r"<mimic[^>]*/>|<visual>.*?</visual>", "", text), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant


@pytest.mark.parametrize("case", CASES)
def test_torques_of_followers_are_those_of_their_leader(tmp_path, case):
    text, joints, laws = CASES[case]
    robot = load_robot(robot_file(tmp_path, text, joints=joints))
    assert {name: (law.of, law.multiplier, law.offset) for name, law in robot.followers.items()} == {
        name: pytest.approx(law) if not isinstance(law[0], str) else (law[0], *map(pytest.approx, law[1:]))
        for name, law in laws.items()
    }
    plant = whole(text)
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    moves, offset = np.zeros((plant.num_velocities(), len(joints))), np.zeros(plant.num_velocities())
    for name in (*joints, *laws):
        at = plant.GetJointByName(name).velocity_start()
        of, multiplier, zero = laws.get(name, (name, 1.0, 0.0))
        moves[at, joints.index(of)], offset[at] = multiplier, zero
    for name, value in robot.locked.items():
        offset[plant.GetJointByName(name).velocity_start()] = value
    random = np.random.default_rng(1)
    q, v, a = random.normal(size=(3, 6, len(joints)))
    expected = []
    for row in zip(q, v, a, strict=True):
        full = [moves @ each for each in row]
        plant.SetPositions(context, full[0] + offset)
        plant.SetVelocities(context, full[1])
        gravity = plant.CalcGravityGeneralizedForces(context)
        expected.append(moves.T @ (plant.CalcInverseDynamics(context, full[2], forces) - gravity))
    model = TorqueModel(robot, base="fixed")
    nothing = np.zeros((6, 6))
    found = {
        "recursion of Drake": torques_of_motion(model, q, v, a),
        "kernel": model.estimate_log(q, v, a, nothing, nothing[:, :3], np.zeros((6, 0)))[:, : len(joints)],
        "regressor": link_model(robot).columns(q, v, a) @ link_model(robot).nominal,
    }
    terms = DynamicsTerms(robot)
    scratch, control = terms.create_scratch(), []
    for row in zip(q, v, a, strict=True):
        terms.place(scratch, *row[:2])
        control.append(terms.forces(scratch, row[2]))
    found["inverse dynamics"] = np.array(control)
    for name, torque in found.items():
        assert_allclose(torque, expected, rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_discrete_plant_moves_followers_with_their_leader(tmp_path):
    robot = load_robot(robot_file(tmp_path, SLIDE, joints=["wrist", "shoulder"]))
    plant = make_plant(robot, 1e-3)
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    q = plant.GetPositions(context)
    q[plant.GetJointByName("slide").position_start()] = 0.2
    plant.SetPositions(context, q)
    plant.get_actuation_input_port().FixValue(context, np.array([0.1, -6.0]))
    for _ in range(5):
        simulator.AdvanceTo(context.get_time() + 0.05)
        q = plant.GetPositions(context)
        slide, shoulder = (q[plant.GetJointByName(name).position_start()] for name in ("slide", "shoulder"))
        assert slide == pytest.approx(0.2 - 0.4 * shoulder, abs=2e-3)
    assert abs(shoulder) > 0.02


def test_a_locked_follower_stays_and_what_has_no_followers_refuses_them(tmp_path):
    robot = load_robot(robot_file(tmp_path, SLIDE, joints=["wrist", "shoulder"], locked={"slide": 0.1}))
    assert not robot.followers and robot.locked["slide"] == 0.1
    robot = load_robot(robot_file(tmp_path, SLIDE, joints=["wrist", "shoulder"]))
    with pytest.raises(
        ParamsError,
        match=r"'slide' follows 'shoulder' \(<mimic> of <joint> in line 31 of .*lock it \(locked: \{slide: 0\}",
    ):
        JointInertia(robot)


@pytest.mark.parametrize("link", ["base", "hand"])
def test_torques_under_a_base_that_moves_hold_the_followers(tmp_path, link):
    """The IMU sits on the base, or beyond the slide that follows the shoulder."""
    imu = {"on": {"link": link, "xyz": [0.1, -0.05, 0.2], "rpy": [0.3, -0.2, 0.5]}}
    robot = load_robot(robot_file(tmp_path, SLIDE, joints=["wrist", "shoulder"], fixed_base=False, imu=imu))
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(re.sub(r"<mimic[^>]*/>|<visual>.*?</visual>", "", SLIDE), "urdf")
    plant.Finalize()
    context, world = plant.CreateDefaultContext(), plant.world_frame()
    random = np.random.default_rng(2)
    q, (v, a) = random.normal(size=2), random.normal(size=(2, 8))
    moves = np.zeros((plant.num_velocities(), 8))
    moves[:6, :6] = np.eye(6)
    quaternion = random.normal(size=4)
    place = np.zeros(plant.num_positions())
    place[:7] = [*(quaternion / np.linalg.norm(quaternion)), *random.normal(size=3)]
    for name, column, multiplier, offset in (
        ("wrist", 0, 1.0, 0.0),
        ("shoulder", 1, 1.0, 0.0),
        ("slide", 1, -0.4, 0.2),
    ):
        joint = plant.GetJointByName(name)
        moves[joint.velocity_start(), 6 + column] = multiplier
        place[joint.position_start()] = multiplier * q[column] + offset
    plant.SetPositions(context, place)
    plant.SetVelocities(context, moves @ v)
    gravity = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, gravity)
    expected = (moves.T @ plant.CalcInverseDynamics(context, moves @ a, gravity))[6:]
    frame, pose = plant.GetFrameByName(link), robot.imu[0].pose.transform
    args = (JacobianWrtVariable.kV, frame, pose.translation(), world, world)
    jacobian = plant.CalcJacobianSpatialVelocity(context, *args)
    bias = plant.CalcBiasSpatialAcceleration(context, *args).get_coeffs()
    velocity, acceleration = jacobian @ moves @ v, jacobian @ moves @ a + bias
    to_imu = (plant.CalcRelativeRotationMatrix(context, world, frame) @ pose.rotation()).matrix().T
    parts = (velocity[:3], acceleration[3:] + np.array([0.0, 0.0, 9.81]), acceleration[:3])
    terms = FloatingTerms(robot)
    scratch = terms.create_scratch()
    terms.carry(
        scratch, np.concatenate([*(to_imu @ part for part in parts), np.zeros(3)]), np.concatenate([q, v[6:], a[6:]])
    )
    terms.place(scratch, q, v[6:])
    assert_allclose(terms.forces(scratch, a[6:]), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ("nope", "", "joint 'wrist' mimic: no joint 'nope' that moves"),
        ("mark_joint", "", "joint 'wrist' mimic: no joint 'mark_joint' that moves"),
        ("spin", "wrist", "mimic: the joints follow each other in a loop"),
        ("wrist", "", "mimic: the joints follow each other in a loop"),
    ],
)
def test_joints_that_follow_nothing_or_each_other_are_refused(tmp_path, first, second, message):
    text = ARM.replace('<axis xyz="1 0 0"/>', f'<axis xyz="1 0 0"/><mimic joint="{first}"/>')
    if second:
        text = text.replace('<axis xyz="0.3 -0.4 1"/>', f'<axis xyz="0.3 -0.4 1"/><mimic joint="{second}"/>')
    with pytest.raises(ParamsError, match=message):
        load_robot(robot_file(tmp_path, text, joints=["shoulder"]))


def test_a_follower_that_the_robot_file_drives_is_named(tmp_path):
    robot = load_robot(robot_file(tmp_path, SLIDE, joints=["shoulder", "slide"]))
    assert robot.followers == {} and any("that it follows 'shoulder' (mimic)" in line for line in robot.unused)


def test_physics_of_joints_that_is_not_used_is_listed(tmp_path):
    """Limits and `<mimic>` are used; the damping of a joint that is locked plays no part."""
    text = SLIDE.replace(
        "</robot>",
        '<transmission name="t"><type>x/SimpleTransmission</type><joint name="wrist"/><actuator name="m">'
        "<mechanicalReduction>100</mechanicalReduction><motorInertia>2e-5</motorInertia></actuator></transmission>"
        '<gazebo reference="wrist"><kp>7</kp></gazebo></robot>',
    )
    robot = load_robot(robot_file(tmp_path, text, joints=["wrist", "shoulder"]))
    assert robot.unused == ("arm.urdf: not used of wrist (line 42): its rotor inertia of 0.2, its <gazebo> tag kp.",)
    robot = load_robot(robot_file(tmp_path, text, joints=["wrist", "shoulder", "spin"]))
    assert "): its damping of 2, its dry friction of 1" in " ".join(robot.unused)
