"""`JointTorqueEstimator`: Algorithm 1 of Del Prete et al. (2016) as a Drake system.

`MomentumResidual`: the generalized-momentum observer of what pushes the robot beyond what is known.

`WrenchTare`: zero the force/torque sensors while nothing touches the robot.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.kernels.calls import ESTIMATE, KernelCall, copying
from drake_tc.types import Call, FloatArray

LARGEST = 1e9
"""No reading in SI units is as large; one that is counts as not finite."""


class JointTorqueEstimator(StageSystem):
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
        """Declare the ports."""
        super().__init__()
        self._model = model
        n, k = model.size, model.num_sensors
        self._parts = _parts(n, k)
        self._declare({"joint_estimate": 3 * n, "imu_estimate": 12} | ({"wrench_estimate": 6 * k} if k else {}))

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
            imu = given["imu_estimate"] if model.uses_imu else np.zeros(12)
            wrench = given["wrench_estimate"] if model.num_sensors else np.zeros(0)

            def outputs(time: float) -> None:
                model.estimate_into(out, joint, imu, wrench, LARGEST)

            return KernelCall(ESTIMATE, outputs, joint, imu, wrench, *model.tables, LARGEST, out), None

        used = {"joint_estimate": True, "imu_estimate": model.uses_imu, "wrench_estimate": bool(model.num_sensors)}
        parts = {"estimate": slice(model.width), **self._parts}
        return ArrayStage(model.width, places(parts), bind, frozenset(name for name, needed in used.items() if needed))


def _parts(n: int, k: int) -> dict[str, slice]:
    """Output port to its place in `estimate`; without sensors there is no contact wrench."""
    sizes = {"estimated_torque": n, "unknown_wrench": 6, "contact_wrench": 6 * k, "fault": 1}
    ends = np.cumsum([0, *sizes.values()]).tolist()
    return {name: slice(a, b) for name, (a, b) in zip(sizes, pairwise(ends), strict=True) if b > a}


class MomentumResidual(StageSystem):
    r"""External generalized forces on n joints and the base, filtered by K, without joint accelerations.

    Inputs:
        joint_state (2n): [q; qdot] [rad, rad/s].
        torque (n): what the actuators give to the links [N m].
        imu_estimate (12): [gyro; accel; their derivatives], the IMU's frame; may stay open with a "fixed" base.
        contact_wrench (6k): known external wrenches at the contact frames, base axes [N, N m]; optional, zero.
    Outputs, from the state only:
        residual (n): r at the joints [N m].
        base_residual (6): r at the base: [f; t] at its origin, base axes [N, N m]; of a welded base, its reaction.

    With p = M qdot the momentum (rows: base and joints; columns: joints), the observer is

        r = K (p - \int (tau + (Mdot - C) qdot - g - M_b a_b + J_C^T E + r) dt)        =>  rdot = K (tau_ext - r)

    M_b a_b being the base's proper acceleration, which the IMU gives; gravity is in it. Over one tick the change of p
    is M dqdot + dM qdot, and dM qdot is the Mdot qdot of the integral: neither is computed. So, with b = M_b a_b + h -
    S^T tau - J_C^T E at the start of the tick and A = 1 - exp(-K dt),

        r[n+1] = r[n] + A (M[n-1] (qdot[n] - qdot[n-1])/dt + b[n-1] - r[n])

    which answers a force that is constant over ticks exactly as the first-order filter K/(s + K), one tick late.
    An input that is not finite leaves r as it is and starts the difference anew; nothing is raised in the loop.

    Connect it beside a loop to see contacts: `torque` is the loop's `estimated_torque`, or the torque of the drives.

    Source: De Luca and Mattone, "Sensorless robot collision detection and hybrid force/motion control", 2005; with the
    IMU in place of the floating base's velocity, as in Algorithm 1 of Del Prete et al. (2016).

    Example:
        >>> model = TorqueModel(load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml"))
        >>> MomentumResidual(model, gain=30.0, dt=1e-3).get_residual_output_port().size()
        6
    """

    def __init__(self, model: TorqueModel, gain: float, dt: float) -> None:
        """Declare ports and state.

        Args:
            model: The estimation plant and where the base's motion comes from.
            gain: K [1/s], the bandwidth [rad/s].
            dt: Period of the update [s].

        Raises:
            ParamsError: A gain or period that is not positive.
        """
        super().__init__()
        for name, value in (("gain", gain), ("dt", dt)):
            if not (np.isfinite(value) and value > 0.0):
                raise ParamsError(f"MomentumResidual: {name}: expected a positive number, got {value!r}")
        n, k = model.size, model.num_sensors
        self._model, self._n, self._dt = model, n, float(dt)
        self._blend = float(-np.expm1(-gain * dt))
        self._rows = np.concatenate([np.arange(6), model.model.velocity_index])
        wrench = {"contact_wrench": 6 * k} if k else {}
        self._declare({"joint_state": 2 * n, "torque": n, "imu_estimate": 12} | wrench)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n, rows = self._n, 6 + self._n
        ends = np.cumsum([rows, rows * n, rows, n, 1])

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            residual, inertia, rest, before, started = np.split(arrays.before, ends[:-1])
            after = np.split(arrays.after, ends[:-1])
            given, plant_context = arrays.inputs, self._model.create_context()
            joint, torque, imu = given["joint_state"], given["torque"], given.get("imu_estimate", np.zeros(12))
            contact = given.get("contact_wrench")
            readings = (joint, torque, imu) + (() if contact is None else (contact,))

            def outputs(time: float) -> None:
                arrays.out[:n], arrays.out[n : n + 3], arrays.out[n + 3 :] = residual[6:], residual[3:6], residual[:3]

            def update(time: float) -> None:
                after[-1][:] = np.abs(np.concatenate(readings)).max() < LARGEST  # not where one is NaN either
                if not after[-1][0]:
                    return
                if started[0] > 0.0:
                    seen = inertia.reshape(rows, n) @ ((joint[n:] - before) / self._dt) + rest
                    after[0][:] = residual + self._blend * (seen - residual)
                after[1][:], after[2][:] = self._start_of_tick(plant_context, joint, torque, imu, contact)
                after[3][:] = joint[n:]

            return outputs, update

        ports = places({"residual": slice(n), "base_residual": slice(n, n + 6)})
        inputs = {"joint_state", "torque", "imu_estimate"} | ({"contact_wrench"} if self._model.num_sensors else set())
        return ArrayStage(rows, ports, bind, updates=frozenset(inputs), start=np.zeros(int(ends[-1])), period=self._dt)

    def _start_of_tick(
        self, plant_context: Any, joint: FloatArray, torque: FloatArray, imu: FloatArray, contact: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """M, row by row, and b."""
        model, n = self._model, self._n
        rest = model.motion_forces(plant_context, MeasuredMotion(joint[:n], joint[n:], np.zeros(n), imu[:6], imu[6:9]))
        if contact is not None:
            rest = rest - model.contact_forces(plant_context, contact)
        rest = rest[self._rows]
        rest[6:] -= torque
        return model.motion_inertia(plant_context)[self._rows].ravel(), rest


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
