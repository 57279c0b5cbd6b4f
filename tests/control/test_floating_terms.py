"""Inverse dynamics under a moving base: against a plant with gravity whose base is free, read by an IMU of its own."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from drake_tc.control.dynamics_terms import DynamicsTerms, FloatingTerms
from drake_tc.control.gains import TorqueGains
from drake_tc.control.inverse_dynamics import InverseDynamics, MotionSources
from drake_tc.errors import ParamsError
from drake_tc.robot.plant import make_plant

from .robots import pendulum

IMU = "imu: {on: {link: %s, xyz: [0.1, -0.05, 0.2], rpy: [0.3, -0.2, 0.5]}}\n"


class Truth:
    """The floating pendulum in a random motion: what it needs, and what its IMU reads."""

    def __init__(self, robot, seed):
        rng = np.random.default_rng(seed)
        self.plant = plant = make_plant(robot, 0.0)
        self.context = context = plant.CreateDefaultContext()
        quaternion = rng.normal(size=4)
        q = np.concatenate([quaternion / np.linalg.norm(quaternion), rng.normal(size=3), rng.uniform(-1, 1, 2)])
        v, self.vdot = rng.normal(size=8), rng.normal(size=8) * 3.0
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        gravity = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, gravity)
        self.torque = plant.CalcInverseDynamics(context, self.vdot, gravity)[6:]
        self.q, self.v = q[7:], v[6:]
        mount = robot.imu[0]
        frame = plant.GetFrameByName(mount.link)
        pose = mount.pose.transform
        world = plant.world_frame()
        args = (JacobianWrtVariable.kV, frame, pose.translation(), world, world)
        jacobian = plant.CalcJacobianSpatialVelocity(context, *args)
        bias = plant.CalcBiasSpatialAcceleration(context, *args).get_coeffs()
        velocity, acceleration = jacobian @ v, jacobian @ self.vdot + bias
        to_imu = (plant.CalcRelativeRotationMatrix(context, world, frame) @ pose.rotation()).matrix().T
        proper = acceleration[3:] + np.array([0.0, 0.0, 9.81])
        parts = (velocity[:3], proper, acceleration[:3])
        self.imu = np.concatenate([*(to_imu @ part for part in parts), np.zeros(3)])
        self.joints = np.concatenate([self.q, self.v, self.vdot[6:]])


@pytest.mark.parametrize("link", ["base", "upper"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_joints_get_what_the_moving_robot_needs(tmp_path, link, seed):
    robot = pendulum(tmp_path, fixed=False, more=IMU % link)
    truth = Truth(robot, seed)
    terms = FloatingTerms(robot)
    scratch = terms.create_scratch()
    terms.carry(scratch, truth.imu, truth.joints)
    terms.place(scratch, truth.q, truth.v)
    assert_allclose(terms.forces(scratch, truth.vdot[6:]), truth.torque, rtol=1e-9, atol=1e-9)


def test_at_rest_it_is_the_welded_robot(tmp_path):
    fixed, free = (pendulum(tmp_path, fixed=f, more=IMU % "base") for f in (True, False))
    welded, floating = DynamicsTerms(fixed), FloatingTerms(free)
    one, two = welded.create_scratch(), floating.create_scratch()
    q, v, vdot = np.array([0.4, -0.9]), np.array([1.2, -0.5]), np.array([3.0, -7.0])
    turn = free.imu[0].pose.transform.rotation().matrix()
    floating.carry(two, np.concatenate([np.zeros(3), turn.T @ [0.0, 0.0, 9.81], np.zeros(6)]), np.zeros(6))
    welded.place(one, q, v)
    floating.place(two, q, v)
    assert_allclose(floating.forces(two, vdot), welded.forces(one, vdot), rtol=1e-9)
    assert_allclose(floating.jacobian(two), welded.jacobian(one), atol=1e-12)


def test_neglected_rotation_is_what_differs_by_it(tmp_path):
    robot = pendulum(tmp_path, fixed=False, more=IMU % "base")
    truth = Truth(robot, 0)
    found = {}
    for option in ("gyro", "neglected"):
        terms = FloatingTerms(robot, option)
        scratch = terms.create_scratch()
        imu = truth.imu.copy()
        if option == "gyro":
            imu[6:9] = 0.0
        terms.carry(scratch, imu, truth.joints)
        terms.place(scratch, truth.q, truth.v)
        found[option] = terms.forces(scratch, truth.vdot[6:])
    assert_allclose(found["neglected"], found["gyro"])
    assert np.abs(found["gyro"] - truth.torque).max() > 0.1


def test_the_system_reads_the_imu_and_stops_at_one_that_is_lost(tmp_path):
    robot = pendulum(tmp_path, fixed=False, more=IMU % "upper")
    truth = Truth(robot, 3)
    nil = np.zeros(2)
    gains = TorqueGains(nil, nil, nil, nil, np.zeros((0, 0)))
    system = InverseDynamics(robot, gains, MotionSources(configuration="reference"))
    context = system.CreateDefaultContext()
    inputs = {
        "joint_estimate": truth.joints,
        "reference": truth.joints,
        "force_reference": np.zeros(6),
        "contact_wrench": np.zeros(6),
        "imu_estimate": truth.imu,
        "base_joint_estimate": truth.joints,
    }
    for name, value in inputs.items():
        system.GetInputPort(name).FixValue(context, value)
    for name in ("desired_torque", "feedforward_torque"):
        assert_allclose(system.GetOutputPort(name).Eval(context), truth.torque, rtol=1e-9, atol=1e-9)
    terms = system.GetOutputPort("torque_terms").Eval(context).reshape(6, 2)
    assert_allclose(terms[0], truth.torque, rtol=1e-9, atol=1e-9)
    assert_allclose(terms[1:], 0.0, atol=1e-9)
    system.GetInputPort("imu_estimate").FixValue(context, np.full(12, np.nan))
    for name in ("desired_torque", "feedforward_torque", "torque_terms"):
        assert np.isnan(system.GetOutputPort(name).Eval(context)).all()


def test_a_floating_base_wants_an_imu(tmp_path):
    with pytest.raises(ParamsError, match="'pendulum': expected an IMU, as its base floats"):
        FloatingTerms(pendulum(tmp_path, fixed=False))
