"""`WrenchTare`: zero the force/torque sensors while nothing touches the robot."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.kernels.calls import copying
from drake_tc.types import Call, FloatArray


class WrenchTare(StageSystem):
    """Readings less their bias, which is what they show of a robot that nothing touches beyond what its motion needs.

    Inputs:
        joint_estimate (3n): [q; qdot; qddot] [rad, rad/s, rad/s^2].
        imu_estimate (12): [gyro; accel; d gyro/dt; d accel/dt]; not needed with a "fixed" base.
        wrench (6k): filtered F/T readings, sensor frames [N, N m].
    Outputs:
        wrench (6k): y[n] = u[n] - b[n]; feedthrough of `wrench` alone. Not finite where u is not.
        correction (6k): -b[n], to be added to other readings of the same sensors; of the state alone.
        memory (6k + 1): [b; m]; of the state alone, and read without a call into Python.
    State: b (6k), m, both 0 at the start. At the multiples of `period` within [begin, end]:
        b[n+1] = b[n] + (u[n] - w[n] - b[n])/(m[n] + 1),   m[n+1] = m[n] + 1
    with w the reading that the model expects of a robot that nothing touches; a sample that is not finite is left out.
    """

    def __init__(self, model: TorqueModel, begin: float, end: float, period: float = 0.01) -> None:
        """Declare ports, state and the periodic update.

        Args:
            model: The estimator's kernel.
            begin: First time at which the bias is measured [s]; after the filters have filled.
            end: Last time [s].
            period: Between two measurements [s].

        Raises:
            ParamsError: times that do not increase or lie closer than one period, a period that is not positive, or a
                robot without F/T sensors.
        """
        super().__init__()
        if not 0.0 <= begin < end < np.inf or not period > 0.0:
            raise ParamsError(
                f"tare: expected 0 <= begin < end and a positive period [s], got {begin}, {end}, {period}"
            )
        if end - begin < period * (1.0 - 1e-9):
            raise ParamsError(
                f"tare: expected at least one period of {period} s between begin and end, got {begin}, {end}"
            )
        if not model.num_sensors:
            raise ParamsError(f"tare: {model.robot.name} has no force/torque sensor")
        self._model, self._begin, self._end = model, begin, end
        self._size, self._period, self._no_imu = 6 * model.num_sensors, float(period), np.zeros(12)
        self._declare({"joint_estimate": 3 * model.size, "imu_estimate": 12, "wrench": self._size})

    def coordinate_names(self) -> tuple[str, ...]:
        """Of the state, for linearisations: "sensor/axis bias", and "samples" that the bias was measured from."""
        axes = ("fx", "fy", "fz", "tx", "ty", "tz")
        sensors = [mount.name for mount in self._model.robot.force_torque]
        return (*(f"{sensor}/{axis} bias" for sensor in sensors for axis in axes), "samples")

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n = self._size

        def bind_early(arrays: Arrays) -> tuple[Sequence[Call], None]:
            memory, less = np.split(arrays.out, [n + 1])

            def negate(time: float) -> None:
                np.negative(memory[:n], out=less)

            return (copying(arrays.before, memory), negate), None

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            given, before, after, out = arrays.inputs, arrays.before, arrays.after, arrays.out
            joint, wrench = given["joint_estimate"], given["wrench"]
            imu, scratch = given.get("imu_estimate", self._no_imu), self._model.create_context()

            def outputs(time: float) -> None:
                np.subtract(wrench, before[:n], out=out)

            def update(time: float) -> None:
                if self._begin <= time <= self._end:
                    after[:] = self._next(scratch, before, joint, imu, wrench)

            return outputs, update

        of_state = places({"memory": slice(n + 1), "correction": slice(n + 1, 2 * n + 1)})
        early, ports = ArrayStage(2 * n + 1, of_state, bind_early), places({"wrench": slice(n)})
        updates = frozenset({"joint_estimate", "imu_estimate"})
        return ArrayStage(n, ports, bind, frozenset({"wrench"}), updates, np.zeros(n + 1), self._period, early)

    def _next(
        self, scratch: Any, old: FloatArray, joint: FloatArray, imu: FloatArray, wrench: FloatArray
    ) -> FloatArray:
        """[b; m] with one more sample."""
        if not np.isfinite(joint.sum() + imu.sum() + wrench.sum()):
            return old
        n = self._model.size
        motion = MeasuredMotion(joint[:n], joint[n : 2 * n], joint[2 * n :], imu[:6], imu[6:9])
        error = self._model.reading_error(scratch, motion, wrench)
        count = old[-1] + 1.0
        return np.append(old[:-1] + (error - old[:-1]) / count, count)
