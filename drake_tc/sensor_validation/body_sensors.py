"""`ValidatedImu`, `ValidatedWrench`: checked readings for the base estimator, and substitutes for failed ones."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, ValueProducer

from drake_tc.port_methods import PortMethods
from drake_tc.types import BoolArray, FloatArray

LARGEST = 1e5
"""No reading in SI units is as large."""
SETTLED = 0.1
"""Before, soles take their load, which no sensor is blamed for [s]."""
LOAD_JUMP, LOADS_AGREE = 50.0, 0.15
"""A force that changes by so much in a tick [N] is believed once all sensors together carry what they carried before,
to this share: a load goes over from one foot to another, or comes with an impact that is soon over."""
_MEAN, _LEAST, _SOON = 0.05, 0.1, 0.02
"""Time over which an IMU is averaged, the least for which one that jumped and stayed is left out, and within which it
has jumped back, or the jolt that made it jump is felt in the feet [s]."""

_SINCE = 24


def _finite(reading: FloatArray) -> bool:
    """Whether all of it is, and below `LARGEST`."""
    return bool(np.count_nonzero(np.abs(reading) < LARGEST) == reading.size)


class _Solved:
    """This tick's reading; a box for the cache.

    Attributes:
        reading: What can be believed.
        finite: Whether u is.
        jumps: Whether u jumps, and no jolt says why.
    """

    reading: FloatArray
    finite: bool
    jumps: bool


class ValidatedImu(PortMethods, LeafSystem):
    """An IMU that may be left out: NaN then, on which the base estimator goes by the contacts alone.

    Inputs: imu (6) raw [gyro; accel]; flagged (m): any that is up leaves it out; jolt (j): any that is up says that the
        robot was hit, or a foot landed, so that a jump of the IMU is true.
    Outputs: reading (6), u or NaN, with feedthrough; left_out (1), of the state: 1 after a jump.
    State: u of the last tick, its mean m, the mean mu and the reading u0 before a jump (6 each), ticks since the jump
        (0: none); whether there was one.

        m[n+1] = m[n] + (1 - exp(-dt/T)) (u[n] - m[n]),   T = 50 ms
        a jump: |u[n] - u[n-1]| > limit in one axis; mu = m[n], and it is left out from that tick on, until 0.1 s are
        over and |m - mu| < limit/2 in all axes: until it has jumped back, or the motion has. Within `_SOON`,
        |u - u0| < limit in all axes is enough: a bad sample, or a hit, that is over.

    What is not finite is left out at once and not remembered. Nothing counts as a jump before `SETTLED`, nor in a jolt;
    one that a jolt follows within `_SOON` is taken back.
    """

    def __init__(self, limit: FloatArray, flags: int, jolts: int, dt: float) -> None:
        """Declare ports, state and the periodic update.

        Args:
            limit: (6,) of a step in one tick [rad/s, m/s^2].
            flags: m.
            jolts: j.
            dt: Period [s].
        """
        super().__init__()
        self._limit, self._blend = np.array(limit, dtype=float), -np.expm1(-dt / _MEAN)
        self._least, self._soon = round(_LEAST / dt), round(_SOON / dt)
        self._imu: Any = self.DeclareVectorInputPort("imu", 6)
        self._flagged: Any = self.DeclareVectorInputPort("flagged", flags)
        self._jolt: Any = self.DeclareVectorInputPort("jolt", jolts)
        start: Any = np.append(np.full(_SINCE, np.nan), 0.0)
        state = self.DeclareDiscreteState(start)
        left_out = self.DeclareDiscreteState(1)
        self._state, self._left_out, self._none = int(state), int(left_out), np.full(6, np.nan)
        inputs = {self._flagged.ticket(), self._imu.ticket(), self._jolt.ticket()}
        tickets = {self.discrete_state_ticket(state), self.time_ticket(), *inputs}
        self._solved: Any = self.DeclareCacheEntry(
            "solved", ValueProducer(allocate=Value(_Solved()).Clone, calc=self._solve), tickets
        )
        self.DeclareVectorOutputPort("reading", 6, self._write, {self._solved.ticket()})
        self.DeclareStateOutputPort("left_out", left_out)
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _solve(self, context: Any, box: Any) -> None:
        """This tick's reading."""
        u, held = self._imu.Eval(context), context.get_discrete_state(self._state).value()
        solved = box.get_mutable_value()
        solved.finite = _finite(u)
        beyond = context.get_time() >= SETTLED and np.count_nonzero(np.abs(u - held[:6]) > self._limit) > 0
        solved.jumps = beyond and not self._jolt.Eval(context).any()
        good = solved.finite and not (held[_SINCE] or solved.jumps or np.count_nonzero(self._flagged.Eval(context)))
        solved.reading = u if good else self._none

    def _write(self, context: Context, vector: Any) -> None:
        solved: Any = self._solved.Eval(context)
        vector.set_value(solved.reading)

    def _update(self, context: Context, values: DiscreteValues) -> None:
        solved: Any = self._solved.Eval(context)
        held: Any = values.get_mutable_value(self._state)
        if not solved.finite:
            held[_SINCE] += held[_SINCE] > 0.0
            return
        u, since = self._imu.Eval(context), held[_SINCE]
        mean, before, kept = held[6:12], held[12:18], held[18:_SINCE]
        if not since and solved.jumps:
            before[:], kept[:], since = mean, held[:6], 1.0
        # the first mean is the first reading
        mean[:] = u if mean[0] != mean[0] else mean + self._blend * (u - mean)
        if held[_SINCE]:
            over = self._jolt.Eval(context).any() or bool((np.abs(u - kept) < self._limit).all())
            true = since <= self._soon and over
            back = since >= self._least and bool((np.abs(mean - before) < 0.5 * self._limit).all())
            since = 0.0 if true or back else since + 1.0
        if since != held[_SINCE]:
            held[_SINCE] = since
            values.get_mutable_vector(self._left_out).SetAtIndex(0, float(since > 0.0))
        held[:6] = u


class _Good:
    """A box for the cache.

    Attributes:
        sensors: (k,) which can be believed; None: all.
        doubted: (k,) which jumped, and no load says why; None: none.
        total: Sum of the forces' sizes [N]; NaN where a sensor is left out.
    """

    sensors: BoolArray | None
    doubted: BoolArray | None
    total: float


class ValidatedWrench(PortMethods, LeafSystem):
    """k F/T sensors, each of which may be left out: its last good reading stands in, and its contact is kept.

    Inputs:
        wrench (6k): raw [f; t].
        flagged (mk): m flags of each sensor; any that is up leaves it out.
        contacts (c): 1 where the controller stands on a contact, 0 where it does without; all, when not connected.
    Outputs, with feedthrough:
        reading (6k): always finite.
        contacts (c): the input, with 2 for 1 where the contact's sensor is left out: it carries, whatever that says; 1,
            by its load, where the input is not finite.
    State: the last good reading (6k), 0 before any; the raw one (6k); the mean of the total load; (k,) which are
        doubted. A sensor with one axis that is not finite is left out as a whole. One whose force jumps,

        |f[n] - f[n-1]| > `LOAD_JUMP`,

        is left out from that tick on, until the loads agree: | sum |f| - mean | < `LOADS_AGREE` mean, with the mean of
        50 ms before the jump. An offset of 150 N on one foot never does. Nothing counts as a jump before `SETTLED`.
    """

    def __init__(self, sensors: int, flags: int, sensor_of: tuple[int, ...], dt: float) -> None:
        """Declare ports, state and the periodic update.

        Args:
            sensors: k.
            flags: m.
            sensor_of: Of each of the c contacts, which sensor has its load.
            dt: Period [s].
        """
        super().__init__()
        self._k, self._sensor_of = sensors, np.array(sensor_of, dtype=int)
        self._wrench: Any = self.DeclareVectorInputPort("wrench", 6 * sensors)
        self._flagged: Any = self.DeclareVectorInputPort("flagged", flags * sensors)
        self._contacts: Any = self.DeclareVectorInputPort("contacts", len(sensor_of))
        self._raw, self._mean = slice(6 * sensors, 12 * sensors), 12 * sensors
        self._blend = -np.expm1(-dt / _MEAN)
        start: Any = np.zeros(13 * sensors + 1)
        start[self._raw], start[self._mean] = np.nan, np.nan
        state = self.DeclareDiscreteState(start)
        self._state = int(state)
        self._all = np.ones(len(sensor_of))
        own = {self._wrench.ticket(), self._flagged.ticket(), self.discrete_state_ticket(state), self.time_ticket()}
        self._good: Any = self.DeclareCacheEntry(
            "good", ValueProducer(allocate=Value(_Good()).Clone, calc=self._judge), own
        )
        known = self._good.ticket()
        self.DeclareVectorOutputPort(
            "reading", 6 * sensors, self._write, {known, self._wrench.ticket(), self.discrete_state_ticket(state)}
        )
        self.DeclareVectorOutputPort("contacts", len(sensor_of), self._write_contacts, {known, self._contacts.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _judge(self, context: Any, box: Any) -> None:
        wrench, flagged = self._wrench.Eval(context), self._flagged.Eval(context)
        judged, good, doubted = box.get_mutable_value(), None, None
        held = context.get_discrete_state(self._state).value()
        readings = wrench.reshape(self._k, 6)
        if np.count_nonzero(flagged) or not _finite(wrench):
            good = (np.abs(readings) < LARGEST).all(axis=1) & ~flagged.reshape(self._k, -1).any(axis=1)
        sizes = np.linalg.norm(readings[:, :3], axis=1)
        steps = np.abs(readings[:, :3] - held[self._raw].reshape(self._k, 6)[:, :3]).max(axis=1)
        doubt = held[self._mean + 1 :] > 0.0
        if context.get_time() >= SETTLED and (np.count_nonzero(doubt) or np.count_nonzero(steps > LOAD_JUMP)):
            there = np.ones(self._k, dtype=bool) if good is None else good
            last = np.linalg.norm(held[: 6 * self._k].reshape(self._k, 6)[:, :3], axis=1)
            total, before = float(np.where(there, sizes, last).sum()), float(held[self._mean])
            doubt = (doubt | (steps > LOAD_JUMP)) & there
            if doubt.any() and abs(total - before) >= LOADS_AGREE * before:
                doubted, good = doubt, there & ~doubt
        judged.total = float(sizes.sum()) if good is None else np.nan
        judged.sensors, judged.doubted = good, doubted

    def _readings(self, context: Context) -> FloatArray:
        judged: Any = self._good.Eval(context)
        good, wrench = judged.sensors, self._wrench.Eval(context)
        if good is None:
            return np.asarray(wrench)
        return np.where(np.repeat(good, 6), wrench, context.get_discrete_state(self._state).value()[: 6 * self._k])

    def _write(self, context: Context, vector: Any) -> None:
        vector.set_value(self._readings(context))

    def _write_contacts(self, context: Context, vector: Any) -> None:
        stood = self._contacts.Eval(context) if self._contacts.HasValue(context) else self._all
        stood = np.where(np.isfinite(stood), stood, 1.0)
        judged: Any = self._good.Eval(context)
        good = judged.sensors
        vector.set_value(stood if good is None else np.where(~good[self._sensor_of] & (stood > 0.5), 2.0, stood))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        judged: Any = self._good.Eval(context)
        held: Any = values.get_mutable_value(self._state)
        held[: 6 * self._k] = self._readings(context)
        held[self._raw] = self._wrench.Eval(context)
        mean = held[self._mean]
        if judged.total == judged.total:  # nothing is left out
            held[self._mean] = judged.total if mean != mean else mean + self._blend * (judged.total - mean)
        held[self._mean + 1 :] = 0.0 if judged.doubted is None else judged.doubted
