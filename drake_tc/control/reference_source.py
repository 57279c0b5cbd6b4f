"""A reference as a source of a controller's port.

`StoppingReference`: a motion that slows down and stays where it is when it is told to stop.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, offered_stage, places
from drake_tc.control.references import Path, Swing
from drake_tc.types import Call, FloatArray

_ALWAYS = np.array([np.inf])


class ReferenceSource(StageSystem):
    """What a task follows, as a function of time alone.

    Output:
        reference (path.size): y(t) = path.row(t); no state, no input.

    Example:
        >>> from drake_tc.control.references import PointToPoint
        >>> ReferenceSource(PointToPoint((0.0, 0.0, 0.9), (0.05, 0.0, 0.9), 0.5, 1.0)).get_output_port().size()
        9
    """

    def __init__(self, path: Path) -> None:
        """Declare the port.

        Args:
            path: What to follow; its rows must be those of the task.
        """
        super().__init__()
        self._path = path
        self._declare({}, timed=True)

    @property
    def path(self) -> Path:
        """What is followed."""
        return self._path

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""

        def bind(arrays: Arrays) -> tuple[Call, None]:
            out, path = arrays.out, self._path

            def outputs(time: float) -> None:
                out[:] = path.row(time)

            return (path.call(_ALWAYS, out, outputs) if isinstance(path, Swing) else outputs), None

        return ArrayStage(self._path.size, places({"reference": slice(self._path.size)}), bind)


STOP_TIME = 0.3
"""From full speed to rest [s]."""
LAYOUTS = {9: (3, 6), 10: (4, 7), 19: (7, 13)}
"""Size of a reference to where its velocity and its acceleration begin: of a point, an orientation, a frame."""


class StoppingReference(StageSystem):
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
        self._path = source.path if type(source) is ReferenceSource else None
        self._layout = LAYOUTS[size]
        self._declare({"stop": 1}, timed=True)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports."""
        size = int(self._output.size())

        def bind(arrays: Arrays) -> tuple[Call, Call | None]:
            out, before, after = arrays.out, arrays.before, arrays.after
            stop: Any = arrays.inputs.get("stop")
            source, path = self._source_on_arrays(), self._path

            def outputs(time: float) -> None:
                out[:] = _slowed(source, self._layout, time, float(before[0]))

            def update(time: float) -> None:
                if before[0] == math.inf and stop[0] > 0.5:
                    after[0] = time

            calculated = path.call(before, out, outputs) if isinstance(path, Swing) else outputs
            return calculated, None if stop is None else update

        ports, start = places({"reference": slice(size)}), np.array([math.inf])
        return ArrayStage(size, ports, bind, updates=frozenset({"stop"}), start=start, period=self._dt)

    def _source_on_arrays(self) -> Callable[[float], FloatArray]:
        """The source's reference over time, without a call of Drake's where the source offers that."""
        stage, name = offered_stage(self._source), self._output.get_name()
        if stage is None or name not in stage.ports:
            return self._source_in(self._source.CreateDefaultContext())
        out, where = np.zeros(stage.width), stage.ports[name]
        found, _ = stage.bind(Arrays({}, out, stage.start, stage.start.copy()))
        calls = (found,) if callable(found) else tuple(found or ())

        def at(instant: float) -> FloatArray:
            for call in calls:
                call(instant)
            return out[where]

        return at

    def _source_in(self, scratch: Context) -> Callable[[float], FloatArray]:
        """The source's reference over time, by a Context of it."""

        def at(instant: float) -> FloatArray:
            scratch.SetTime(instant)
            found: FloatArray = self._output.Eval(scratch)
            return found

        return at


def _slowed(source: Callable[[float], FloatArray], layout: tuple[int, int], now: float, begin: float) -> FloatArray:
    """The output y(t) of t = `now` and t0 = `begin`."""
    if now <= begin:
        return source(now)
    pace = max(0.0, 1.0 - (now - begin) / STOP_TIME)
    found = np.array(source(begin + 0.5 * (1.0 - pace * pace) * STOP_TIME))
    v, a = layout
    braking = found[v:a] / STOP_TIME if pace > 0.0 else 0.0
    found[a:] = pace * pace * found[a:] - braking
    found[v:a] *= pace
    return found
