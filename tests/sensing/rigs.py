"""A pendulum with a foot on a sensor, built by hand: what the mounted sensors should read is known in closed form."""

from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)

from drake_tc.robot.robot import ForceTorqueMount, Mount, Pose, Robot

DT = 1e-3
GRAVITY = 9.81
LINK_MASS, LINK_COM, LINK_RADIUS = 2.0, 0.25, 0.3
"""Mass [kg], distance of the centre below the pivot [m], radius of gyration about y at the pivot [m]."""
ANKLE = 0.5
"""Distance of the sensor's joint below the pivot [m]."""
FOOT_MASS = 1.5
FOOT_COM = np.array([0.08, 0.0, -0.06])
"""Of the foot, from the ankle, in the link's axes [m]."""
FOOT_INERTIA = np.array([0.02, 0.03, 0.025])
"""Principal, about the foot's centre, in the link's axes [kg m²]."""
ROTOR = 0.4

IMU = Mount("tip", "link", Pose((0.03, 0.02, -0.45), (0.4, -0.7, 1.1)))
SENSOR_POSE = Pose((0.01, -0.03, 0.02), (0.3, 0.2, -0.9))
FOOT_TURN = RollPitchYaw(0.5, -0.3, 0.8)
"""The foot's own axes in the link's."""
JOINT_ON_FOOT = RigidTransform(RollPitchYaw(-0.2, 0.6, 0.1), [0.02, 0.01, -0.03])
"""Frame Jc of the sensor's joint on the foot."""


def pendulum(live: bool = True) -> tuple[MultibodyPlant, Robot]:
    """Link on a revolute joint about y, foot welded to it; actuated, with rotor inertia."""
    plant = MultibodyPlant(DT)
    model = plant.AddModelInstance("rig")
    radius = LINK_RADIUS**2
    link_inertia = SpatialInertia(LINK_MASS, [0.0, 0.0, -LINK_COM], UnitInertia(radius, radius, 0.01))
    link = plant.AddRigidBody("link", model, link_inertia)
    X_LF = RigidTransform(FOOT_TURN, [0.0, 0.0, -ANKLE]) @ JOINT_ON_FOOT.inverse()
    R_FL, p_F = X_LF.rotation().inverse(), X_LF.inverse() @ (np.array([0.0, 0.0, -ANKLE]) + FOOT_COM)
    central = UnitInertia(*(FOOT_INERTIA / FOOT_MASS)).ReExpress(R_FL)
    foot_inertia = SpatialInertia.MakeFromCentralInertia(FOOT_MASS, p_F, FOOT_MASS * central)
    foot = plant.AddRigidBody("foot", model, foot_inertia)
    hip = plant.AddJoint(RevoluteJoint("hip", plant.world_frame(), link.body_frame(), [0.0, 1.0, 0.0]))
    on_foot = plant.AddFrame(FixedOffsetFrame("ankle_child", foot.body_frame(), JOINT_ON_FOOT))
    at_ankle = RigidTransform(FOOT_TURN, [0.0, 0.0, -ANKLE])
    plant.AddJoint(WeldJoint("ankle", link.body_frame(), on_foot, at_ankle))
    actuator = plant.AddJointActuator("hip", hip)
    actuator.set_default_rotor_inertia(ROTOR)
    actuator.set_default_gear_ratio(1.0)
    plant.SetUseSampledOutputPorts(not live)
    plant.Finalize()
    mount = ForceTorqueMount("ankle", "ankle", SENSOR_POSE, Mount("ankle", "foot"))
    robot = Robot("rig", Path("rig.urdf"), "link", True, ("hip",), np.zeros(1), Path("rig.yaml"),
                  imu=(IMU,), force_torque=(mount,))  # fmt: skip
    return plant, robot


def link_inertia_about_pivot() -> float:
    """[kg m²] of link and foot, without the rotor."""
    arm = np.array([0.0, 0.0, -ANKLE]) + FOOT_COM
    return LINK_MASS * LINK_RADIUS**2 + FOOT_INERTIA[1] + FOOT_MASS * (arm[0] ** 2 + arm[2] ** 2)


def gravity_torque(q: float) -> float:
    """[N m] of gravity about y at the pivot."""
    arm = np.array([0.0, 0.0, -ANKLE]) + FOOT_COM
    horizontal = [-LINK_COM * np.sin(q), arm[0] * np.cos(q) + arm[2] * np.sin(q)]
    return GRAVITY * (LINK_MASS * horizontal[0] + FOOT_MASS * horizontal[1])


def acceleration(q: float, torque: float) -> float:
    """[rad/s²] of the pendulum."""
    return (torque + gravity_torque(q)) / (link_inertia_about_pivot() + ROTOR)


def slider(slope: float, mass: float) -> tuple[MultibodyPlant, Robot]:
    """A block on a prismatic joint along x, turned up by `slope` about -y."""
    plant = MultibodyPlant(DT)
    model = plant.AddModelInstance("rig")
    block = plant.AddRigidBody("block", model, SpatialInertia.SolidBoxWithMass(mass, 0.1, 0.1, 0.1))
    rail = FixedOffsetFrame(
        "rail", plant.world_frame(), RigidTransform(RollPitchYaw(0.0, -slope, 0.0), [0.0, 0.0, 0.0])
    )
    joint = PrismaticJoint("slide", plant.AddFrame(rail), block.body_frame(), [1.0, 0.0, 0.0])
    plant.AddJointActuator("slide", plant.AddJoint(joint))
    plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    robot = Robot("rig", Path("rig.urdf"), "block", True, ("slide",), np.zeros(1), Path("rig.yaml"))
    return plant, robot
