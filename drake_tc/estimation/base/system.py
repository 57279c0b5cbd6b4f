"""`BaseEstimator`: the base estimator as a Drake system."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RotationMatrix
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, ValueProducer

from drake_tc.errors import ParamsError
from drake_tc.estimation.base.chain import FootCentreEstimator, FootCentreImuEstimator
from drake_tc.estimation.base.estimator import CopEstimator
from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import CONTACT_FLAGS, FLAGS, BaseState, Readings, packed, unpacked
from drake_tc.port_methods import PortMethods
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

METHODS: dict[str, type[CopEstimator] | type[FootCentreEstimator]] = {
    "cop": CopEstimator,
    "foot_centre": FootCentreEstimator,
    "foot_centre_imu": FootCentreImuEstimator,
}


_NOTHING = np.zeros(1)
"""Of what the estimator does not know: see `BaseKinematics.order`."""


class _Unpacked:
    """A state in a cache."""

    state: BaseState


class BaseEstimator(PortMethods, LeafSystem):
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
        self._position: Any = self.DeclareVectorInputPort("position", n)
        self._velocity: Any = self.DeclareVectorInputPort("velocity", n)
        self._imu: Any = self.DeclareVectorInputPort("imu", 6)
        self._tilt: Any = self.DeclareVectorInputPort("imu_tilt", 2)
        self._wrench: Any = self.DeclareVectorInputPort("wrench", 6 * k)
        self._switch: Any = self.DeclareVectorInputPort("contact_switch", k)
        self._no_tilt, self._no_switch = np.full(2, np.nan), np.zeros(k)
        initial: Any = packed(self._estimator.initial_state(place, heading))
        state = self.DeclareDiscreteState(initial)
        self._state = int(state)
        self._scratch: Any = self.DeclareCacheEntry(
            "scratch",
            ValueProducer(allocate=lambda: Value(self._estimator.create_scratch()), calc=lambda context, value: None),
            {self.nothing_ticket()},
        )
        of_state = {self.discrete_state_ticket(state)}
        self._unpacked: Any = self.DeclareCacheEntry(
            "unpacked", ValueProducer(allocate=lambda: Value(_Unpacked()), calc=self._unpack), of_state
        )
        size = self._estimator.kinematics.state_size
        for name, width, calc in (
            ("base_pose", 7, self._write_pose),
            ("base_velocity", 6, self._write_velocity),
            ("estimated_state", size, self._write_state),
            ("cop", 2 * k, self._write_cop),
            ("status", len(self.flag_names), self._write_status),
        ):
            self.DeclareVectorOutputPort(name, width, calc, of_state)
        self.DeclarePeriodicDiscreteUpdateEvent(spec.period, 0.0, self._update)

    @property
    def flag_names(self) -> tuple[str, ...]:
        """Names of `status`: those of the whole, then `<contact>/<flag>`."""
        contacts = self._estimator.spec.contacts
        return (*FLAGS, *(f"{contact.mount.name}/{flag}" for contact in contacts for flag in CONTACT_FLAGS))

    def base_state(self, context: Any) -> BaseState:
        """All that is remembered."""
        state: BaseState = self._unpacked.Eval(context).state
        return state

    def _unpack(self, context: Any, value: Any) -> None:
        vector = np.array(context.get_discrete_state(self._state).value())
        value.get_mutable_value().state = unpacked(vector, self._n, self._k)

    def _update(self, context: Any, values: DiscreteValues) -> None:
        imu = self._imu.Eval(context)
        readings = Readings(
            q=self._position.Eval(context),
            qd=self._velocity.Eval(context),
            gyro=imu[:3],
            accel=imu[3:],
            tilt=self._tilt.Eval(context) if self._tilt.HasValue(context) else self._no_tilt,
            wrench=self._wrench.Eval(context).reshape(self._k, 6),
            switch=self._switch.Eval(context) if self._switch.HasValue(context) else self._no_switch,
        )
        after = self._estimator.step(self._scratch.Eval(context), self.base_state(context), readings)
        vector: Any = packed(after)
        values.set_value(self._state, vector)

    def _write_pose(self, context: Context, vector: Any) -> None:
        state = self.base_state(context)
        vector.set_value(np.concatenate((_quaternion(state.rotation), state.position)))

    def _write_velocity(self, context: Context, vector: Any) -> None:
        vector.set_value(np.concatenate(_twists(self.base_state(context))))

    def _write_state(self, context: Context, vector: Any) -> None:
        state, kinematics = self.base_state(context), self._estimator.kinematics
        found = (_quaternion(state.rotation), state.position, state.q, *_twists(state), state.qd, _NOTHING)
        vector.set_value(np.concatenate(found)[kinematics.order])

    def _write_cop(self, context: Context, vector: Any) -> None:
        vector.set_value(self.base_state(context).pressure.ravel())

    def _write_status(self, context: Context, vector: Any) -> None:
        state = self.base_state(context)
        vector.set_value(np.concatenate((state.flags, state.contact_flags.ravel())))


def _quaternion(R: FloatArray) -> FloatArray:
    return np.asarray(RotationMatrix(R).ToQuaternion().wxyz())


def _twists(state: BaseState) -> tuple[FloatArray, FloatArray]:
    return state.rotation @ state.rate, state.rotation @ state.velocity
