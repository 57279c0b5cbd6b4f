"""A leg under the vendor's servo, recorded with its base at rest, swinging, or with its foot on a soft mat.

What is wrong with the plant or its sensors is put into them here and stands in no file that a diagnosis reads:
the logs of `python -m tests.benchmarks robot`.

    reference --> actuators --> plant --> encoder, imu, force_torque --> logs
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from drake_tc.actuation.model import ActuatorModel
from drake_tc.actuation.wiring import add_actuators
from drake_tc.errors import ParamsError
from drake_tc.loops.torque.references import table_source
from drake_tc.loops.torque.running import TorqueRecording
from drake_tc.robot.plant import add_robot, joint_limits, make_plant
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import SensorSuiteSpec, add_sensors
from drake_tc.types import FloatArray

Place = Literal["rest", "swing", "ground"]
DT = 1e-3
RAMP = 1.0
"""The motion rises over this time [s]."""
HINGE_HEIGHT = 0.7
"""Of the axis above the base about which it swings [m]."""
HINGE_AXIS = (0.6, 0.8, 0.0)
SWING = 0.22
"""Angle from which the base starts to swing [rad]."""
HINGE_DAMPING = 1.0
"""[N m s/rad]"""
MAT_STIFFNESS = 1500.0
"""Of the mat under each point of the sole [N/m]."""
MAT_DEPTH = 0.016
"""How deep the resting sole is to sink in [m]."""


@dataclass(frozen=True)
class Motion:
    """q_d(t) = posture + ramp(t) sum_i a_i sin(2 pi f_i t + p_i), joint by joint.

    Attributes:
        amplitude, frequency_hz, phase: (m, n) [rad, Hz, rad].
    """

    amplitude: FloatArray
    frequency_hz: FloatArray
    phase: FloatArray

    def table(self, posture: FloatArray, time: FloatArray) -> FloatArray:
        """(T, n) [rad]."""
        share = np.clip(time / RAMP, 0.0, 1.0)
        rise = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        angle = 2.0 * np.pi * self.frequency_hz * time[:, None, None] + self.phase
        moved = (self.amplitude * (np.sin(angle) - np.sin(self.phase))).sum(axis=1)
        return np.asarray(posture + rise[:, None] * moved)


@dataclass(frozen=True)
class Wrong:
    """What the plant has and no file says.

    Attributes:
        mass: Link to what it weighs more than in its URDF [kg]; its inertia grows along.
        com: Link to the shift of its centre of mass, in its axes [m].
    """

    mass: Mapping[str, float] = field(default_factory=dict)
    com: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


def random_motion(rng: np.random.Generator, robot: Robot, size: float, posture: FloatArray) -> Motion:
    """Two sinusoids a joint, a slow wide one and a quicker narrow one, inside the joint's limits.

    Args:
        rng: Draws.
        robot: Its joints' limits.
        size: Amplitude of the wide one [rad].
        posture: (n,) about which it moves [rad].
    """
    n = len(robot.joints)
    limits = joint_limits(robot)
    room = np.minimum(posture - limits.lower, limits.upper - posture)
    wide = np.minimum(size * rng.uniform(0.8, 1.2, n), 0.35 * room)
    amplitude = np.stack([wide, 0.25 * wide])
    frequency = np.stack([rng.uniform(0.25, 0.5, n), rng.uniform(0.8, 1.3, n)])
    return Motion(amplitude, frequency, rng.uniform(0.0, 2.0 * np.pi, (2, n)))


def record_leg(
    robot: Robot,
    models: Mapping[str, ActuatorModel],
    suite: SensorSuiteSpec,
    place: Place,
    motion: Motion,
    duration: float,
    wrong: Wrong | None = None,
    seed: int = 0,
) -> TorqueRecording:
    """Simulate one run.

    Args:
        robot: With a welded base; it swings about a hinge above it in place "swing".
        models: Joint to the simulated actuator.
        suite: What the sensors do.
        place: What holds the base and touches the foot.
        motion: Of the references, about the robot's posture.
        duration: [s].
        wrong: What differs from the files.
        seed: Of the sensors' noise.

    Raises:
        ParamsError: a link that is not there, or a robot without F/T sensor for the place "ground".
    """
    builder = DiagramBuilder()
    plant = _plant(builder, robot, place)
    sensors = add_sensors(builder, plant, robot, suite, DT, seed)
    time = np.arange(round(duration / DT) + 2, dtype=np.float64) * DT
    command = builder.AddNamedSystem("reference", table_source(time, motion.table(robot.posture, time)))
    actuators = add_actuators(builder, plant, models, DT)
    builder.Connect(command.get_output_port(), actuators.GetInputPort("command"))
    ports: dict[str, Any] = {
        "command": command.get_output_port(),
        "encoder": sensors.encoder.GetOutputPort("reading"),
        "joint_torque": sensors.joint_torque.GetOutputPort("reading"),
    }
    if sensors.imu is not None:
        ports["imu"] = sensors.imu.GetOutputPort("reading")
    if sensors.force_torque is not None:
        ports["force_torque"] = sensors.force_torque.GetOutputPort("reading")
    logs = {name: LogVectorOutput(port, builder, DT) for name, port in ports.items()}
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    _start(plant, plant.GetMyMutableContextFromRoot(context), robot, place, wrong or Wrong())
    simulator.AdvanceTo(duration)
    found = {name: log.FindLog(context) for name, log in logs.items()}
    signals = {name: np.asarray(log.data()).T.copy() for name, log in found.items()}
    time = np.asarray(found["encoder"].sample_times())
    return TorqueRecording(robot=robot, models=models, time=time, signals=signals, seconds=0.0)


def _plant(builder: DiagramBuilder, robot: Robot, place: Place) -> MultibodyPlant:
    plant: Any
    if place == "ground":
        plant, _ = AddMultibodyPlantSceneGraph(builder, DT)
        add_robot(plant, robot, collisions=True)
        _add_mat(plant, robot)
    else:
        plant = builder.AddNamedSystem("plant", MultibodyPlant(DT))
        add_robot(plant, robot if place == "rest" else replace(robot, fixed_base=False))
        if place == "swing":
            _add_hinge(plant, robot)
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    built: MultibodyPlant = plant
    return built


def _add_hinge(plant: Any, robot: Robot) -> None:
    """The base hangs from an axis above it."""
    up: Any = np.array([0.0, 0.0, HINGE_HEIGHT])
    axis: Any = np.array(HINGE_AXIS)
    X_WB = robot.base_pose.transform
    above = RigidTransform(X_WB.rotation().inverse(), X_WB.rotation().inverse().multiply(up))
    world = plant.AddFrame(FixedOffsetFrame("hinge_world", plant.world_frame(), X_WB.multiply(above)))
    own = plant.AddFrame(FixedOffsetFrame("hinge_base", plant.GetFrameByName(robot.base), above))
    plant.AddJoint(RevoluteJoint("hinge", world, own, axis, HINGE_DAMPING))


def _add_mat(plant: Any, robot: Robot) -> None:
    """A soft mat, as high as the resting sole less the depth that it is to sink in."""
    if not robot.force_torque:
        raise ParamsError(f"{robot.source}: expected an F/T sensor, at whose contact the mat lies, got none")
    mount = robot.force_torque[0].contact
    model = make_plant(robot, 0.0)
    context = model.CreateDefaultContext()
    X_WC = model.GetFrameByName(mount.link).CalcPoseInWorld(context).multiply(mount.pose.transform)
    x, y, z = X_WC.translation()
    height = 0.1
    centre: Any = np.array([x, y, z + MAT_DEPTH - 0.5 * height])
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=0.5, point_stiffness=MAT_STIFFNESS, friction=CoulombFriction(0.4, 0.4), properties=properties
    )
    pose = RigidTransform(RotationMatrix(), centre)
    plant.RegisterCollisionGeometry(plant.world_body(), pose, Box(1.0, 1.0, height), "mat", properties)


def _start(plant: Any, context: Any, robot: Robot, place: Place, wrong: Wrong) -> None:
    """Posture, swing, and what differs from the files."""
    for joint, position in zip(robot.joints, robot.posture, strict=True):
        plant.GetJointByName(joint).set_angle(context, float(position))
    if place == "swing":
        plant.GetJointByName("hinge").set_angle(context, SWING)
    for link in (*wrong.mass, *wrong.com):
        if not plant.HasBodyNamed(link):
            raise ParamsError(f"{robot.source}: no link {link!r}")
    for link, more in wrong.mass.items():
        body = plant.GetBodyByName(link)
        body.SetMass(context, body.get_mass(context) + more)
    for link, shift in wrong.com.items():
        body = plant.GetBodyByName(link)
        moved: Any = _shifted(body.CalcSpatialInertiaInBodyFrame(context), np.array(shift))
        body.SetSpatialInertiaInBodyFrame(context, moved)


def _shifted(inertia: Any, shift: Any) -> Any:
    """The same body with its centre of mass elsewhere: the inertia about it stays."""
    central = inertia.Shift(inertia.get_com())
    origin: Any = np.zeros(3)
    turned = SpatialInertia(inertia.get_mass(), origin, central.get_unit_inertia())
    return turned.Shift(-(inertia.get_com() + shift))
