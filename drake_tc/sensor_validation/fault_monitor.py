"""`FaultMonitor`: which sensors are missing, frozen, jumping or at odds with what is known."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.errors import ParamsError
from drake_tc.estimation.joint_torque import LARGEST
from drake_tc.estimation.plant import IMU_SUFFIX, BaseMotion, build_plant
from drake_tc.kernels.calls import RAISE_FLAGS, Kernel, KernelCall, copying
from drake_tc.robot.plant import Limits, joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.sensor_validation.monitor_spec import MonitorSpec
from drake_tc.types import GRAVITY, Call, FloatArray

FASTEST = 20.0
"""Speed of a joint without a velocity limit [rad/s]."""
STRONGEST = 100.0
"""Effort of a joint without an effort limit [N m]."""
ENCODER_REPEATS = 20
"""No fewer identical readings of an encoder count as frozen, however long the tick."""
REPEATS = 6
"""The same of an IMU or F/T channel, whose noise is ten times its resolution."""
RANGE_SLACK = 1e-6
"""A reference this far beyond the end of a joint's range is at the end [rad]."""
_NEVER = 1e12
_RAISE_FLAGS = Kernel("fault_monitor", "raise_flags")


class FaultMonitor(StageSystem):
    """Flags of sensor faults; n joints, k F/T sensors, N = n + 6 + 6k raw channels u.

    Inputs:
        position (n): raw readings of the encoders [rad].
        imu (6): raw [gyro; accel] of the robot's first IMU; absent where it has none.
        wrench (6k): raw F/T readings [f; t]; absent where the robot has no sensor.
        reference_velocity (n): [rad/s]; optional.
        unknown_wrench (6): of a `JointTorqueEstimator`, where it should be zero [N, N m]; optional. Leave it open where
            the unknown wrench is the reaction of a welded base.
        contact_wrench (6k): of a `JointTorqueEstimator`; looked at for the `free` sensors; optional.
        torque_residual (n): estimated torque - torque of the actuator model [N m]; optional.
        reference (n): desired positions [rad]; optional.
        command (n): what the stages make of all of it; optional.
    Outputs, from the state only:
        flags (F): 1 up, 0 down, never NaN, in the order of `flag_names`:
            encoder/missing, /frozen, /jump; imu/missing, /frozen, /jump, /inconsistent; for each F/T sensor
            NAME/missing, /frozen, /jump, /unexpected; unknown_wrench/unexpected; torque/inconsistent;
            reference/out_of_range; command/not_finite.
        any_fault (1): 0 while no flag is up, 1 where one is, 2 where one of the encoders is: as CommandGuard takes it.

    Every dt, per channel (s last finite reading, c ticks for which it has not changed, m ticks without one), with the
    thresholds of `MonitorSpec`:

        missing     u[n] is not finite, or beyond `LARGEST`
        c[n+1]    = c[n] + 1 where u[n] = s[n], else 0;                 frozen: c[n+1] >= max(time/dt, repeats)
        jump        |u[n] - s[n]| > (m[n] + 1) largest step. A wrench that jumped stays wrong while the sum of its jumps
                    exceeds the largest step; encoders: `drake_tc.kernels.fault_monitor.encoder_jumps`
        e[n+1]    = e[n] + (1 - exp(-dt/T)) (x[n] - e[n])               |e[n+1]| > threshold: inconsistent, unexpected
        h[n+1]    = hold/dt where a cause is there, else max(h[n] - 1, 0);   flag y[n] = h[n] > 0

    x are the IMU of a welded base against gravity and zero rate (where no joint lies between them), the unknown
    wrench, the contact wrench of the free sensors, the torque residual, and the reference against the middle of the
    joints' ranges, half of which is the threshold; what is not finite is left out. A flag is up from the tick after its
    cause. Before the first finite reading the sensor is missing.

    Example:
        >>> monitor = FaultMonitor(load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml"))
        >>> monitor.flag_names[0]
        'encoder/missing'
    """

    def __init__(
        self, robot: Robot, spec: MonitorSpec | None = None, dt: float = 1e-3, free: tuple[str, ...] = ()
    ) -> None:
        """Declare ports and state.

        Args:
            robot: Its sensors, velocity and effort limits.
            spec: Thresholds; None: the defaults.
            dt: Period of the update [s].
            free: F/T sensors beyond which nothing should touch the robot.

        Raises:
            ParamsError: A period that is not positive, a free sensor that the robot does not have.
        """
        super().__init__()
        spec = MonitorSpec() if spec is None else spec
        if not (np.isfinite(dt) and dt > 0.0):
            raise ParamsError(f"FaultMonitor: dt: expected a positive period [s], got {dt!r}")
        sensors = tuple(mount.name for mount in robot.force_torque)
        for name in free:
            if name not in sensors:
                raise ParamsError(f"FaultMonitor: free: no F/T sensor {name!r}; there are {list(sensors)}")
        n, k, has_imu = len(robot.joints), len(sensors), bool(robot.imu)
        self._dt, self._has_imu = float(dt), has_imu
        self._flag_names = _flag_names(sensors, has_imu=has_imu)
        limits = joint_limits(robot)
        groups = ["encoder", *sensors, "command", *(["imu"] * has_imu)]

        speed = np.where(np.isfinite(limits.velocity), limits.velocity, FASTEST)
        wrench_jump = [spec.force_jump] * 3 + [spec.moment_jump] * 3
        inertial_jump = [spec.gyro_jump] * 3 + [spec.accel_jump] * 3
        commands = [np.inf] * n
        step = np.concatenate(
            [2.0 * speed * dt + spec.encoder_jump, wrench_jump * k, commands, inertial_jump * has_imu]
        )
        times = [[spec.encoder_frozen] * n, [spec.wrench_frozen] * 6 * k, commands, [spec.imu_frozen] * 6 * has_imu]
        repeats = np.repeat([ENCODER_REPEATS, REPEATS], [n, step.size - n])
        frozen = np.clip(np.concatenate(times) / dt, repeats, _NEVER) - 0.5
        firsts = np.repeat(
            [self._flag("not_finite" if group == "command" else "missing", group) for group in groups],
            [n if group in ("encoder", "command") else 6 for group in groups],
        )

        still, watched = _still_imu(robot)
        unexpected = np.array([spec.unexpected_force] * 3 + [spec.unexpected_moment] * 3)
        effort = np.where(np.isfinite(limits.effort), limits.effort, STRONGEST)
        imu_limit = [spec.still_gyro] * 3 + [spec.still_accel] * 3 if watched else [np.inf] * 6
        contact_limit = [unexpected if name in free else np.full(6, np.inf) for name in sensors]
        self._middle, half = _middles(limits)
        limit = np.concatenate([imu_limit, unexpected, *contact_limit, spec.torque * effort, half])
        expected = np.concatenate([still, np.zeros(limit.size - 6 - n), self._middle])
        odd = [self._flag("inconsistent", "imu")] if has_imu else [0]
        odd += [self._flag("unexpected", name) for name in ("unknown_wrench", *sensors)]
        odd += [self._flag("inconsistent", "torque"), self._flag("out_of_range", "reference")]
        odd_flags = np.repeat(odd, [*[6] * (2 + k), n, n])
        filtered = slice(0 if has_imu else 6, None)

        largest_change, stuck = spec.encoder_acceleration * dt**2, min(spec.encoder_stuck / dt, _NEVER) - 0.5
        blend, hold = -np.expm1(-dt / spec.time_constant), np.ceil(spec.hold / dt)
        self._settings = (
            np.column_stack((step, frozen)),
            firsts,
            np.column_stack((expected, limit))[filtered],
            odd_flags[filtered],
            n + 6 * k if spec.wrench_jump_lasts else n,
            np.array(
                [spec.moving, stuck, largest_change, spec.encoder_jump, blend, hold, LARGEST, spec.encoder_timing / dt]
            ),
        )
        self._declare_ports(n, k)

    def _flag(self, kind: str, name: str) -> int:
        """Its place among the flags."""
        return self._flag_names.index(f"{name}/{kind}")

    def _declare_ports(self, n: int, k: int) -> None:
        """Ports, state and event."""
        raw = [("position", n), *([("wrench", 6 * k)] if k else []), ("command", n)]
        raw += [("imu", 6)] if self._has_imu else []
        derived = [("unknown_wrench", 6), *([("contact_wrench", 6 * k)] if k else []), ("torque_residual", n)]
        derived += [("reference", n)]
        # absent optional inputs read as what is expected of them
        optional = dict([("command", n), *derived])
        self._absent = {name: np.zeros(size) for name, size in optional.items()} | {"reference": self._middle}
        self._still, self._seen = np.zeros(n), tuple(name for name, _ in (*raw, *derived))

        count = len(self._flag_names)
        size = sum(size for _, size in raw)
        never, encoders = np.full(size, np.nan), np.repeat([np.nan, 0.0, np.nan, np.nan], n)
        rest = np.zeros(size + sum(size for _, size in derived) + 6 * self._has_imu + count)
        start: Any = np.concatenate([never, np.zeros(2 * size), encoders, rest])
        self._start: FloatArray = start
        self._declare({**dict(raw), "reference_velocity": n, **dict(derived)})

    @property
    def flag_names(self) -> tuple[str, ...]:
        """Names of the flags, in the order of the port."""
        return self._flag_names

    def coordinates(self, context: Context) -> FloatArray:
        """(0,): counters and filters that act on nothing before a flag goes up (`drake_tc.analysis`)."""
        return np.zeros(0)

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Nothing to set."""

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports; the state is [memory; flags; level]."""
        start, count = self._start, len(self._flag_names)

        def bind(arrays: Arrays) -> tuple[Call, Sequence[Call]]:
            given = arrays.inputs
            memory, flags, level = np.split(arrays.after, [start.size, start.size + count])
            absent = self._absent.keys() - given.keys()
            seen = [self._absent[name] if name in absent else given[name] for name in self._seen]
            rate = given.get("reference_velocity", self._still)
            ends = np.cumsum([0, *(part.size for part in seen)]).tolist()
            now = np.empty(ends[-1])
            arguments = (now, rate, *self._settings, memory, flags)

            def update(time: float) -> None:
                level[0] = _RAISE_FLAGS((now, rate), self._settings, memory, flags)

            joined = [copying(part, now[a:b]) for part, a, b in zip(seen, ends, ends[1:], strict=False)]
            shown = copying(arrays.before[start.size :], arrays.out)
            return shown, (*joined, KernelCall(RAISE_FLAGS, update, *arguments, level))

        names = {*self._seen, "reference_velocity"}
        parts = places({"flags": slice(count), "any_fault": slice(count, count + 1)})
        state = np.append(start, np.zeros(count + 1))
        return ArrayStage(count + 1, parts, bind, updates=frozenset(names), start=state, period=self._dt)


def _flag_names(sensors: tuple[str, ...], *, has_imu: bool) -> tuple[str, ...]:
    kinds = ("missing", "frozen", "jump")
    names = [f"encoder/{kind}" for kind in kinds]
    if has_imu:
        names += [f"imu/{kind}" for kind in (*kinds, "inconsistent")]
    for sensor in sensors:
        names += [f"{sensor}/{kind}" for kind in (*kinds, "unexpected")]
    return (*names, "unknown_wrench/unexpected", "torque/inconsistent", "reference/out_of_range", "command/not_finite")


def _middles(limits: Limits) -> tuple[FloatArray, FloatArray]:
    """(middle, half) of the joints' ranges (n,) [rad], a little wider than they are; infinite halves without one."""
    bounded = np.isfinite(limits.lower) & np.isfinite(limits.upper)
    lower, upper = (np.where(bounded, ends, 0.0) for ends in (limits.lower, limits.upper))
    return 0.5 * (lower + upper), np.where(bounded, 0.5 * (upper - lower) + RANGE_SLACK, np.inf)


def _still_imu(robot: Robot) -> tuple[FloatArray, bool]:
    """What the first IMU reads while the base stands still (6,), and whether it must: welded to a welded base."""
    if not (robot.imu and robot.fixed_base):
        return np.zeros(6), False
    model = build_plant(robot)
    motion = BaseMotion(model, model.plant.GetFrameByName(robot.imu[0].name + IMU_SUFFIX))
    if not motion.rigid:
        return np.zeros(6), False
    up = robot.base_pose.transform.rotation().matrix()[2]
    return np.concatenate([np.zeros(3), GRAVITY * (motion.rotation.T @ up)]), True
