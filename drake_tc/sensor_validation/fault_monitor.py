"""`FaultMonitor`: which sensors are missing, frozen, jumping or at odds with what is known."""

from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_tc.errors import ParamsError
from drake_tc.estimation.base_motion import BaseMotion
from drake_tc.estimation.joint_torque import LARGEST
from drake_tc.estimation.plant import IMU_SUFFIX, build_plant
from drake_tc.estimation.torque_model import GRAVITY
from drake_tc.port_methods import PortMethods
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.sensor_validation.encoder_jumps import EncoderJumps
from drake_tc.sensor_validation.monitor_spec import MonitorSpec
from drake_tc.types import BoolArray, FloatArray

FASTEST = 20.0
"""Speed of a joint without a velocity limit [rad/s]."""
STRONGEST = 100.0
"""Effort of a joint without an effort limit [N m]."""
ENCODER_FLAGS = 3
"""The first flags are the encoders'."""
ENCODER_REPEATS = 20
"""No fewer identical readings of an encoder count as frozen, however long the tick."""
REPEATS = 6
"""The same of an IMU or F/T channel, whose noise is ten times its resolution."""
_NEVER = 1e12


class FaultMonitor(PortMethods, LeafSystem):
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
    Outputs, from the state only:
        flags (F): 1 up, 0 down, never NaN, in the order of `flag_names`:
            encoder/missing, /frozen, /jump; imu/missing, /frozen, /jump, /inconsistent; for each F/T sensor
            NAME/missing, /frozen, /jump, /unexpected; unknown_wrench/unexpected; torque/inconsistent.
        any_fault (1): 0 while no flag is up, 1 where one is, 2 where one of the encoders is: as CommandGuard takes it.

    Every dt, per channel (s last finite reading, c ticks for which it has not changed, m ticks without one), with the
    thresholds of `MonitorSpec`:

        missing     u[n] is not finite, or beyond `LARGEST`
        c[n+1]    = c[n] + 1 where u[n] = s[n], else 0;                 frozen: c[n+1] >= max(time/dt, repeats)
        jump        |u[n] - s[n]| > (m[n] + 1) largest step. A wrench that jumped stays wrong while the sum of its jumps
                    exceeds the largest step; encoders: `EncoderJumps`, over max(m[n], c[n]) + 1 ticks
        e[n+1]    = e[n] + (1 - exp(-dt/T)) (x[n] - e[n])               |e[n+1]| > threshold: inconsistent, unexpected
        h[n+1]    = hold/dt where a cause is there, else max(h[n] - 1, 0);   flag y[n] = h[n] > 0

    x are the IMU of a welded base against gravity and zero rate (where no joint lies between them), the unknown
    wrench, the contact wrench of the free sensors, and the torque residual; what is not finite is left out. A flag is
    up from the tick after its cause. Before the first finite reading the sensor is missing.

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
        limits = joint_limits(robot)
        self._dt = float(dt)
        self._hold = float(np.ceil(spec.hold / dt))
        self._blend = -np.expm1(-dt / spec.time_constant)

        # raw channels: [encoder; wrench; imu]
        sizes = [n, *([6] * k), *([6] * has_imu)]
        raw = sum(sizes)
        self._starts = np.cumsum([0, *sizes[:-1]])
        speed = np.where(np.isfinite(limits.velocity), limits.velocity, FASTEST)
        wrench_jump = [spec.force_jump] * 3 + [spec.moment_jump] * 3
        inertial_jump = [spec.gyro_jump] * 3 + [spec.accel_jump] * 3
        self._largest_step = np.concatenate(
            [2.0 * speed * dt + spec.encoder_jump, wrench_jump * k, inertial_jump * has_imu]
        )
        largest_change = spec.encoder_acceleration * dt**2
        self._encoder_jumps = EncoderJumps(self._largest_step[:n], largest_change, spec.encoder_jump)
        times = [[spec.encoder_frozen] * n, [spec.wrench_frozen] * 6 * k, [spec.imu_frozen] * 6 * has_imu]
        repeats = np.repeat([ENCODER_REPEATS, REPEATS], [n, raw - n])
        self._frozen_ticks = np.clip(np.concatenate(times) / dt, repeats, _NEVER) - 0.5
        self._stuck_ticks = min(spec.encoder_stuck / dt, _NEVER) - 0.5
        self._moving = spec.moving

        # filtered channels: [imu; unknown wrench; contact wrench; torque residual]
        still, watched = _still_imu(robot)
        unexpected = np.array([spec.unexpected_force] * 3 + [spec.unexpected_moment] * 3)
        effort = np.where(np.isfinite(limits.effort), limits.effort, STRONGEST)
        imu_limit = [spec.still_gyro] * 3 + [spec.still_accel] * 3 if watched else [np.inf] * 6
        contact_limit = [unexpected if name in free else np.full(6, np.inf) for name in sensors]
        skip = 0 if has_imu else 6
        self._limits = np.concatenate([imu_limit, unexpected, *contact_limit, spec.torque * effort])[skip:]
        self._expected = np.concatenate([still, np.zeros(6 + 6 * k + n)])[skip:]
        ends = np.cumsum([0, *([6] * has_imu), 6, *([6] * k), n]).tolist()
        self._checks = tuple(slice(a, b) for a, b in pairwise(ends))

        self._flag_names = _flag_names(sensors, has_imu=has_imu)
        self._raw, self._has_imu, self._n = raw, has_imu, n
        self._wrench, self._wrench_lasts = slice(n, n + 6 * k), spec.wrench_jump_lasts
        self._filtered = slice(raw - 6 if has_imu else raw, None)
        self._within = self._bounds()
        self._declare(n, k)

    def _bounds(self) -> FloatArray:
        """What |[u, all filtered inputs; u - s; c; e; x]| stays below while nothing is wrong."""
        ticks = self._frozen_ticks.copy()
        ticks[: self._n] = np.minimum(ticks[: self._n], self._stuck_ticks)
        seen = np.full(self._raw + self._limits.size - (6 if self._has_imu else 0), LARGEST)
        return np.concatenate([seen, self._largest_step, ticks, self._limits, self._encoder_jumps.wrong])

    def _declare(self, n: int, k: int) -> None:
        """Ports, state and event."""
        raw = [("position", n), *([("wrench", 6 * k)] if k else []), *([("imu", 6)] if self._has_imu else [])]
        derived = [("unknown_wrench", 6), *([("contact_wrench", 6 * k)] if k else []), ("torque_residual", n)]
        ports: dict[str, Any] = {name: self.DeclareVectorInputPort(name, size) for name, size in raw}
        self._reference: Any = self.DeclareVectorInputPort("reference_velocity", n)
        ports |= {name: self.DeclareVectorInputPort(name, size) for name, size in derived}
        self._raw_ports = tuple(ports[name] for name, _ in raw)
        # absent optional inputs read as zero: nothing is at odds with them
        self._derived = tuple((ports[name], np.zeros(size)) for name, size in derived)

        count = len(self._flag_names)
        raw_size = self._raw
        ends = np.cumsum([0, raw_size, raw_size, self._limits.size, n, raw_size, count, n, 6 * k, 2 * n, 1]).tolist()
        self._parts = tuple(slice(a, b) for a, b in pairwise(ends))
        self._usual = slice(0, ends[4])
        start: Any = np.zeros(ends[-1])
        start[self._parts[0]] = start[self._parts[3]] = start[self._parts[8]] = np.nan
        self._memory = int(self.DeclareDiscreteState(start))
        flags, largest = self.DeclareDiscreteState(count), self.DeclareDiscreteState(1)
        self._flags, self._largest = int(flags), int(largest)
        self.DeclareStateOutputPort("flags", flags)
        self.DeclareStateOutputPort("any_fault", largest)
        self.DeclarePeriodicDiscreteUpdateEvent(self._dt, 0.0, self._update)

    @property
    def flag_names(self) -> tuple[str, ...]:
        """Names of the flags, in the order of the port."""
        return self._flag_names

    def coordinates(self, context: Context) -> FloatArray:
        """(0,): counters and filters that act on nothing before a flag goes up (`drake_tc.analysis`)."""
        return np.zeros(0)

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Nothing to set."""

    def _update(self, context: Context, values: DiscreteValues) -> None:
        """The recursion: a short way where nothing is or was wrong, which is nearly always."""
        seen = [port.Eval(context) for port in self._raw_ports]
        seen += [port.Eval(context) if port.HasValue(context) else zeros for port, zeros in self._derived]
        now = np.concatenate(seen)
        memory: Any = values.get_mutable_value(self._memory)
        if not self._all_is_well(memory, now):
            self._examine(context, values, now)

    def _all_is_well(self, memory: FloatArray, now: FloatArray) -> bool:
        """The whole recursion where no flag is up, no reading missing and nothing out of bounds; else nothing."""
        if memory[-1] != 0.0:
            return False
        n, raw, usual = self._n, self._raw, memory[self._usual]
        u = now[:raw]
        step = u - usual[:raw]
        after = np.empty_like(usual)
        after[:raw] = u
        ticks, same = usual[raw : 2 * raw] + 1.0, step == 0.0
        np.multiply(ticks, same, out=after[raw : 2 * raw])
        error, speed_now = usual[2 * raw : -n], usual[-n:]
        after[2 * raw : -n] = error + self._blend * (now[self._filtered] - self._expected - error)
        displacement, late = step[:n], same[:n]
        change = np.where(late, 0.0, displacement - speed_now * ticks[:n])
        after[-n:] = np.where(late, speed_now, displacement / ticks[:n])
        watched = np.abs(np.concatenate((now, step, after[raw:-n], change)))
        if np.count_nonzero(watched < self._within) < watched.size:  # also where one is NaN
            return False
        memory[self._usual] = after
        return True

    def _examine(self, context: Any, values: Any, now: FloatArray) -> None:
        """The recursion, channel by channel."""
        memory = values.get_mutable_value(self._memory)
        last, same, error, speed_now, gap, left, offset, moved, doubt, busy = (memory[part] for part in self._parts)
        u, x = now[: self._raw], now[self._filtered] - self._expected
        with np.errstate(invalid="ignore"):  # readings may be infinite
            finite = np.abs(u) < LARGEST  # also False where u is NaN
            step = u - last
            jump = (np.abs(step) > (gap + 1.0) * self._largest_step) & finite
            good = np.abs(x) < LARGEST
        n = self._n
        new = finite[:n] & np.isfinite(step[:n]) & (step[:n] != 0.0)
        ticks = np.maximum(gap[:n], same[:n]) + 1.0
        jump[:n] = self._encoder_jumps.find(step[:n], ticks, new, speed_now, offset, doubt.reshape(2, n))
        jump[self._wrench] = self._wrench_jumps(step[self._wrench], jump[self._wrench], moved)
        same[:] = np.where(u == last, same + 1.0, 0.0)
        frozen = same >= self._frozen_ticks
        if self._reference.HasValue(context):
            moving = np.abs(self._reference.Eval(context)) > self._moving
            frozen[: self._n] |= moving & (same[: self._n] >= self._stuck_ticks)
        error[good] += self._blend * (x[good] - error[good])
        gap[:] = np.where(finite, 0.0, gap + 1.0)
        last[finite] = u[finite]
        left[:] = np.maximum(left - 1.0, 0.0)
        left[self._causes(np.stack([~finite, frozen, jump]), np.abs(error) > self._limits)] = self._hold
        raised = (left > 0.0).astype(np.float64)
        worst = 2.0 * raised[:ENCODER_FLAGS].max()
        busy[:] = float(raised.any() or gap.any() or np.isfinite(doubt).any())
        values.set_value(self._flags, raised)
        values.set_value(self._largest, np.array([max(worst, raised.max())]))

    def _wrench_jumps(self, step: FloatArray, jump: BoolArray, moved: FloatArray) -> BoolArray:
        """(6k,) which channels of the wrenches jump now, or have jumped and did not jump back; `moved` is updated."""
        if not self._wrench_lasts:
            return jump
        moved[jump] += step[jump]
        stays: BoolArray = jump | (np.abs(moved) > self._largest_step[self._wrench])
        return stays

    def _causes(self, bad: BoolArray, odd: BoolArray) -> BoolArray:
        """One truth a flag, in the order of `flag_names`."""
        found = [[bool(odd[check].any())] for check in self._checks]
        imu, (unknown, *contacts, torque) = (found[:1], found[1:]) if self._has_imu else ([], found)
        encoder, *rest = np.logical_or.reduceat(bad, self._starts, axis=1).T.tolist()
        wrenches, inertial = rest[: len(contacts)], rest[len(contacts) :]
        groups = [encoder, *(raw + own for raw, own in zip(inertial + wrenches, imu + contacts, strict=True))]
        return np.array([*(cause for group in groups for cause in group), *unknown, *torque])


def _flag_names(sensors: tuple[str, ...], *, has_imu: bool) -> tuple[str, ...]:
    kinds = ("missing", "frozen", "jump")
    names = [f"encoder/{kind}" for kind in kinds]
    if has_imu:
        names += [f"imu/{kind}" for kind in (*kinds, "inconsistent")]
    for sensor in sensors:
        names += [f"{sensor}/{kind}" for kind in (*kinds, "unexpected")]
    return (*names, "unknown_wrench/unexpected", "torque/inconsistent")


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
