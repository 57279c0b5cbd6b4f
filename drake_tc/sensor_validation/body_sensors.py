"""`ValidatedImu`, `ValidatedWrench`: checked readings for the base estimator, and substitutes for failed ones."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, ValueProducer

from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, StageSystem, places
from drake_tc.kernels.calls import IMU, WRENCHES, Kernel, KernelCall, above, copying
from drake_tc.types import Call, FloatArray

SETTLED = 0.1
"""Before, soles take their load, which no sensor is blamed for [s]."""
LOAD_JUMP, LOADS_AGREE = 50.0, 0.15
"""A force that changes by so much in a tick [N] is believed once all sensors together carry what they carried before,
to this share: a load goes over from one foot to another, or comes with an impact that is soon over."""
_MEAN, _LEAST, _SOON = 0.05, 0.1, 0.02
"""Time over which an IMU is averaged, the least for which one that jumped and stayed is left out, and within which it
has jumped back, or the jolt that made it jump is felt in the feet [s]."""

_IMU, _WRENCHES = Kernel("sensors", "imu"), Kernel("sensors", "wrenches")


class ValidatedImu(StageSystem):
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
        self._limit, self._dt = np.array(limit, dtype=float), dt
        self._options = np.array([-np.expm1(-dt / _MEAN), round(_LEAST / dt), round(_SOON / dt)])
        self._declare({"imu": 6, "flagged": flags, "jolt": jolts}, timed=True)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports; the state is [memory; left out]."""
        names = ("imu", "flagged", "jolt")
        start = np.concatenate((np.full(24, np.nan), np.zeros(2)))

        def bind_early(arrays: Arrays) -> tuple[Call, None]:
            return copying(arrays.before[-1:], arrays.out), None

        def bind(arrays: Arrays) -> tuple[Call, Sequence[Call]]:
            now, reading, reached = [arrays.inputs[name] for name in names], arrays.out, np.zeros(start.size - 1)
            before, after, options = arrays.before[:-1], arrays.after, (self._limit, self._options)

            def check(time: float) -> None:
                _IMU(tuple(now), float(time >= SETTLED), options, before, (reading, reached))

            outputs = KernelCall(IMU, check, *now, SETTLED, *options, before, reading, reached)
            return outputs, [copying(reached, after[:-1]), above(reached[-1:], 0.0, after[-1:])]

        early = ArrayStage(1, places({"left_out": slice(1)}), bind_early)
        ports = places({"reading": slice(6)})
        return ArrayStage(6, ports, bind, frozenset(names), start=start, period=self._dt, early=early)


class _Solved:
    """This tick's reading and the state after it; a box for the cache.

    Attributes:
        reading: What can be believed.
        good: (k,) 1 where a sensor can be.
        after: The state.
        well: Whether all can be believed.
    """

    def __init__(self, reading: int, sensors: int, state: int) -> None:
        self.reading: FloatArray = np.zeros(reading)
        self.good: FloatArray = np.zeros(sensors)
        self.after: FloatArray = np.zeros(state)
        self.well = True


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
        self._sensor_of, self._dt = np.array(sensor_of, dtype=int), dt
        self._wrench: Any = self.DeclareVectorInputPort("wrench", 6 * sensors)
        self._flagged: Any = self.DeclareVectorInputPort("flagged", flags * sensors)
        self._contacts: Any = self.DeclareVectorInputPort("contacts", len(sensor_of))
        self._options = np.array([-np.expm1(-dt / _MEAN), LOAD_JUMP, LOADS_AGREE])
        start: Any = np.zeros(13 * sensors + 1)
        start[6 * sensors : 12 * sensors + 1] = np.nan
        self._start: FloatArray = start
        state = self.DeclareDiscreteState(start)
        self._state = int(state)
        self._all = np.ones(len(sensor_of))
        own = {self._wrench.ticket(), self._flagged.ticket(), self.discrete_state_ticket(state), self.time_ticket()}
        empty = Value(_Solved(6 * sensors, sensors, 13 * sensors + 1))
        self._solved: Any = self.DeclareCacheEntry("solved", ValueProducer(allocate=empty.Clone, calc=self._solve), own)
        known = self._solved.ticket()
        self.DeclareVectorOutputPort("reading", 6 * sensors, self._write, {known})
        self.DeclareVectorOutputPort("contacts", len(sensor_of), self._write_contacts, {known, self._contacts.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        names, contacts = ("wrench", "flagged"), len(self._sensor_of)
        sensors = self._wrench.size() // 6

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            solved, stood = _Solved(6 * sensors, sensors, self._start.size), arrays.inputs.get("contacts", self._all)
            now, before, out = [arrays.inputs[name] for name in names], arrays.before, arrays.out[6 * sensors :]
            solved.reading = arrays.out[: 6 * sensors]

            def outputs(time: float) -> None:
                self._check(now, time, before, solved)
                out[:] = self._stood(solved, stood)

            fixed = (SETTLED, self._options, before, solved.reading, solved.good, solved.after, out, stood)
            return KernelCall(WRENCHES, outputs, *now, *fixed), copying(solved.after, arrays.after)

        parts = places({"reading": slice(6 * sensors), "contacts": slice(6 * sensors, 6 * sensors + contacts)})
        reads = frozenset({*names, "contacts"})
        return ArrayStage(6 * sensors + contacts, parts, bind, reads, start=self._start, period=self._dt)

    def _check(self, now: Sequence[FloatArray], time: float, before: FloatArray, solved: _Solved) -> None:
        """The readings of a tick and the state after it."""
        written = (solved.reading, solved.good, solved.after)
        solved.well = _WRENCHES(tuple(now), float(time >= SETTLED), self._options, before, written)

    def _stood(self, solved: _Solved, stood: FloatArray | None) -> FloatArray:
        """(c,) the output `contacts`, of the input of that name; None where that is not connected."""
        told = self._all if stood is None else np.where(np.isfinite(stood), stood, 1.0)
        if solved.well:
            return told
        return np.where((solved.good[self._sensor_of] == 0.0) & (told > 0.5), 2.0, told)

    def _solve(self, context: Any, box: Any) -> None:
        """This tick's readings."""
        now = [port.Eval(context) for port in (self._wrench, self._flagged)]
        before = context.get_discrete_state(self._state).value()
        self._check(now, context.get_time(), before, box.get_mutable_value())

    def _write(self, context: Context, vector: Any) -> None:
        solved: Any = self._solved.Eval(context)
        vector.set_value(solved.reading)

    def _write_contacts(self, context: Context, vector: Any) -> None:
        stood = self._contacts.Eval(context) if self._contacts.HasValue(context) else None
        vector.set_value(self._stood(self._solved.Eval(context), stood))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        solved: Any = self._solved.Eval(context)
        values.set_value(self._state, solved.after)
