"""`ForceTorque`: six-axis sensors inside fixed joints."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.errors import ParamsError
from drake_tc.robot.robot import Robot
from drake_tc.sensing.corruption import Corruption
from drake_tc.sensing.fault import SensorFault
from drake_tc.sensing.sensor import SensorBase
from drake_tc.sensing.spec import SensorSpec, joined
from drake_tc.types import FloatArray


def wrench_map(X_JS: RigidTransform) -> FloatArray:
    """(6, 6) A of W_S = A [τ_J; f_J]: from Drake's reaction on the child at Jc to what the sensor reads.

        W_S = -[R_SJ f_J; R_SJ (τ_J - p_JS × f_J)]

    The reaction F_CJc_Jc acts on the child; what the distal part exerts on the proximal one is its opposite.

    Args:
        X_JS: Pose of the sensor frame S in the joint's child frame Jc.
    """
    R_SJ = np.asarray(X_JS.rotation().matrix().T, dtype=np.float64)
    x, y, z = X_JS.translation()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.block([[np.zeros((3, 3)), -1.0 * R_SJ], [-1.0 * R_SJ, R_SJ @ cross]])


class ForceTorque(SensorBase):
    """k force/torque sensors.

    Input:
        reaction_forces: of the MultibodyPlant.
    Output:
        reading (6k): [fx fy fz tx ty tz] a sensor, [N] and [N m], at the sensor frame S, in S: the wrench that the
            distal part, and whatever touches it, exerts on the proximal part. A standing robot reads +fz upwards.

    See `SensorBase` for the recursion, `wrench_map` for the truth.
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
            robot: With at least one force/torque sensor.
            spec: Of all 6k channels: 1 or 6k values a field (`force_torque_spec`).
            dt: Period [s].
            faults: When it fails; channels 6 i ... 6 i + 5 are the sensor i.
            seed: Of its random numbers.

        Raises:
            ParamsError: A robot without such a sensor; otherwise as `Corruption`.
        """
        super().__init__()
        if not robot.force_torque:
            raise ParamsError(f"{robot.source}: force_torque: expected at least one; the robot file has none")
        model = plant.GetModelInstanceByName(robot.name)
        self._joints: list[int] = []
        count = len(robot.force_torque)
        self._map = np.zeros((6 * count, 6 * count))
        for k, mount in enumerate(robot.force_torque):
            joint = plant.GetJointByName(mount.joint, model)
            X_CJ = joint.frame_on_child().GetFixedPoseInBodyFrame()
            self._joints.append(int(joint.index()))
            part = slice(6 * k, 6 * k + 6)
            self._map[part, part] = wrench_map(X_CJ.inverse() @ mount.pose.transform)
        reactions = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        self._declare(reactions, Corruption(6 * count, spec, dt, tuple(faults), seed))

    def _truth_of(self, forces: Any) -> FloatArray:
        reactions = np.empty((len(self._joints), 6))
        for row, joint in enumerate(self._joints):
            reactions[row] = forces[joint].get_coeffs()
        return np.asarray(self._map.dot(reactions.ravel()))


def force_torque_spec(force: SensorSpec, torque: SensorSpec, sensors: int = 1) -> SensorSpec:
    """The spec of `ForceTorque` from those of its forces and torques, of three channels each.

    Raises:
        ParamsError: Different latencies, or values for another number of channels than 3.
    """
    return joined([(force, 3), (torque, 3)] * sensors)
