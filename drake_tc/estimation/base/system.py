"""`BaseEstimator`: the base estimator as a Drake system."""

from typing import Any

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.errors import ParamsError
from drake_tc.estimation.base.estimator import CopEstimator, FootCentreEstimator, FootCentreImuEstimator
from drake_tc.estimation.base.kinematics import CONTACT_FLAGS, FLAGS, BaseState, Sample, packed, place_of, unpacked
from drake_tc.estimation.base.rig import BaseEstimatorSpec
from drake_tc.kernels.calls import BASE_OUTPUTS, Kernel, KernelCall, copying
from drake_tc.robot.robot import Robot
from drake_tc.types import Call, FloatArray

METHODS: dict[str, type[CopEstimator] | type[FootCentreEstimator]] = {
    "cop": CopEstimator,
    "foot_centre": FootCentreEstimator,
    "foot_centre_imu": FootCentreImuEstimator,
}


_OUTPUTS = Kernel("base.outputs", "outputs")


class BaseEstimator(StageSystem):
    """Pose and velocity of a floating base from encoders, IMU and loads; n joints, k contacts.

    Inputs, read at the ticks alone:
        position (n), velocity (n): encoders [rad, rad/s], in the robot's order.
        imu (6): [gyro; accel], the IMU's axes [rad/s, m/s^2].
        imu_tilt (2): its roll and pitch [rad]; not connected or NaN: from gyro and accelerometer.
        wrench (6k): [f; t] of each contact's sensor, its axes [N, N m], in the contacts' order.
        contact_switch (k): 0 by the load's thresholds, 1 held on, -1 held off; not connected: 0.
    Outputs, all of the state alone, never NaN:
        base_pose (7): R_WB as quaternion [w x y z], p_WB [m].
        base_velocity (6): [omega; v] of B in W [rad/s, m/s].
        estimated_state (nq + nv): [q; v] of the robot's plant (`make_plant`), joints included.
        cop (2k): centres of pressure in their contacts' frames [m].
        status (9 + 5k): `flag_names`.
    State: x, a packed `BaseState`; y shows the sample of the last tick, x[n+1] = step(x[n], u[n]), y[n] = read(x[n]).
    """

    def __init__(
        self,
        robot: Robot,
        spec: BaseEstimatorSpec,
        *,
        method: str = "cop",
        position: FloatArray | None = None,
        yaw: float | None = None,
    ) -> None:
        """Declare ports, state and the periodic update.

        Args:
            robot: With a floating base and an IMU.
            spec: Contacts, period and tuning.
            method: "cop", or a baseline: "foot_centre", "foot_centre_imu".
            position: (3,) where the base starts [m]; the robot file's base pose by default.
            yaw: Its yaw there [rad].

        Raises:
            ParamsError: an unknown method, or what robot and contacts lack.
        """
        super().__init__()
        if method not in METHODS:
            raise ParamsError(f"BaseEstimator: method: expected one of {', '.join(METHODS)}, got {method!r}")
        self._estimator = METHODS[method](robot, spec)
        n, k = self._estimator.num_joints, self._estimator.num_contacts
        self._n, self._k = n, k
        start = robot.base_pose
        place = np.array(start.xyz if position is None else position, dtype=float)
        heading = start.rpy[2] if yaw is None else float(yaw)
        if place.shape != (3,) or not (np.isfinite(place).all() and np.isfinite(heading)):
            raise ParamsError(f"BaseEstimator: expected a finite start, got position {place.tolist()}, yaw {heading}")
        self._start, self._dt = packed(self._estimator.initial_state(place, heading)), spec.period
        self._order = np.array(self._estimator.kinematics.order, dtype=np.int64)
        joints = {"position": n, "velocity": n}
        self._declare({**joints, "imu": 6, "imu_tilt": 2, "wrench": 6 * k, "contact_switch": k})

    @property
    def flag_names(self) -> tuple[str, ...]:
        """Names of `status`: those of the whole, then `<contact>/<flag>`."""
        contacts = self._estimator.spec.contacts
        return (*FLAGS, *(f"{contact.mount.name}/{flag}" for contact in contacts for flag in CONTACT_FLAGS))

    def base_state(self, context: Any) -> BaseState:
        """All that is remembered."""
        self.ValidateContext(context)
        return unpacked(np.array(context.get_discrete_state(self._memory).value()), self._n, self._k)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        n, k = self._n, self._k
        cop, flags = place_of("pressure", n, k), slice(place_of("flags", n, k).start, None)
        shown = 14 + 2 * n + self._estimator.kinematics.state_size
        absent = {"imu_tilt": np.full(2, np.nan), "contact_switch": np.zeros(k)}
        names = ("position", "velocity", "imu", "imu_tilt", "wrench", "contact_switch")
        ends = np.cumsum([shown, *(self._start[part].size for part in (cop, flags))]).tolist()

        def bind(arrays: Arrays) -> tuple[list[Call], Call]:
            given = absent | {
                name: arrays.inputs[name] for name in names if name not in absent or name in arrays.inputs
            }
            sample, before, after = Sample(*(given[name] for name in names)), arrays.before, arrays.after
            whole, pressure, status = np.split(arrays.out, ends[:2])

            def show(time: float) -> None:
                _OUTPUTS(before, n, k, self._order, whole)

            def update(time: float) -> None:
                self._estimator.advance(before, sample, after)

            showing = KernelCall(BASE_OUTPUTS, show, before, n, k, self._order, whole)
            return [showing, copying(before[cop], pressure), copying(before[flags], status)], update

        parts = {"base_pose": slice(7), "base_velocity": slice(7 + n, 13 + n)}
        parts |= {"estimated_state": slice(14 + 2 * n, shown), "cop": slice(*ends[:2]), "status": slice(*ends[1:])}
        updates = frozenset(names)
        return ArrayStage(ends[2], places(parts), bind, updates=updates, start=self._start, period=self._dt)
