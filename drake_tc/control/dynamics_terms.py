"""Inverse dynamics of a robot with a welded base: M vdot + h and the contacts' Jacobian at one configuration.

Inverse dynamics of a robot whose base floats: what the joints must give while the base moves as its IMU says.

With the base's angular velocity omega, angular acceleration alpha and proper acceleration a, all in base axes
(`drake_tc.estimation.plant`), in a plant without gravity whose base has that proper acceleration:

    tau = S ( M [alpha; a; qddot_d] + h(q_d, [omega; 0; qdot_d]) )

The base is not asked to do anything: whatever carries it (springs, a crane, the other leg) makes it move as it does.
Neither its pose nor its linear velocity enters, as in the torque estimate.
"""

from typing import Any, Literal

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable

from drake_tc.errors import ParamsError
from drake_tc.estimation.plant import CONTACT_SUFFIX, IMU_SUFFIX, BaseMotion, build_plant
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.plant import in_order, tree_of
from drake_tc.robot.robot import Robot
from drake_tc.types import GRAVITY, FloatArray

_JOINT_FORCES = Kernel("joint_torque", "joint_forces")


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
        self._build(robot)
        pose = robot.base_pose.transform
        self._still = np.array([*pose.rotation().ToQuaternion().wxyz(), *np.zeros(14), GRAVITY])

    def _build(self, robot: Robot) -> None:
        self._model = model = build_plant(robot, cuts=False)
        self._plant: Any = model.plant
        self._frames = tuple(self._plant.GetFrameByName(mount.name + CONTACT_SUFFIX) for mount in robot.force_torque)
        self.size, self.wrenches = len(robot.joints), 6 * len(self._frames)
        movable = self._plant.num_velocities() - 6
        if movable != self.size + len(robot.followers):
            raise ParamsError(f"robot {robot.name!r}: expected {self.size} movable joints, those listed, got {movable}")
        tree = tree_of(self._plant, model.base.body(), in_order(robot), {})
        self.tree = (tree.places, tree.constants, tree.trunk)
        self._origin: Any = np.zeros(3)
        self._force_first = np.array([3, 4, 5, 0, 1, 2])

    def create_scratch(self) -> "Scratch":
        """Scratch memory for the other methods."""
        return Scratch(self._plant)

    def place(self, scratch: "Scratch", q: FloatArray, v: FloatArray) -> None:
        """Go to q, v (n,) [rad, rad/s], where the terms are taken."""
        scratch.q, scratch.v = q.copy(), v.copy()

    def forces(self, scratch: "Scratch", vdot: FloatArray) -> FloatArray:
        """(n,) M vdot + h [N m] for vdot (n,) [rad/s^2], by one recursion; h = C(q, v) v - tau_g(q)."""
        out = np.empty(self.size)
        _JOINT_FORCES((scratch.q, scratch.v, vdot), self.tree, self.base(scratch), out)
        return out

    def base(self, scratch: "Scratch") -> FloatArray:
        """(19,) how the base moves, see `drake_tc.kernels.joint_torque.joint_forces`: not at all."""
        return self._still

    def jacobian(self, scratch: "Scratch") -> FloatArray:
        """(6k, n) J."""
        base, state = self._model.base, self._model.state_of(scratch.q, scratch.v)
        self._plant.SetPositionsAndVelocities(scratch.context, state)
        rows: Any = [
            self._plant.CalcJacobianSpatialVelocity(
                scratch.context, JacobianWrtVariable.kV, frame, self._origin, base, base
            )[self._force_first]
            @ self._model.moves
            for frame in self._frames
        ]
        return np.concatenate(rows) if rows else np.zeros((0, self.size))


class Scratch:
    """Where the terms stand and how their base moves; a copy is a new one, for another Context."""

    def __init__(self, plant: Any) -> None:
        self._plant = plant
        self.context = plant.CreateDefaultContext()
        self.q = self.v = np.zeros(0)
        self.rate, self.acceleration = np.zeros(3), np.zeros(6)

    def __deepcopy__(self, memo: object) -> "Scratch":
        return Scratch(self._plant)


BaseRotation = Literal["gyro", "neglected"]


class FloatingTerms(DynamicsTerms):
    """The torques above and J as `DynamicsTerms` has it, of a base that is carried: `carry`, then `place`."""

    def __init__(self, robot: Robot, angular_acceleration: BaseRotation = "gyro") -> None:
        """Build the model.

        Args:
            robot: With an IMU; the first one is used.
            angular_acceleration: Of the IMU's link: the "gyro"'s derivative, or "neglected".

        Raises:
            ParamsError: no IMU, movable joints that are not listed, or a URDF that cannot be read.
        """
        if not robot.imu:
            raise ParamsError(
                f"robot {robot.name!r}: expected an IMU, as its base floats and its motion must be known; it has none"
            )
        self._build(robot)
        self._motion = BaseMotion(self._model, self._plant.GetFrameByName(robot.imu[0].name + IMU_SUFFIX))
        self._rotates = angular_acceleration == "gyro"

    def carry(self, scratch: Scratch, imu: FloatArray, joints: FloatArray) -> None:
        """Take the base's motion from its IMU.

        Args:
            scratch: Keeps omega and [alpha; a].
            imu: (12,) [gyro; accel; d gyro/dt; d accel/dt] in the IMU's frame [rad/s, m/s^2].
            joints: (3n,) [q; qdot; qddot] at the same instant.
        """
        n = self.size
        state = self._model.state_of(joints[:n], joints[n : 2 * n])
        rate = imu[6:9] if self._rotates else np.zeros(3)
        scratch.acceleration = self._motion.solve(scratch.context, state, joints[2 * n :], imu[:6], rate)
        first = self._plant.num_positions()
        scratch.rate = state[first : first + 3].copy()

    def base(self, scratch: Scratch) -> FloatArray:
        """(19,) how the base moves as `carry` had it, see `drake_tc.kernels.joint_torque.joint_forces`."""
        base = np.zeros(19)
        base[0], base[7:10], base[13:] = 1.0, scratch.rate, scratch.acceleration
        return base
