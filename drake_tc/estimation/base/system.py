"""`BaseEstimator`: the base estimator as a Drake system."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, ValueProducer

from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.errors import ParamsError
from drake_tc.estimation.base.estimator import CopEstimator, FootCentreEstimator, FootCentreImuEstimator
from drake_tc.estimation.base.kinematics import CONTACT_FLAGS, FLAGS, BaseState, Sample, packed, place_of, unpacked
from drake_tc.estimation.base.rig import BaseEstimatorSpec
from drake_tc.kernels.calls import BASE_OUTPUTS, KernelCall, copying
from drake_tc.kernels.lazy import Kernel
from drake_tc.robot.robot import Robot
from drake_tc.types import Call, FloatArray

METHODS: dict[str, type[CopEstimator] | type[FootCentreEstimator]] = {
    "cop": CopEstimator,
    "foot_centre": FootCentreEstimator,
    "foot_centre_imu": FootCentreImuEstimator,
}


_OUTPUTS = Kernel("base_outputs", "outputs")


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
        self._state, self._start, self._dt = int(state), np.asarray(initial), spec.period
        cop, flags = place_of("pressure", n, k), slice(place_of("flags", n, k).start, None)
        kinematics, of_state = self._estimator.kinematics, {self.discrete_state_ticket(state)}
        size = kinematics.state_size
        self._order = np.array(kinematics.order, dtype=np.int64)
        whole = np.zeros(14 + 2 * n + size)
        self._shown: Any = self.DeclareCacheEntry(
            "shown", ValueProducer(allocate=Value(whole).Clone, calc=self._show), of_state
        )
        self._shown_parts = {
            "base_pose": slice(0, 7),
            "base_velocity": slice(7 + n, 13 + n),
            "estimated_state": slice(14 + 2 * n, whole.size),
        }
        self._state_parts = {"cop": cop, "status": flags}
        for name, part in self._shown_parts.items():
            width = len(whole[part])
            self.DeclareVectorOutputPort(name, width, self._shower(part), {self._shown.ticket()})
        self.DeclareVectorOutputPort("cop", 2 * k, self._writer(cop), of_state)
        self.DeclareVectorOutputPort("status", len(self.flag_names), self._writer(flags), of_state)
        self.DeclarePeriodicDiscreteUpdateEvent(spec.period, 0.0, self._update)

    @property
    def flag_names(self) -> tuple[str, ...]:
        """Names of `status`: those of the whole, then `<contact>/<flag>`."""
        contacts = self._estimator.spec.contacts
        return (*FLAGS, *(f"{contact.mount.name}/{flag}" for contact in contacts for flag in CONTACT_FLAGS))

    def base_state(self, context: Any) -> BaseState:
        """All that is remembered."""
        self.ValidateContext(context)
        return unpacked(np.array(context.get_discrete_state(self._state).value()), self._n, self._k)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        cop, flags = self._state_parts.values()
        shown = self._shown_parts["estimated_state"].stop
        absent = {"imu_tilt": self._no_tilt, "contact_switch": self._no_switch}
        names = ("position", "velocity", "imu", "imu_tilt", "wrench", "contact_switch")
        ends = np.cumsum([shown, *(self._start[part].size for part in (cop, flags))]).tolist()

        def bind(arrays: Arrays) -> tuple[list[Call], Call]:
            given = absent | {
                name: arrays.inputs[name] for name in names if name not in absent or name in arrays.inputs
            }
            sample, before, after = Sample(*(given[name] for name in names)), arrays.before, arrays.after
            whole, pressure, status = np.split(arrays.out, ends[:2])

            def show(time: float) -> None:
                _OUTPUTS(before, self._n, self._k, self._order, whole)

            def update(time: float) -> None:
                self._estimator.advance(before, sample, after)

            showing = KernelCall(BASE_OUTPUTS, show, before, self._n, self._k, self._order, whole)
            return [showing, copying(before[cop], pressure), copying(before[flags], status)], update

        parts = {**self._shown_parts, "cop": slice(ends[0], ends[1]), "status": slice(ends[1], ends[2])}
        updates = frozenset(names)
        return ArrayStage(ends[2], places(parts), bind, updates=updates, start=self._start, period=self._dt)

    def _update(self, context: Context, values: DiscreteValues) -> None:
        """x[n+1]."""
        now: Any = context.get_discrete_state(self._state)
        after: Any = values.get_mutable_value(self._state)
        sample = Sample(
            self._position.Eval(context),
            self._velocity.Eval(context),
            self._imu.Eval(context),
            self._tilt.Eval(context) if self._tilt.HasValue(context) else self._no_tilt,
            self._wrench.Eval(context),
            self._switch.Eval(context) if self._switch.HasValue(context) else self._no_switch,
        )
        self._estimator.advance(now.value(), sample, after)

    def _show(self, context: Any, value: Any) -> None:
        """Pose, velocity and the plant's state, see `drake_tc.kernels.base_outputs`."""
        state = context.get_discrete_state(self._state).value()
        _OUTPUTS(state, self._n, self._k, self._order, value.get_mutable_value())

    def _shower(self, part: slice) -> Callable[[Context, Any], None]:
        """The calc function of an output that `_show` writes."""

        def write(context: Context, vector: Any) -> None:
            vector.set_value(self._shown.Eval(context)[part])

        return write

    def _writer(self, part: slice) -> Callable[[Context, Any], None]:
        """The calc function of an output that is part of the state."""

        def write(context: Context, vector: Any) -> None:
            state: Any = context.get_discrete_state(self._state)
            vector.set_value(state.value()[part])

        return write
