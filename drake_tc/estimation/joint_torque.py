"""`JointTorqueEstimator`: Algorithm 1 of Del Prete et al. (2016) as a Drake system."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, LeafSystem

from drake_tc.array_stage import Arrays, ArrayStage, places
from drake_tc.estimation.torque_model import TorqueModel
from drake_tc.kernels.calls import ESTIMATE, KernelCall
from drake_tc.port_methods import PortMethods
from drake_tc.types import Call, FloatArray

LARGEST = 1e9
"""No reading in SI units is as large; one that is counts as not finite."""


class JointTorqueEstimator(PortMethods, LeafSystem):
    """Joint torques and external wrenches from filtered sensors.

    Inputs:
        joint_estimate (3n): [q; qdot; qddot] [rad, rad/s, rad/s^2].
        imu_estimate (12): [gyro; accel; d gyro/dt; d accel/dt], the IMU's frame; not looked at with a "fixed" base.
        wrench_estimate (6k): F/T readings [f; t], their own frames [N, N m]; absent where the robot has no F/T sensor.
    Outputs, all with direct feedthrough of every input, without state:
        estimated_torque (n): tau_hat, link side [N m].
        unknown_wrench (6): f_u = [f; t] on the model's unknown link, base axes [N, N m].
        contact_wrench (6k): E = [f; t] at the contact frames, base axes [N, N m]; absent where there is no sensor.
        fault (1): 1 where an input is not finite (or beyond `LARGEST`); the other outputs are then 0, never NaN.
        estimate (n + 6 + 6k + 1): those one behind the other, for one call into Python a tick.

        y[n] = TorqueModel.estimate(u[n])

    Example:
        >>> model = TorqueModel(load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml"))
        >>> JointTorqueEstimator(model).get_estimated_torque_output_port().size()
        6
    """

    def __init__(self, model: TorqueModel) -> None:
        """Declare the ports.

        Args:
            model: The kernel, for one robot.
        """
        super().__init__()
        self._model = model
        n, k = model.size, model.num_sensors
        self._joint: Any = self.DeclareVectorInputPort("joint_estimate", 3 * n)
        self._imu: Any = self.DeclareVectorInputPort("imu_estimate", 12)
        inputs = {self._joint.ticket(), self._imu.ticket()}
        self._wrench: Any = None
        if k:
            self._wrench = self.DeclareVectorInputPort("wrench_estimate", 6 * k)
            inputs.add(self._wrench.ticket())
        self._no_imu, self._no_wrench = np.zeros(12), np.zeros(0)
        self._parts = _parts(n, k)
        self._estimate: Any = self.DeclareVectorOutputPort("estimate", model.width, self._solve, inputs)
        for name, part in self._parts.items():
            self.DeclareVectorOutputPort(name, part.stop - part.start, self._writer(part), inputs)

    @property
    def model(self) -> TorqueModel:
        """The kernel."""
        return self._model

    @property
    def parts(self) -> dict[str, slice]:
        """The other output ports by name, and where each stands in `estimate`."""
        return dict(self._parts)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        model = self._model

        def bind(arrays: Arrays) -> tuple[Call, None]:
            given, out = arrays.inputs, arrays.out
            joint = given["joint_estimate"]
            imu = given["imu_estimate"] if model.uses_imu else self._no_imu
            wrench = given["wrench_estimate"] if model.num_sensors else self._no_wrench

            def outputs(time: float) -> None:
                model.estimate_into(out, joint, imu, wrench, LARGEST)

            return KernelCall(ESTIMATE, outputs, joint, imu, wrench, *model.tables, LARGEST, out), None

        used = {"joint_estimate": True, "imu_estimate": model.uses_imu, "wrench_estimate": bool(model.num_sensors)}
        parts = {**self._parts, "estimate": slice(model.width)}
        return ArrayStage(model.width, places(parts), bind, frozenset(name for name, needed in used.items() if needed))

    def _writer(self, part: slice) -> Callable[[Context, Any], None]:
        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._estimate.Eval(context)[part])

        return write

    def _solve(self, context: Any, vector: Any) -> None:
        """All outputs, one behind the other."""
        joint: FloatArray = self._joint.Eval(context)
        imu: FloatArray = self._imu.Eval(context) if self._model.uses_imu else self._no_imu
        wrench: FloatArray = self._no_wrench if self._wrench is None else self._wrench.Eval(context)
        self._model.estimate_into(vector.get_mutable_value(), joint, imu, wrench, LARGEST)


def _parts(n: int, k: int) -> dict[str, slice]:
    """Output port to its place in `estimate`; without sensors there is no contact wrench."""
    sizes = {"estimated_torque": n, "unknown_wrench": 6, "contact_wrench": 6 * k, "fault": 1}
    ends = np.cumsum([0, *sizes.values()]).tolist()
    return {name: slice(a, b) for name, (a, b) in zip(sizes, pairwise(ends), strict=True) if b > a}
