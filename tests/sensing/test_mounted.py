"""Encoder, IMU, force/torque and joint torque on moving bodies, against mechanics done by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, MatrixGain
from scipy.spatial.transform import Rotation

from drake_tc.errors import ParamsError
from drake_tc.sensing.robot_sensors import ForceTorque, JointTorque, add_encoder, add_imu
from drake_tc.sensing.spec import Sampling, SensorSpec
from drake_tc.sensing.suite import SensorSuiteSpec, add_sensors

from . import rigs
from .rigs import DT, GRAVITY

CASES = [(0.0, 0.0, 0.0), (0.7, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 9.0), (-1.2, 2.5, -14.0)]
"""(q, v, torque)."""


class Rig:
    """The pendulum with perfect sensors, open at its actuation."""

    def __init__(self, live=True):
        builder = DiagramBuilder()
        self.plant, self.robot = rigs.pendulum(live)
        builder.AddNamedSystem("plant", self.plant)
        self.sensors = add_sensors(builder, self.plant, self.robot, SensorSuiteSpec.perfect(), DT)
        builder.ExportInput(self.plant.get_actuation_input_port(), "actuation")
        builder.ExportInput(self.plant.get_applied_spatial_force_input_port(), "external")
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()
        self.own = self.plant.GetMyContextFromRoot(self.context)

    def set(self, q, v, torque, external=()):
        self.plant.SetPositions(self.own, [q])
        self.plant.SetVelocities(self.own, [v])
        self.diagram.GetInputPort("actuation").FixValue(self.context, [torque])
        self.diagram.GetInputPort("external").FixValue(self.context, list(external))

    def read(self, name):
        sensor = getattr(self.sensors, name)
        return sensor.GetOutputPort("reading").Eval(sensor.GetMyContextFromRoot(self.context)).copy()


def rotation(pose):
    """Axes of a pose in its link's, by another library."""
    return Rotation.from_euler("xyz", pose.rpy).as_matrix()


def proper_acceleration(point, q, v, a):
    """(3,) a - g of a point of the link, in the link's axes."""
    up = GRAVITY * np.array([-np.sin(q), 0.0, np.cos(q)])
    omega, alpha = np.array([0.0, v, 0.0]), np.array([0.0, a, 0.0])
    return np.cross(alpha, point) + np.cross(omega, np.cross(omega, point)) + up


@pytest.mark.parametrize(("q", "v", "torque"), CASES)
def test_imu_on_a_swinging_link(q, v, torque):
    rig = Rig()
    rig.set(q, v, torque)
    R = rotation(rigs.IMU.pose)
    proper = proper_acceleration(np.array(rigs.IMU.pose.xyz), q, v, rigs.acceleration(q, torque))
    assert_allclose(rig.read("imu"), np.concatenate([R.T @ [0.0, v, 0.0], R.T @ proper]), atol=1e-10)


def foot_wrench(q, v, a):
    """[f; t] of the foot on the link at the sensor frame, in its axes: Newton and Euler of the foot alone."""
    ankle = np.array([0.0, 0.0, -rigs.ANKLE])
    force = -rigs.FOOT_MASS * proper_acceleration(ankle + rigs.FOOT_COM, q, v, a)
    spin = -rigs.FOOT_INERTIA * [0.0, a, 0.0]  # turns about a principal axis: no gyroscopic term
    X = rigs.FOOT_TURN.ToRotationMatrix().matrix()  # the foot's joint frame has these axes in the link
    to_child = rigs.JOINT_ON_FOOT.rotation().matrix().T  # axes of the foot's body in Jc
    origin = -X @ to_child @ rigs.JOINT_ON_FOOT.translation()  # of the foot's body, from the ankle
    sensor = origin + X @ to_child @ np.array(rigs.SENSOR_POSE.xyz)
    R = X @ to_child @ rotation(rigs.SENSOR_POSE)
    return np.concatenate([R.T @ force, R.T @ (spin + np.cross(rigs.FOOT_COM - sensor, force))]), R, sensor


@pytest.mark.parametrize(("q", "v", "torque"), CASES)
def test_force_torque_of_a_swinging_foot(q, v, torque):
    rig = Rig()
    rig.set(q, v, torque)
    want, _, _ = foot_wrench(q, v, rigs.acceleration(q, torque))
    assert_allclose(rig.read("force_torque"), want, atol=1e-9)


def test_force_torque_of_a_hanging_foot_is_its_weight_on_its_lever():
    rig = Rig()
    hold = -rigs.gravity_torque(0.0)
    rig.set(0.0, 0.0, hold)
    _, R, sensor = foot_wrench(0.0, 0.0, 0.0)
    weight = np.array([0.0, 0.0, -rigs.FOOT_MASS * GRAVITY])
    lever = rigs.FOOT_COM - sensor
    moment = np.array([lever[1] * weight[2], -lever[0] * weight[2], 0.0])
    reading = rig.read("force_torque")
    assert_allclose(R @ reading[:3], weight, atol=1e-10)
    assert_allclose(R @ reading[3:], moment, atol=1e-10)


def test_force_torque_adds_what_pushes_the_foot_and_the_ground_pushes_up():
    rig = Rig()
    foot = rig.plant.GetBodyByName("foot")
    push = ExternallyAppliedSpatialForce()
    push.body_index = foot.index()
    push.p_BoBq_B = np.zeros(3)
    up = np.array([0.0, 0.0, 40.0])
    push.F_Bq_W = SpatialForce(np.zeros(3), up)
    _, R, sensor = foot_wrench(0.0, 0.0, 0.0)
    origin = rig.plant.GetFrameByName("foot").CalcPose(rig.own, rig.plant.GetFrameByName("link")).translation()
    ankle = np.array([0.0, 0.0, -rigs.ANKLE])
    moment_at_pivot = np.cross(origin, up)[1]
    rig.set(0.0, 0.0, -rigs.gravity_torque(0.0) - moment_at_pivot, [push])  # nothing moves
    still, _, _ = foot_wrench(0.0, 0.0, 0.0)
    added = rig.read("force_torque") - still
    assert_allclose(R @ added[:3], up, atol=1e-9)
    assert_allclose(R @ added[3:], np.cross(origin - (ankle + sensor), up), atol=1e-9)


@pytest.mark.parametrize(("q", "v", "torque"), CASES)
def test_joint_torque_is_on_the_links_side_of_the_rotor(q, v, torque):
    rig = Rig()
    rig.set(q, v, torque)
    a = rigs.acceleration(q, torque)
    want = rigs.link_inertia_about_pivot() * a - rigs.gravity_torque(q)
    assert_allclose(rig.read("joint_torque"), [want], atol=1e-10)
    assert_allclose(want, torque - rigs.ROTOR * a, atol=1e-10)


def test_joint_force_of_a_prismatic_joint():
    slope, mass, force = 0.4, 3.0, 20.0
    plant, robot = rigs.slider(slope, mass)
    sensor = JointTorque(plant, robot, SensorSpec(), Sampling(DT))
    context = plant.CreateDefaultContext()
    plant.get_actuation_input_port().FixValue(context, [force])
    own = sensor.CreateDefaultContext()
    forces = plant.get_reaction_forces_output_port().EvalAbstract(context)
    sensor.GetInputPort("reaction_forces").FixValue(own, forces)
    a = force / mass - GRAVITY * np.sin(slope)
    assert_allclose(sensor.get_output_port().Eval(own), [mass * (a + GRAVITY * np.sin(slope))], rtol=1e-9)


def test_live_ports_feel_the_torque_of_the_same_tick_and_the_encoder_adds_no_delay():
    rig = Rig()
    rig.set(0.3, 0.0, 0.0)
    quiet = {name: rig.read(name) for name in ("encoder", "imu", "force_torque", "joint_torque")}
    rig.set(0.3, 0.0, 5.0)
    assert_array_equal(rig.read("encoder"), [0.3])
    assert_array_equal(rig.read("imu")[:3], quiet["imu"][:3])
    for name in ("imu", "force_torque", "joint_torque"):
        assert np.max(np.abs(rig.read(name) - quiet[name])) > 0.1


def test_sampled_ports_do_not():
    rig = Rig(live=False)
    rig.set(0.3, 0.0, 5.0)
    assert_array_equal(rig.read("joint_torque"), [0.0])  # nothing was sampled before the first step


def closed(read):
    """Encoder and one more sensor's first channel, through a gain, back to the torque."""
    builder = DiagramBuilder()
    plant, robot = rigs.pendulum()
    builder.AddNamedSystem("plant", plant)
    sensors = add_sensors(builder, plant, robot, SensorSuiteSpec.realistic(), DT)
    back = builder.AddSystem(Adder(len(read), 1))
    for index, name in enumerate(read):
        port = getattr(sensors, name).GetOutputPort("reading")
        gain = np.zeros((1, port.size()))
        gain[0, 0] = -30.0 if name == "encoder" else -0.01
        block = builder.AddSystem(MatrixGain(gain))
        builder.Connect(port, block.get_input_port())
        builder.Connect(block.get_output_port(), back.get_input_port(index))
    builder.Connect(back.get_output_port(), plant.get_actuation_input_port())
    return builder.Build(), plant


def test_encoder_controller_plant_is_no_algebraic_loop():
    diagram, plant = closed(["encoder"])
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.3)
    assert np.isfinite(plant.GetPositions(plant.GetMyContextFromRoot(simulator.get_context()))).all()


@pytest.mark.parametrize("name", ["force_torque", "imu", "joint_torque"])
def test_a_live_force_straight_into_the_torque_is_one(name):
    with pytest.raises(RuntimeError, match="algebraic loop"):
        closed(["encoder", name])


def test_latency_breaks_the_loop():
    builder = DiagramBuilder()
    plant, robot = rigs.pendulum()
    builder.AddNamedSystem("plant", plant)
    sensor = builder.AddSystem(JointTorque(plant, robot, SensorSpec(latency=DT), Sampling(DT)))
    builder.Connect(plant.get_reaction_forces_output_port(), sensor.GetInputPort("reaction_forces"))
    gain = builder.AddSystem(MatrixGain(np.array([[-0.1]])))
    builder.Connect(sensor.GetOutputPort("reading"), gain.get_input_port())
    builder.Connect(gain.get_output_port(), plant.get_actuation_input_port())
    assert not sensor.HasAnyDirectFeedthrough()
    assert not builder.Build().HasAnyDirectFeedthrough()


def test_a_robot_without_the_sensor_is_refused():
    plant, robot = rigs.slider(0.0, 1.0)
    builder = DiagramBuilder()
    builder.AddNamedSystem("plant", plant)
    with pytest.raises(ParamsError, match=r"rig\.yaml: imu: expected at least one"):
        add_imu(builder, plant, robot, SensorSpec(), Sampling(DT))
    with pytest.raises(ParamsError, match=r"rig\.yaml: force_torque: expected at least one"):
        ForceTorque(plant, robot, SensorSpec(), Sampling(DT))
    assert add_encoder(builder, plant, robot, SensorSpec(), Sampling(DT)).GetInputPort("truth").size() == 1
