"""How the base moves, from an IMU anywhere on the robot (Del Prete et al., 2016, Algorithm 1).

With I the IMU's frame, B the base (whose axes are the world's in `EstimationPlant`), J and b = Jdot v the Jacobian and
bias acceleration of I over all velocities:

    omega   = R_BI gyro - J_omega,j qdot                       angular velocity of the base
    alpha   = R_BI gyro_dot - J_omega,j qddot - b_omega        its angular acceleration
    a       = R_BI accel - J_v,j qddot - b_v - alpha x p_BI    proper acceleration (a - g) of B's origin

b holds the centripetal and Coriolis terms of the joints between base and IMU and of the base's rotation. With no
joint between them the transform is constant: a = R_BI accel - alpha x p - omega x (omega x p).
"""

from typing import Any

import numpy as np
from pydrake.multibody.tree import Frame, JacobianWrtVariable

from drake_tc.estimation.plant import EstimationPlant, skew
from drake_tc.types import FloatArray


class BaseMotion:
    """Angular velocity, angular and proper acceleration of the base, in base axes, from one IMU."""

    def __init__(self, model: EstimationPlant, imu: Frame) -> None:
        """Precompute what is constant.

        Args:
            model: The estimation plant.
            imu: I, a frame of its plant.
        """
        plant: Any = model.plant
        self._plant, self._imu, self._world = plant, imu, plant.world_frame()
        self._joints = model.velocity_index
        self._first_velocity = plant.num_positions()
        self._origin: Any = np.zeros(3)
        context = plant.CreateDefaultContext()
        plant.SetPositionsAndVelocities(context, model.state)
        self.rigid = model.welded_to_base(imu)
        X_BI = imu.CalcPoseInWorld(context)
        self.rotation = np.array(X_BI.rotation().matrix())
        arm = np.array(X_BI.translation())
        self._place: tuple[float, ...] = tuple(arm.tolist())
        self._lever = skew(arm)
        self._turn = np.kron(np.eye(2), self.rotation)

    def solve(
        self, context: Any, state: FloatArray, vdot: FloatArray, imu: FloatArray, gyro_dot: FloatArray | None
    ) -> FloatArray:
        """Write the base's rates into `state` and into the plant's context.

        Args:
            context: Of the plant; leaves with positions and velocities of `state`.
            state: (nq + nv,) of the plant with the joints' part in place, base velocity zero; its base part is filled.
            vdot: (n,) joint accelerations [rad/s^2].
            imu: (6,) [gyro; accel] in I [rad/s, m/s^2].
            gyro_dot: (3,) derivative of the gyro [rad/s^2]; None: the base's angular acceleration is known to be zero.

        Returns:
            (6,) [alpha; a] of B's origin, base axes [rad/s^2, m/s^2].
        """
        first = self._first_velocity
        if self.rigid:
            x, y, z, *accel = self._turn.dot(
                imu
            ).tolist()  # omega and the IMU's acceleration; as floats: 3 numbers each
            state[first : first + 3] = x, y, z
            self._plant.SetPositionsAndVelocities(context, state)
            px, py, pz = self._place
            square, along = x * x + y * y + z * z, x * px + y * py + z * pz
            a = (  # with - omega x (omega x p)
                accel[0] + square * px - along * x,
                accel[1] + square * py - along * y,
                accel[2] + square * pz - along * z,
            )
            if gyro_dot is None:
                return np.array((0.0, 0.0, 0.0, *a))
            alpha = self.rotation.dot(gyro_dot)
            return np.concatenate((alpha, a + self._lever.dot(alpha)))
        plant, world, origin = self._plant, self._world, self._origin
        plant.SetPositionsAndVelocities(context, state)
        jacobian = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, self._imu, origin, world, world)
        rotation = self._imu.CalcRotationMatrixInWorld(context).matrix()
        own = jacobian[:, self._joints]
        state[first : first + 3] = rotation @ imu[:3] - own[:3] @ state[first + self._joints]
        plant.SetVelocities(context, state[first:])
        bias = plant.CalcBiasSpatialAcceleration(
            context, JacobianWrtVariable.kV, self._imu, origin, world, world
        ).get_coeffs()
        rest = own @ vdot + bias
        alpha = origin if gyro_dot is None else rotation @ gyro_dot - rest[:3]
        a = rotation @ imu[3:] - rest[3:] - jacobian[3:, :3] @ alpha
        return np.concatenate((alpha, a))

    def coupling(self, context: Any, *, rotates: bool = True) -> FloatArray | None:
        """Derivative of [alpha; a] by qddot (6, n), None where it is zero, at the last `solve`.

        The IMU's acceleration holds that of the joints between it and the base.

        Args:
            context: As `solve` left it.
            rotates: False where the base's angular acceleration is known to be zero.
        """
        if self.rigid:
            return None
        world = self._world
        jacobian = self._plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, self._imu, self._origin, world, world
        )
        own = -jacobian[:, self._joints]
        if rotates:
            own[3:] -= jacobian[3:, :3] @ own[:3]
        else:
            own[:3] = 0.0
        return np.asarray(own)
