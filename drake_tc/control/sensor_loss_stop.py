"""`SensorLossStop`: a joint has lost two of its three sensors for good; torques fade, and the motors brake the fall."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.kernels.calls import COPY_BELOW, KernelCall
from drake_tc.types import BoolArray, Call, FloatArray

LOSS_TIME = 0.15
"""Time for which a flag is up before the joint counts as lost [s]; the flag itself takes 0.1 s of it."""
_ANY = float(np.nextafter(0.0, 1.0))
"""The least number above 0."""


class SensorLossStop(PortMethods, LeafSystem):
    """What the controllers get once a joint's `lost` has been up for `LOSS_TIME`, for good.

    Inputs: state (m) of the robot; torque (n) of the gauges; desired (n) torques of the controller; lost (n), by joint.
    Outputs, with feedthrough of the input of that name:
        state (m): NaN once a joint is lost that the robot stands on, with which `RobustTsid` fades all torques by
            exp(-t/fade).
        torque (n): faded likewise for all joints then, and for a lost joint that nothing stands on for that one, so
            that torque control sees neither torque nor speed, and asks for no voltage: a motor without voltage brakes
            its joint by its back-EMF.
        desired (n): faded for the lost joints alone, where the robot stands on none of them: an arm that is lost hangs,
            and the robot goes on standing.
    State, by joint: ticks c since `lost` is up, c[n+1] = c[n] + 1 where it is up or c[n] has reached the limit, else 0.
    """

    def __init__(self, size: int, carrying: BoolArray, fade: float, dt: float) -> None:
        """Declare ports, state and the periodic update.

        Args:
            size: m.
            carrying: (n,) which joints the robot stands on.
            fade: Of the torques [s].
            dt: Period [s].
        """
        super().__init__()
        self._limit, self._nothing, self._dt = float(np.ceil(LOSS_TIME / dt)), np.full(size, np.nan), dt
        self._rate, self._carrying = dt / fade, np.array(carrying, dtype=bool)
        joints = self._carrying.size
        self._known: Any = self.DeclareVectorInputPort("state", size)
        self._torque: Any = self.DeclareVectorInputPort("torque", joints)
        self._desired: Any = self.DeclareVectorInputPort("desired", joints)
        self._lost: Any = self.DeclareVectorInputPort("lost", joints)
        state = self.DeclareDiscreteState(joints)
        self._ticks = int(state)
        own = {self.discrete_state_ticket(state)}
        self.DeclareVectorOutputPort("state", size, self._write, own | {self._known.ticket()})
        self.DeclareVectorOutputPort("torque", joints, self._write_torque, own | {self._torque.ticket()})
        self.DeclareVectorOutputPort("desired", joints, self._write_desired, own | {self._desired.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        size, n = self._nothing.size, self._carrying.size

        def bind_early(arrays: Arrays) -> tuple[Sequence[Call], None]:
            ticks, known, torque = arrays.before, arrays.inputs["state"], arrays.inputs["torque"]
            state_out, torque_out = arrays.out[:size], arrays.out[size:]

            def tell(time: float) -> None:
                state_out[:] = self._nothing if self._is_lost(ticks) else known

            def fade(time: float) -> None:
                torque_out[:] = self._faded_torque(ticks, torque)

            usual = (ticks, self._limit)
            return (
                KernelCall(COPY_BELOW, tell, known, state_out, *usual),
                KernelCall(COPY_BELOW, fade, torque, torque_out, *usual),
            ), None

        def bind(arrays: Arrays) -> tuple[Call, Sequence[Call]]:
            ticks, desired, lost = arrays.before, arrays.inputs["desired"], arrays.inputs["lost"]
            out, after = arrays.out, arrays.after

            def fade(time: float) -> None:
                out[:] = self._faded_desired(ticks, desired)

            def count(time: float) -> None:
                after[:] = self._next(ticks, lost)

            outputs = KernelCall(COPY_BELOW, fade, desired, out, ticks, self._limit)
            return outputs, [KernelCall(COPY_BELOW, count, ticks, after, watched, _ANY) for watched in (ticks, lost)]

        parts = places({"state": slice(size), "torque": slice(size, size + n)})
        early = ArrayStage(size + n, parts, bind_early, frozenset({"state", "torque"}))
        desired, lost = frozenset({"desired"}), frozenset({"lost"})
        ports = places({"desired": slice(n)})
        return ArrayStage(n, ports, bind, desired, lost, start=np.zeros(n), period=self._dt, early=early)

    def _is_lost(self, ticks: FloatArray) -> bool:
        """Whether a joint is lost that the robot stands on."""
        return self._fades(ticks) and bool(np.count_nonzero(ticks[self._carrying] >= self._limit))

    def _fades(self, ticks: FloatArray) -> bool:
        """Whether any joint is lost."""
        return bool(np.count_nonzero(ticks)) and bool(np.count_nonzero(ticks >= self._limit))

    def _faded_torque(self, ticks: FloatArray, torque: FloatArray) -> FloatArray:
        """(n,) the output `torque`."""
        if not self._fades(ticks):
            return torque
        longest = float(ticks[self._carrying].max(initial=0.0))
        return np.asarray(torque * np.exp(-self._rate * np.maximum(np.maximum(ticks, longest) - self._limit, 0.0)))

    def _faded_desired(self, ticks: FloatArray, desired: FloatArray) -> FloatArray:
        """(n,) the output `desired`."""
        if not self._fades(ticks) or self._is_lost(ticks):
            return desired
        return np.asarray(desired * np.exp(-self._rate * np.maximum(ticks - self._limit, 0.0)))

    def _next(self, ticks: FloatArray, lost: FloatArray) -> FloatArray:
        """(n,) c[n+1]."""
        if not (np.count_nonzero(ticks) or np.count_nonzero(lost)):
            return ticks
        return np.where((ticks >= self._limit) | (lost > 0.0), ticks + 1.0, 0.0)

    def _ticks_of(self, context: Context) -> Any:
        return context.get_discrete_state(self._ticks).value()

    def _write(self, context: Context, vector: Any) -> None:
        vector.set_value(self._nothing if self._is_lost(self._ticks_of(context)) else self._known.Eval(context))

    def _write_torque(self, context: Context, vector: Any) -> None:
        vector.set_value(self._faded_torque(self._ticks_of(context), self._torque.Eval(context)))

    def _write_desired(self, context: Context, vector: Any) -> None:
        vector.set_value(self._faded_desired(self._ticks_of(context), self._desired.Eval(context)))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        after: Any = self._next(self._ticks_of(context), self._lost.Eval(context))
        values.set_value(self._ticks, after)
