"""`StoppingReference`: a motion that slows down and stays where it is when it is told to stop."""

import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, ValueProducer

from drake_tc.array_stage import Arrays, ArrayStage, places
from drake_tc.port_methods import PortMethods
from drake_tc.types import Call, FloatArray

STOP_TIME = 0.3
"""From full speed to rest [s]."""
LAYOUTS = {9: (3, 6), 10: (4, 7), 19: (7, 13)}
"""Size of a reference to where its velocity and its acceleration begin: of a point, an orientation, a frame."""


class StoppingReference(PortMethods, LeafSystem):
    """A reference [place; velocity; acceleration] along its own path, at a pace p(t) that a stop takes from 1 to 0.

    Input: stop (1), read at the ticks; above 0.5 once, it is told to stop for good.
    Output: reference, of time and state alone. With t0 the tick after which it stops, r the source and T = `STOP_TIME`,

        p = 1 - (t - t0)/T, not below 0,   s = t0 + (1 - p^2) T/2
        place r(s),   velocity p r'(s),   acceleration p^2 r''(s) - r'(s)/T, 0 after the stop

    State: t0, infinite before; then y(t) = r(t).
    """

    def __init__(self, source: Any, dt: float) -> None:
        """Declare ports, state and the periodic update.

        Args:
            source: A system without inputs and state, whose one output is the reference over time.
            dt: Period [s].
        """
        super().__init__()
        output = source.get_output_port()
        size = int(output.size())
        self._source, self._output, self._dt = source, output, dt
        self._velocity, self._acceleration = LAYOUTS[size]
        self._stop: Any = self.DeclareVectorInputPort("stop", 1)
        never: Any = np.array([math.inf])
        state = self.DeclareDiscreteState(never)
        self._state = int(state)
        self._scratch: Any = self.DeclareCacheEntry(
            "scratch",
            ValueProducer(allocate=lambda: Value(source.CreateDefaultContext()), calc=lambda context, value: None),
            {self.nothing_ticket()},
        )
        self.DeclareVectorOutputPort(
            "reference", size, self._write, {self.time_ticket(), self.discrete_state_ticket(state)}
        )
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        size = int(self._output.size())

        def bind(arrays: Arrays) -> tuple[Call, Call | None]:
            out, before, after, stop = arrays.out, arrays.before, arrays.after, arrays.inputs.get("stop")
            scratch = self._source.CreateDefaultContext()

            def outputs(time: float) -> None:
                out[:] = self._reference(scratch, time, float(before[0]))

            def update(time: float) -> None:
                if before[0] == math.inf and stop[0] > 0.5:
                    after[0] = time

            return outputs, None if stop is None else update

        ports, start = places({"reference": slice(size)}), np.array([math.inf])
        return ArrayStage(size, ports, bind, updates=frozenset({"stop"}), start=start, period=self._dt)

    def _at(self, scratch: Context, instant: float) -> FloatArray:
        """The source's reference at an instant."""
        scratch.SetTime(instant)
        found: FloatArray = self._output.Eval(scratch)
        return found

    def _reference(self, scratch: Context, now: float, begin: float) -> FloatArray:
        """The output y(t) of t = `now` and t0 = `begin`."""
        if now <= begin:
            return self._at(scratch, now)
        pace = max(0.0, 1.0 - (now - begin) / STOP_TIME)
        found = np.array(self._at(scratch, begin + 0.5 * (1.0 - pace * pace) * STOP_TIME))
        v, a = self._velocity, self._acceleration
        braking = found[v:a] / STOP_TIME if pace > 0.0 else 0.0
        found[a:] = pace * pace * found[a:] - braking
        found[v:a] *= pace
        return found

    def _write(self, context: Any, vector: Any) -> None:
        now, begin = context.get_time(), context.get_discrete_state(self._state).GetAtIndex(0)
        vector.set_value(self._reference(self._scratch.Eval(context), now, begin))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        begin = context.get_discrete_state(self._state).GetAtIndex(0)
        if begin == math.inf and self._stop.HasValue(context) and self._stop.Eval(context)[0] > 0.5:
            values.get_mutable_vector(self._state).SetAtIndex(0, context.get_time())
