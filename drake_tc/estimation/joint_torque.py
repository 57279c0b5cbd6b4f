"""`JointTorqueEstimator`: Algorithm 1 (EQUATIONS A2) as a Drake system."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, LeafSystem, ValueProducer

from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.types import FloatArray

LARGEST = 1e9
"""No reading in SI units is as large; one that is counts as not finite."""


class JointTorqueEstimator(LeafSystem):  # type: ignore[misc, unused-ignore]
    """Joint torques and external wrenches from filtered sensors.

    Inputs:
        joint_estimate (3n): [q; qdot; qddot] [rad, rad/s, rad/s^2].
        imu_estimate (12): [gyro; accel; d gyro/dt; d accel/dt], the IMU's frame; need not be connected with a
            "fixed" base.
        wrench_estimate (6k): F/T readings [f; t], their own frames [N, N m]; absent where the robot has no F/T sensor.
    Outputs, all with direct feedthrough of every input, without state:
        estimated_torque (n): tau_hat, link side [N m].
        unknown_wrench (6): f_u = [f; t] on the model's unknown link, base axes [N, N m].
        contact_wrench (6k): E = [f; t] at the contact frames, base axes [N, N m]; absent where there is no sensor.
        fault (1): 1 where an input is not finite (or beyond `LARGEST`); the other outputs are then 0, never NaN.

        y[n] = TorqueModel.estimate(u[n])
    """

    def __init__(self, model: TorqueModel) -> None:
        """Declare the ports.

        Args:
            model: The kernel, for one robot.
        """
        super().__init__()
        self._model = model
        n, k = model.size, model.num_sensors
        self._n = n
        self._joint: Any = self.DeclareVectorInputPort("joint_estimate", 3 * n)
        self._imu: Any = self.DeclareVectorInputPort("imu_estimate", 12)
        inputs = {self._joint.ticket(), self._imu.ticket()}
        self._wrench: Any = None
        if k:
            self._wrench = self.DeclareVectorInputPort("wrench_estimate", 6 * k)
            inputs.add(self._wrench.ticket())
        self._no_imu, self._no_wrench = np.zeros(12), np.zeros(0)
        self._nothing = (np.zeros(n), np.zeros(6), np.zeros(6 * k), np.ones(1))
        self._good = np.zeros(1)
        self._scratch: Any = self.DeclareCacheEntry(
            "estimate", ValueProducer(allocate=self._allocate, calc=self._solve), inputs
        )
        on_scratch = {self._scratch.ticket()}
        self._declare("estimated_torque", n, 0, on_scratch)
        self._declare("unknown_wrench", 6, 1, on_scratch)
        if k:
            self._declare("contact_wrench", 6 * k, 2, on_scratch)
        self._declare("fault", 1, 3, on_scratch)

    @property
    def model(self) -> TorqueModel:
        """The kernel."""
        return self._model

    def _allocate(self) -> Any:
        """[scratch Context of the kernel's plant, last result], owned by the cache."""
        return Value(_Scratch(self._model.create_context(), self._nothing))

    def _declare(self, name: str, size: int, index: int, tickets: Any) -> None:
        self.DeclareVectorOutputPort(name, size, self._writer(index), tickets)

    def _writer(self, index: int) -> Callable[[Context, Any], None]:
        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._scratch.Eval(context).result[index])

        return write

    def _solve(self, context: Any, value: Any) -> None:
        """One estimate into the cache entry."""
        scratch: _Scratch = value.get_mutable_value()
        joint: FloatArray = self._joint.Eval(context)
        imu: FloatArray = self._imu.Eval(context) if self._imu.HasValue(context) else self._no_imu
        wrench: FloatArray = self._no_wrench if self._wrench is None else self._wrench.Eval(context)
        if not np.abs(np.concatenate((joint, imu, wrench))).max() < LARGEST:  # also where one is NaN
            scratch.result = self._nothing
            return
        n = self._n
        estimate = self._model.estimate(
            scratch.plant_context, joint[:n], joint[n : 2 * n], joint[2 * n :], imu[:6], imu[6:9], wrench
        )
        scratch.result = (*estimate, self._good)


class _Scratch:
    """What the cache entry holds."""

    def __init__(self, plant_context: Any, result: tuple[FloatArray, ...]) -> None:
        self.plant_context = plant_context
        self.result = result
