"""`TrustedImu`, `TrustedWrench`: readings that the base estimator may believe; what stands in for those it may not."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_tc.types import BoolArray, FloatArray

LARGEST = 1e9
"""No reading in SI units is as large."""
SETTLED = 0.1
"""Before, soles take their load, which no sensor is blamed for [s]."""
_MEAN, _LEAST, _TOLD = 0.05, 0.1, 0.01
"""Time over which an IMU is averaged, the least for which one that jumped is left out, and within which a jolt that
made it jump is felt in the feet [s]."""


class TrustedImu(LeafSystem):  # type: ignore[misc, unused-ignore]
    """An IMU that may be left out: NaN then, on which the base estimator goes by the contacts alone.

    Inputs: imu (6) raw [gyro; accel]; flagged (m): any that is up leaves it out; jolt (j): any that is up says that the
        robot was hit, or a foot landed, so that a jump of the IMU is true.
    Outputs: reading (6), u or NaN, with feedthrough; left_out (1), of state and flags.
    State: u of the last tick, its mean m, the mean mu before a jump (6 each), ticks since the jump (0: none).

        m[n+1] = m[n] + (1 - exp(-dt/T)) (u[n] - m[n]),   T = 50 ms
        a jump: |u[n] - u[n-1]| > limit in one axis; mu = m[n], and it is left out from that tick on, until 0.1 s are
        over and |m - mu| < limit/2 in all axes: until it has jumped back, or the motion has.

    What is not finite is left out at once and not remembered. Nothing counts as a jump before `SETTLED`, nor in a jolt;
    one that a jolt follows within `_TOLD` is taken back.
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
        self._least, self._told = round(_LEAST / dt), round(_TOLD / dt)
        self._imu: Any = self.DeclareVectorInputPort("imu", 6)
        self._flagged: Any = self.DeclareVectorInputPort("flagged", flags)
        self._jolt: Any = self.DeclareVectorInputPort("jolt", jolts)
        start: Any = np.append(np.full(18, np.nan), 0.0)
        state = self.DeclareDiscreteState(start)
        self._state = int(state)
        inputs = {self._flagged.ticket(), self._imu.ticket(), self._jolt.ticket()}
        tickets = {self.discrete_state_ticket(state), self.time_ticket(), *inputs}
        self.DeclareVectorOutputPort("reading", 6, self._write, tickets)
        self.DeclareVectorOutputPort("left_out", 1, self._write_left_out, {self.discrete_state_ticket(state)})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _jumps(self, context: Context, u: FloatArray, held: Any) -> bool:
        beyond = context.get_time() >= SETTLED and bool((np.abs(u - held[:6]) > self._limit).any())
        return beyond and not self._jolt.Eval(context).any()

    def _write(self, context: Context, vector: Any) -> None:
        u, held = self._imu.Eval(context), context.get_discrete_state(self._state).value()
        good = not held[18] and not self._flagged.Eval(context).any() and not self._jumps(context, u, held)
        vector.set_value(u if good and np.abs(u).max() < LARGEST else np.full(6, np.nan))

    def _write_left_out(self, context: Context, vector: Any) -> None:
        vector.set_value([float(context.get_discrete_state(self._state).value()[18] > 0.0)])

    def _update(self, context: Context, values: DiscreteValues) -> None:
        u, held = self._imu.Eval(context), context.get_discrete_state(self._state).value()
        if not np.abs(u).max() < LARGEST:
            if held[18]:
                after: Any = np.append(held[:18], held[18] + 1.0)
                values.set_value(self._state, after)
            return
        mean = np.where(np.isfinite(held[6:12]), held[6:12] + self._blend * (u - held[6:12]), u)
        before, since = held[12:18], held[18]
        if not since and self._jumps(context, u, held):
            before, since = held[6:12], 1.0
        elif since:
            true = since <= self._told and self._jolt.Eval(context).any()
            back = since >= self._least and bool((np.abs(mean - before) < 0.5 * self._limit).all())
            since = 0.0 if true or back else since + 1.0
        after = np.concatenate([u, mean, before, [since]])
        values.set_value(self._state, after)


class TrustedWrench(LeafSystem):  # type: ignore[misc, unused-ignore]
    """k F/T sensors, each of which may be left out: its last good reading stands in, and its contact is kept.

    Inputs:
        wrench (6k): raw [f; t].
        flagged (mk): m flags of each sensor; any that is up leaves it out.
        contacts (c): 1 where the controller stands on a contact, 0 where it does without; all, when not connected.
    Outputs, with feedthrough:
        reading (6k): always finite.
        contacts (c): the input, with 2 for 1 where the contact's sensor is left out: it carries, whatever that says.
    State: the last good reading (6k), 0 before any. A sensor with one axis that is not finite is left out as a whole.
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
        state = self.DeclareDiscreteState(6 * sensors)
        self._state = int(state)
        own = {self._wrench.ticket(), self._flagged.ticket()}
        self.DeclareVectorOutputPort("reading", 6 * sensors, self._write, own | {self.discrete_state_ticket(state)})
        self.DeclareVectorOutputPort("contacts", len(sensor_of), self._write_contacts, own | {self._contacts.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def _good(self, context: Context) -> BoolArray | None:
        """(k,) which sensors can be believed; None: all."""
        if not self._flagged.Eval(context).any() and np.abs(self._wrench.Eval(context)).max() < LARGEST:
            return None
        finite = (np.abs(self._wrench.Eval(context).reshape(self._k, 6)) < LARGEST).all(axis=1)
        up = self._flagged.Eval(context).reshape(self._k, -1).any(axis=1)
        return np.asarray(finite & ~up)

    def _readings(self, context: Context) -> FloatArray:
        good, wrench = self._good(context), self._wrench.Eval(context)
        if good is None:
            return np.asarray(wrench)
        return np.where(np.repeat(good, 6), wrench, context.get_discrete_state(self._state).value())

    def _write(self, context: Context, vector: Any) -> None:
        vector.set_value(self._readings(context))

    def _write_contacts(self, context: Context, vector: Any) -> None:
        stood = self._contacts.Eval(context) if self._contacts.HasValue(context) else np.ones(len(self._sensor_of))
        good = self._good(context)
        vector.set_value(stood if good is None else np.where(~good[self._sensor_of] & (stood > 0.5), 2.0, stood))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        after: Any = self._readings(context)
        values.set_value(self._state, after)
