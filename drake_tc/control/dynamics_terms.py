"""Inverse dynamics of a robot with a welded base: M, h and the contacts' Jacobian at one configuration."""

from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


class DynamicsTerms:
    """M (n, n), h (n) and J (6k, n) of the links alone: rotor inertia and friction belong to the drives' models.

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
                f"robot {robot.name!r}: wanted a welded base (fixed_base: true); it floats, and the joints' inverse"
                " dynamics alone does not say how the base moves"
            )
        plant = MultibodyPlant(0.0)
        add_robot(plant, replace(robot, rotor_inertia={}))
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
                f"robot {robot.name!r}: wanted {self.size} movable joints, those listed; got {plant.num_velocities()}"
            )
        straight = np.arange(self.size)
        self._in_order = np.array_equal(positions, straight) and np.array_equal(velocities, straight)
        self._from = np.argsort(positions)  # plant order from ours; one velocity a joint, so the same for both
        self._to = positions
        self._origin: Any = np.zeros(3)
        self._force_first = np.array([3, 4, 5, 0, 1, 2])

    def create_context(self) -> Any:
        """Scratch memory for `at`."""
        return self._plant.CreateDefaultContext()

    def at(self, context: Any, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(M, h, J) at q, v (n,) [rad, rad/s].

        h = C(q, v) v - tau_g(q) [N m]: Coriolis, centrifugal and gravity.
        """
        plant, order = self._plant, self._in_order
        state: Any = np.concatenate((q, v) if order else (q[self._from], v[self._from]))
        plant.SetPositionsAndVelocities(context, state)
        mass: Any = plant.CalcMassMatrix(context)
        bias: Any = plant.CalcBiasTerm(context)
        bias = bias - plant.CalcGravityGeneralizedForces(context)
        with_respect_to, base = JacobianWrtVariable.kV, self._base
        rows: Any = [
            plant.CalcJacobianSpatialVelocity(context, with_respect_to, frame, self._origin, base, base)[
                self._force_first
            ]
            for frame in self._frames
        ]
        jacobian: Any = rows[0] if len(rows) == 1 else np.concatenate(rows) if rows else np.zeros((0, self.size))
        if order:
            return mass, bias, jacobian
        return mass[np.ix_(self._to, self._to)], bias[self._to], jacobian[:, self._to]
