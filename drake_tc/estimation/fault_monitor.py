"""`FaultMonitor`: which sensors are missing, frozen, jumping or at odds with what is known."""

from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drake_tc.errors import ParamsError
from drake_tc.estimation.base_motion import BaseMotion
from drake_tc.estimation.joint_torque import LARGEST
from drake_tc.estimation.monitor_spec import MonitorSpec
from drake_tc.estimation.plant import IMU_SUFFIX, build_plant
from drake_tc.estimation.torque_model import GRAVITY
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.types import BoolArray, FloatArray

FASTEST = 20.0
"""Speed of a joint without a velocity limit [rad/s]."""
STRONGEST = 100.0
"""Effort of a joint without an effort limit [N m]."""
_NEVER = 1e12


class FaultMonitor(LeafSystem):  # type: ignore[misc, unused-ignore]
    """Flags of sensor faults; n joints, k F/T sensors, N = n + 6 + 6k raw channels u.

    Inputs:
        encoder (n): raw positions [rad].
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
        any_fault (1): the largest flag.

    Every dt, per channel (s last finite reading, c ticks for which it has not changed, m ticks without one), with the
    thresholds of `MonitorSpec`:

        missing     u[n] is not finite, or beyond `LARGEST`
        c[n+1]    = c[n] + 1 where u[n] = s[n], else 0;                 frozen: c[n+1] dt >= its time
        jump        |u[n] - s[n]| > (m[n] + 1) largest step
        e[n+1]    = e[n] + (1 - exp(-dt/T)) (x[n] - e[n])               |e[n+1]| > threshold: inconsistent, unexpected
        h[n+1]    = hold/dt where a cause is there, else max(h[n] - 1, 0);   flag y[n] = h[n] > 0

    x are the IMU of a welded base against gravity and zero rate (where no joint lies between them), the unknown
    wrench, the contact wrench of the free sensors, and the torque residual; what is not finite is left out. A flag is
    up from the tick after its cause. Before the first finite reading the sensor is missing.
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
            raise ParamsError(f"FaultMonitor: dt: wanted a positive period [s]; got {dt!r}")
        sensors = tuple(mount.name for mount in robot.force_torque)
        for name in free:
            if name not in sensors:
                raise ParamsError(f"FaultMonitor: free: no F/T sensor {name!r}; there are {list(sensors)}")
        n, k, has_imu = len(robot.joints), len(sensors), bool(robot.imu)
        limits = joint_limits(robot)
        self._hold = float(np.ceil(spec.hold / dt))
        self._blend = -np.expm1(-dt / spec.time_constant)

        # raw channels: [encoder; imu; wrench]
        sizes = [n, 6 if has_imu else 0, *([6] * k)]
        edges = np.cumsum([0, *sizes]).tolist()
        self._groups = tuple(slice(a, b) for a, b in pairwise(edges) if b > a)
        speed = np.where(np.isfinite(limits.velocity), limits.velocity, FASTEST)
        wrench_jump = [spec.force_jump] * 3 + [spec.moment_jump] * 3
        steps = [2.0 * speed * dt + spec.encoder_jump, *([[spec.gyro_jump] * 3 + [spec.accel_jump] * 3] * has_imu)]
        self._largest_step = np.concatenate([*steps, *([wrench_jump] * k)])
        times = [[spec.encoder_frozen] * n, [spec.imu_frozen] * 6 * has_imu, [spec.wrench_frozen] * 6 * k]
        self._frozen_ticks = np.minimum(np.concatenate(times) / dt, _NEVER) - 0.5
        self._stuck_ticks = min(spec.encoder_stuck / dt, _NEVER) - 0.5
        self._moving = spec.moving
        raw = edges[-1]

        # filtered channels: [imu; unknown wrench; contact wrench; torque residual]
        still, watched = _still_imu(robot)
        unexpected = np.array([spec.unexpected_force] * 3 + [spec.unexpected_moment] * 3)
        effort = np.where(np.isfinite(limits.effort), limits.effort, STRONGEST)
        imu_limit = [spec.still_gyro] * 3 + [spec.still_accel] * 3 if watched else [np.inf] * 6
        contact_limit = [unexpected if name in free else np.full(6, np.inf) for name in sensors]
        self._limits = np.concatenate([imu_limit, unexpected, *contact_limit, spec.torque * effort])
        self._still = still
        ends = np.cumsum([0, 6, 6, *([6] * k), n]).tolist()
        self._checks = tuple(slice(a, b) for a, b in pairwise(ends))

        self._flag_names = _flag_names(sensors, has_imu=has_imu)
        count = len(self._flag_names)
        self._raw_ports = [self.DeclareVectorInputPort("encoder", n)]
        if has_imu:
            self._raw_ports.append(self.DeclareVectorInputPort("imu", 6))
        if k:
            self._raw_ports.append(self.DeclareVectorInputPort("wrench", 6 * k))
        self._has_imu, self._n = has_imu, n
        self._reference: Any = self.DeclareVectorInputPort("reference_velocity", n)
        self._derived: list[Any] = [self.DeclareVectorInputPort("unknown_wrench", 6)]
        if k:
            self._derived.append(self.DeclareVectorInputPort("contact_wrench", 6 * k))
        self._derived.append(self.DeclareVectorInputPort("torque_residual", n))
        # absent optional inputs read as zero: nothing is at odds with them
        self._zeros = tuple(np.zeros(port.size()) for port in self._derived)

        self._starts = np.array([group.start for group in self._groups], dtype=np.intp)
        ends = np.cumsum([0, raw, raw, raw, self._limits.size, count]).tolist()
        self._parts = tuple(slice(a, b) for a, b in pairwise(ends))
        start: Any = np.zeros(ends[-1])
        start[self._parts[0]] = np.nan
        self._memory: Any = self.DeclareDiscreteState(start)
        on_memory = {self.discrete_state_ticket(self._memory)}
        self.DeclareVectorOutputPort("flags", count, self._calc_flags, prerequisites_of_calc=on_memory)
        self.DeclareVectorOutputPort("any_fault", 1, self._calc_any, prerequisites_of_calc=on_memory)
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    @property
    def flag_names(self) -> tuple[str, ...]:
        """Names of the flags, in the order of the port."""
        return self._flag_names

    def _calc_flags(self, context: Context, output: BasicVector) -> None:
        flags: Any = np.where(_value(context, self._memory)[self._parts[4]] > 0.0, 1.0, 0.0)
        output.SetFromVector(flags)

    def _calc_any(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, float(_value(context, self._memory)[self._parts[4]].any()))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        """The recursion; the last lines are cheap where nothing is wrong, which is nearly always."""
        memory = _value(context, self._memory).copy()
        last, same, gap, error, left = (memory[part] for part in self._parts)
        u = np.concatenate([port.Eval(context) for port in self._raw_ports])
        finite = np.abs(u) < LARGEST  # also False where u is NaN
        same += 1.0
        same *= u == last
        bad = np.empty((3, u.size), dtype=np.bool_)
        np.logical_not(finite, out=bad[0])
        np.greater_equal(same, self._frozen_ticks, out=bad[1])
        bad[2] = (np.abs(u - last) > (gap + 1.0) * self._largest_step) & finite
        if self._reference.HasValue(context):
            moving = np.abs(self._reference.Eval(context)) > self._moving
            bad[1, : self._n] |= moving & (same[: self._n] >= self._stuck_ticks)
        self._filter(context, u, error)
        odd = np.abs(error) > self._limits
        gap += 1.0
        gap[finite] = 0.0
        last[finite] = u[finite]
        np.maximum(left - 1.0, 0.0, out=left)
        if bad.any() or odd.any():
            left[self._causes(bad, odd)] = self._hold
        new: Any = values
        new.set_value(self._memory, memory)

    def _filter(self, context: Context, u: FloatArray, error: FloatArray) -> None:
        """e[n+1], in place."""
        n = self._n
        imu = u[n : n + 6] - self._still if self._has_imu else self._still
        derived = [
            port.Eval(context) if port.HasValue(context) else zeros
            for port, zeros in zip(self._derived, self._zeros, strict=True)
        ]
        x = np.concatenate([imu, *derived])
        good = np.abs(x) < LARGEST
        error[good] += self._blend * (x[good] - error[good])

    def _causes(self, bad: BoolArray, odd: BoolArray) -> BoolArray:
        """One truth a flag, in the order of `flag_names`."""
        imu, unknown, *contacts, torque = (bool(odd[check].any()) for check in self._checks)
        own = [[], *([[imu]] if self._has_imu else []), *([contact] for contact in contacts)]
        causes: list[bool] = []
        for group, extra in zip(np.logical_or.reduceat(bad, self._starts, axis=1).T, own, strict=True):
            causes += [*group.tolist(), *extra]
        return np.array([*causes, unknown, torque])


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


def _value(context: Any, index: Any) -> FloatArray:
    return np.asarray(context.get_discrete_state(index).value(), dtype=np.float64)
