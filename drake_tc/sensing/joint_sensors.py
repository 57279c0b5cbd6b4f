"""Sensors of the joints: encoders and torque sensors.

`Encoder`: the joints' position sensors.

`JointTorque`: torque sensors on the links' side of the gears; with a perfect spec, the ground truth.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import MatrixGain

from drake_tc.errors import ParamsError
from drake_tc.robot.robot import Robot
from drake_tc.robot.tree import has_axis, is_revolute, joint_axes
from drake_tc.sensing.corruption import Corruption
from drake_tc.sensing.sensor import Sensor, SensorBase
from drake_tc.sensing.spec import SensorFault, SensorSpec
from drake_tc.types import FloatArray


class Encoder(Sensor):
    """Positions of n joints, link side: `truth` (n) [rad or m] to `reading` (n). See `Sensor`."""

    is_drawn = True


def add_encoder(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    robot: Robot,
    spec: SensorSpec,
    dt: float,
    faults: Sequence[SensorFault] = (),
    seed: int = 0,
) -> Encoder:
    """Add an Encoder of the robot's joints to the builder and wire it to a plant that is already in it.

    Between them stands `joint_positions`, which picks the positions from the plant's state in the robot's order.

    Args:
        builder: Holds `plant`.
        plant: Finalized plant with the robot.
        robot: Names the joints.
        spec: [rad or m].
        dt: Period [s].
        faults: When it fails.
        seed: Of its random numbers.

    Returns:
        The system.

    Raises:
        ParamsError: As `Sensor`.
    """
    model = plant.GetModelInstanceByName(robot.name)
    joints = [plant.GetJointByName(name, model).index() for name in robot.joints]
    pick = plant.MakeStateSelectorMatrix(joints)[: len(joints)]
    gain: Any = np.ascontiguousarray(pick)
    positions = builder.AddNamedSystem("joint_positions", MatrixGain(gain))
    encoder = Encoder(len(joints), spec, dt, faults, seed)
    builder.AddNamedSystem("encoder", encoder)
    builder.Connect(plant.get_state_output_port(), positions.get_input_port())
    builder.Connect(positions.get_output_port(), encoder.GetInputPort("truth"))
    return encoder


def _axes(plant: MultibodyPlant, joints: Sequence[Joint]) -> FloatArray:
    """(n, 6) s of τ = s · [τ_J; f_J], in Jc."""
    for joint in joints:
        if not has_axis(joint):
            raise ParamsError(
                f"joint {joint.name()!r}: expected a revolute or prismatic joint, got {joint.type_name()}"
            )
    turns = np.array([is_revolute(joint) for joint in joints])[:, None]
    axes = joint_axes(plant, joints)
    return np.concatenate([turns * axes, ~turns * axes], axis=1)


class JointTorque(SensorBase):
    """Torques of n joints, about their axes (forces along them, of prismatic joints).

        τ = s · F_CJc_Jc,   s the joint's axis

    What gear and joint transmit to the child link: the actuator's torque less its rotor's inertia and less the joint's
    damping. A generalized force applied to the joint from outside counts too.

    Input:
        reaction_forces: of the MultibodyPlant.
    Output:
        reading (n): [N m], of prismatic joints [N].

    See `SensorBase` for the recursion.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        robot: Robot,
        spec: SensorSpec,
        dt: float,
        faults: Sequence[SensorFault] = (),
        seed: int = 0,
    ) -> None:
        """Declare ports, state and the periodic update.

        Args:
            plant: Finalized plant with the robot.
            robot: Names the joints.
            spec: [N m]; `SensorSpec()` reads the truth.
            dt: Period [s].
            faults: When it fails.
            seed: Of its random numbers.

        Raises:
            ParamsError: A joint that is neither revolute nor prismatic; otherwise as `Corruption`.
        """
        super().__init__()
        model = plant.GetModelInstanceByName(robot.name)
        joints = [plant.GetJointByName(name, model) for name in robot.joints]
        self._joints = [int(joint.index()) for joint in joints]
        self._axes = _axes(plant, joints)
        reactions = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        self._declare(reactions, Corruption(len(joints), spec, dt, tuple(faults), seed))

    def _truth_of(self, forces: Any) -> FloatArray:
        wrenches = np.array([forces[i].get_coeffs() for i in self._joints])
        return np.asarray((self._axes * wrenches).sum(axis=1))
