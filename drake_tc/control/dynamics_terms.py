"""Inverse dynamics of a robot with a welded base: M vdot + h and the contacts' Jacobian at one configuration."""

from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable, MultibodyForces

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


class DynamicsTerms:
    """M vdot + h (n) and J (6k, n) of the links alone: rotor inertia and friction belong to the drives' models.

    n joints in the order of the robot's `joints`, k contacts in the order of its `force_torque`. The rows of J are
    [linear; angular] of each contact frame relative to the base, in the axes of the base.
    """

    def __init__(self, robot: Robot) -> None:
        """Build the model.

        Args:
            robot: With a welded base.

        Raises:
            ParamsError: the base floats, or the URDF cannot be read.
        """
        if not robot.fixed_base:
            raise ParamsError(
                f"robot {robot.name!r}: expected a welded base (fixed_base: true); it floats: `FloatingTerms` takes"
                " the base's motion from an IMU"
            )
        plant = MultibodyPlant(0.0)
        add_robot(plant, robot, rotors=False)
        frames = []
        for mount in robot.force_torque:
            body = plant.GetBodyByName(mount.contact.link)
            offset = FixedOffsetFrame(f"{mount.name}_contact", body.body_frame(), mount.contact.pose.transform)
            frames.append(plant.AddFrame(offset))
        plant.Finalize()
        self._plant = plant
        self._frames = tuple(frames)
        self._base = plant.GetBodyByName(robot.base).body_frame()
        joints = [plant.GetJointByName(name) for name in robot.joints]
        positions = np.array([joint.position_start() for joint in joints])
        velocities = np.array([joint.velocity_start() for joint in joints])
        self.size, self.wrenches = len(joints), 6 * len(frames)
        if plant.num_velocities() != self.size:
            raise ParamsError(
                f"robot {robot.name!r}: expected {self.size} movable joints, those listed, got {plant.num_velocities()}"
            )
        straight = np.arange(self.size)
        self._in_order = np.array_equal(positions, straight) and np.array_equal(velocities, straight)
        self._from = np.argsort(positions)  # plant order from ours; one velocity a joint, so the same for both
        self._to = positions
        self._origin: Any = np.zeros(3)
        self._force_first = np.array([3, 4, 5, 0, 1, 2])

    @property
    def plant(self) -> MultibodyPlant:
        """The links alone, finalized."""
        return self._plant

    @property
    def to_plant(self) -> list[int]:
        """For each of the plant's joints, which of ours it is."""
        return [int(i) for i in self._from]

    @property
    def from_plant(self) -> list[int]:
        """For each of our joints, which of the plant's it is."""
        return [int(i) for i in self._to]

    def create_scratch(self) -> "Scratch":
        """Scratch memory for the other methods."""
        return Scratch(self._plant)

    def place(self, scratch: "Scratch", q: FloatArray, v: FloatArray) -> None:
        """Go to q, v (n,) [rad, rad/s], where the terms are taken."""
        state: Any = np.concatenate((q, v) if self._in_order else (q[self._from], v[self._from]))
        self._plant.SetPositionsAndVelocities(scratch.context, state)

    def forces(self, scratch: "Scratch", vdot: FloatArray) -> FloatArray:
        """(n,) M vdot + h [N m] for vdot (n,) [rad/s^2], by one recursion; h = C(q, v) v - tau_g(q)."""
        plant: Any = self._plant
        plant.CalcForceElementsContribution(scratch.context, scratch.gravity)
        if self._in_order:
            return np.asarray(plant.CalcInverseDynamics(scratch.context, vdot, scratch.gravity))
        return np.asarray(plant.CalcInverseDynamics(scratch.context, vdot[self._from], scratch.gravity)[self._to])

    def jacobian(self, scratch: "Scratch") -> FloatArray:
        """(6k, n) J."""
        with_respect_to, base = JacobianWrtVariable.kV, self._base
        rows: Any = [
            self._plant.CalcJacobianSpatialVelocity(scratch.context, with_respect_to, frame, self._origin, base, base)[
                self._force_first
            ]
            for frame in self._frames
        ]
        jacobian = np.concatenate(rows) if rows else np.zeros((0, self.size))
        return jacobian if self._in_order else np.asarray(jacobian[:, self._to])


class Scratch:
    """Where a DynamicsTerms stands; a copy is a new one, for another Context."""

    def __init__(self, plant: Any) -> None:
        self._plant = plant
        self.context = plant.CreateDefaultContext()
        self.gravity = MultibodyForces(plant)

    def __deepcopy__(self, memo: object) -> "Scratch":
        return Scratch(self._plant)
