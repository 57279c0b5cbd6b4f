"""`Sensor`: n channels of a sensor as one Drake system, and what all sensors here share (`SensorBase`)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort, LeafSystem, ValueProducer

from drake_tc.array_stage import PortMethods
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import BETWEEN_TICKS, Kernel
from drake_tc.sensing.corruption import BLOCK, DRAW, TICK, Corruption, SensorOnArrays, corrupt
from drake_tc.sensing.spec import SensorFault, SensorSpec
from drake_tc.types import FloatArray

__all__ = ["Sensor", "SensorBase", "SensorFault", "SensorSpec", "corrupt"]

_READING = Kernel("sensors", "reading")
_OFFSET = 2


@dataclass
class _Block:
    """The rows of a block of ticks."""

    index: int = -1
    draw: float = 0.0
    rows: FloatArray = field(default_factory=lambda: np.empty((0, 0)))


def _keep(context: object, value: object) -> None:
    """What is drawn does not age: it is a function of seed and tick."""


class SensorBase(SensorOnArrays, PortMethods, LeafSystem):
    """A truth that becomes a reading; a subclass says where the truth comes from.

    Input, of the sensors of a robot:
        draw (1): which sample of the sensor it is (`Corruption.drawn`); 0, as without connection, is the one described.
    Output:
        reading (n): NaN where a sample is lost.

    State of a sensor with latency, `frozen` or `late` faults, every dt:

        k[n+1] = k[n] + 1                                             tick
        o[n]   = bias + noise w[k] + faults, NaN where lost           (n,), drawn in the update from (seed, k)
        m[n]   = 1 where a `frozen` fault holds the channel           (n,), only with such faults
        a[n]   = additional age by `late` faults                      (n,) ticks, only with such faults
        d[n+1] = [d[n] without its oldest; u[n]]                      (L + A, n) ring; A ticks: all late faults together
        l[n+1] = y[n] where finite, else l[n]                         (n,), only with `frozen` faults

        y[n]   = l[n] where m[n] (and l[n] is finite, and the sample came), else Q(scale u[n-L-a[n]] + o[n])

    L = 0: u feeds through, and the system adds no delay. L > 0: no feedthrough; a simulator's initialization fills d
    with the first truth (without one it is NaN until L + A ticks have passed). With a start time t0 other than 0, k
    starts at t0/dt.

    Without latency, `frozen` and `late` faults, k is the tick t/dt (between ticks the next one), and the state is o of
    the BLOCK ticks around it, drawn a tick ahead in an event every BLOCK ticks: nothing has to be updated in between.
    A spec and faults that never change anything have neither state nor event.
    """

    is_drawn = True
    """Whether it has the port `draw`."""
    on_arrays = SensorOnArrays.on_arrays  # belongs to the callbacks below, see `drake_tc.array_stage.offered_stage`

    def _declare(self, truth: InputPort, sensor: Corruption) -> None:
        """Declare state, output and events; once, at the end of the subclass's constructor.

        Args:
            truth: The input port that `_truth` reads.
            sensor: What it does to the truth.
        """
        size, spec = sensor.size, sensor.spec
        self._input, self._corruption = truth, sensor
        self._draw_port: Any = self.DeclareVectorInputPort(DRAW, 1) if self.is_drawn else None
        drawn = set() if self._draw_port is None else {self._draw_port.ticket()}
        self._size, self._delay, self._freezes = size, sensor.delay, sensor.freezes
        self._length = sensor.oldest
        self._is_late = self._length > self._delay
        self._channels = np.stack([spec.channels("scale", size), spec.channels("resolution", size)])
        ages = _OFFSET + size * (1 + self._freezes) if self._is_late else 0
        self._layout, self._nothing = np.array([self._delay, ages]), np.zeros(0)
        self._ticks, self._changes, self._dt = bool(self._length or self._freezes), sensor.changes, float(sensor.dt)
        self._first = self._rows(0)[:1]
        if self._ticks:
            first: Any = self._first[0]
            now = self.DeclareDiscreteState(first)
            tickets = {self.discrete_state_ticket(now)}
            self._now = int(now)
        elif self._changes:
            block = self.DeclareAbstractState(Value(_Block(0, 0.0, self._with_last(0, 0.0))))
            tickets = {self.abstract_state_ticket(block), self.time_ticket(), *drawn}
            self._drawn = int(block)
        else:
            tickets = drawn or {self.nothing_ticket()}
        if self._length:
            empty: Any = np.full(self._length * size, np.nan)
            line = self.DeclareDiscreteState(empty)
            tickets.add(self.discrete_state_ticket(line))
            self._line = int(line)
        if not self._delay:
            tickets.add(truth.ticket())
        if self._freezes:
            nothing: Any = np.full(size, np.nan)
            last = self.DeclareDiscreteState(nothing)
            tickets.add(self.discrete_state_ticket(last))
            self._last = int(last)
        self._reading: Any = self.DeclareVectorOutputPort("reading", size, self._calc, prerequisites_of_calc=tickets)
        if self._ticks:
            self._block: Any = self.DeclareCacheEntry(
                "block", ValueProducer(allocate=Value(_Block()).Clone, calc=_keep), {self.nothing_ticket()}
            )
            self.DeclareInitializationDiscreteUpdateEvent(self._start)
            self.DeclarePeriodicDiscreteUpdateEvent(sensor.dt, 0.0, self._update)
        elif self._changes:
            self.DeclareInitializationUnrestrictedUpdateEvent(self._draw_first)
            self.DeclarePeriodicUnrestrictedUpdateEvent(BLOCK * sensor.dt, (BLOCK - 1) * sensor.dt, self._draw_next)

    @property
    def spec(self) -> SensorSpec:
        """What the sensor does."""
        return self._corruption.spec

    @property
    def faults(self) -> tuple[SensorFault, ...]:
        """When it fails."""
        return self._corruption.faults

    def coordinates(self, context: Context) -> FloatArray:
        """(L n,) the delay line, oldest first: all that is state where nothing is random (`drake_tc.analysis`).

        Raises:
            ParamsError: noise, quantisation, lost samples or faults, of which no derivative can be taken.
        """
        self.ValidateContext(context)
        if self._corruption.changes or self._channels[1].any():
            raise ParamsError(
                f"sensor {self.get_name()!r}: expected neither noise, quantisation, drop-outs nor faults, to linearise;"
                " take perfect sensors"
            )
        if not self._delay:
            return np.zeros(0)
        line = np.array(context.get_discrete_state(self._line).value()).reshape(self._delay, self._size)
        return np.roll(line, -self._oldest(context), axis=0).ravel()

    def set_coordinates(self, context: Context, x: FloatArray) -> None:
        """Make the delay line (L n,) x, oldest first."""
        self.ValidateContext(context)
        if self._delay:
            line = np.roll(np.asarray(x).reshape(self._delay, self._size), self._oldest(context), axis=0)
            state: Any = context
            state.SetDiscreteState(self._line, line.ravel())

    def coordinate_names(self) -> tuple[str, ...]:
        """Of `coordinates`: "truth[i]@-k" is the true value of element i, k ticks old."""
        return tuple(f"truth[{i}]@-{age}" for age in range(self._delay, 0, -1) for i in range(self._size))

    def _oldest(self, context: Context) -> int:
        """Row of the delay line that is read at this tick."""
        return int(context.get_discrete_state(self._now).value()[TICK]) % self._delay

    def _truth(self, context: Context) -> FloatArray:
        """(n,) u of a Context."""
        port: Any = self._input
        return self._truth_of(port.Eval(context))

    def _draw_of(self, context: Context) -> float:
        """Which sample of the sensor this Context has."""
        port = self._draw_port
        return float(port.Eval(context)[0]) if port is not None and port.HasValue(context) else 0.0

    def _rows(self, block: int, draw: float = 0.0) -> FloatArray:
        """(BLOCK, ...) state rows [k, any m, o, m, a] of a block's ticks, m and a only where the sensor has them."""
        sensor = self._corruption.drawn(draw)
        ticks = (block * BLOCK + np.arange(BLOCK, dtype=np.float64))[:, None]
        offsets = sensor.offsets(block)
        any_stuck = np.zeros_like(ticks)
        more: list[FloatArray] = []
        if self._freezes:
            frozen = self._corruption.frozen(block) & np.isfinite(offsets)
            any_stuck[:, 0] = frozen.any(axis=1)
            more.append(frozen.astype(np.float64))
        if self._is_late:
            more.append(self._corruption.lateness(block).astype(np.float64))
        return np.hstack([ticks, any_stuck, offsets, *more])

    def _row(self, context: Any) -> tuple[FloatArray, int]:
        """(rows [k, any m, o, m, a], that of this tick)."""
        if self._ticks:
            return context.get_discrete_state(self._now).value()[np.newaxis], 0
        if not self._changes:
            draw = self._draw_of(context)
            return (self._rows(0, draw)[:1] if draw else self._first), 0
        block: _Block = context.get_abstract_state(self._drawn).get_value()
        tick = ceil(context.get_time() / self._dt - BETWEEN_TICKS)
        at = tick - block.index * BLOCK + 1
        draw = self._draw_of(context)
        if 0 <= at <= BLOCK and block.draw == draw:
            return block.rows, at
        # a context whose time was set by hand is served too: the rows are a function of seed and tick
        return self._rows(max(tick, 0) // BLOCK, draw), tick % BLOCK

    def _calc(self, context: Any, output: BasicVector) -> None:
        rows, at = self._row(context)
        ring = context.get_discrete_state(self._line).value() if self._length else self._nothing
        last = context.get_discrete_state(self._last).value() if self._freezes else self._nothing
        truth = self._nothing if self._delay else self._truth(context)
        _READING(truth, rows[at], (ring, last), (self._channels, self._layout), output.get_mutable_value())

    def _update(self, context: Any, values: DiscreteValues) -> None:
        new: Any = values
        tick = int(new.value(self._now)[TICK])
        index, row = divmod(tick + 1, BLOCK)
        block: _Block = self._block.Eval(context)
        draw = self._draw_of(context)
        if (block.index, block.draw) != (index, draw):
            block.index, block.draw, block.rows = index, draw, self._rows(index, draw)
        new.set_value(self._now, block.rows[row])
        if self._length:
            at = tick % self._length * self._size
            new.get_mutable_value(self._line)[at : at + self._size] = self._truth(context)
        if self._freezes:
            y = self._reading.Eval(context)
            last = context.get_discrete_state(self._last).value()
            new.set_value(self._last, np.where(np.isfinite(y), y, last))

    def _draw_first(self, context: Any, state: Any) -> None:
        """The block of the start time."""
        self._draw(context, state, ceil(context.get_time() / self._dt - BETWEEN_TICKS) // BLOCK)

    def _draw_next(self, context: Any, state: Any) -> None:
        """The block that begins a tick from now."""
        self._draw(context, state, round(context.get_time() / self._dt + 1.0) // BLOCK)

    def _draw(self, context: Any, state: Any, block: int) -> None:
        drawn: _Block = state.get_mutable_abstract_state(self._drawn).get_mutable_value()
        draw = self._draw_of(context)
        if (drawn.index, drawn.draw) != (block, draw):
            drawn.index, drawn.draw, drawn.rows = block, draw, self._with_last(block, draw)

    def _with_last(self, block: int, draw: float) -> FloatArray:
        """(1 + BLOCK, ...) the last row before a block, which the updates of that tick still read, and the block's."""
        return np.concatenate([self._rows(max(block - 1, 0), draw)[-1:], self._rows(block, draw)])

    def _start(self, context: Any, values: DiscreteValues) -> None:
        """Count from the start time, and fill what is empty of the delay line."""
        new: Any = values
        tick = context.get_discrete_state(self._now).value()[TICK]
        first = self._first_row(tick, context.get_time(), self._draw_of(context))
        if first is not None:
            new.set_value(self._now, first)
        if self._length:
            line = context.get_discrete_state(self._line).value()
            if np.isnan(line).all():
                new.set_value(self._line, np.tile(self._truth(context), self._length))


class Sensor(SensorBase):
    """n channels: `truth` (n) to `reading` (n). See `SensorBase` for the recursion, `SensorSpec` for the equation."""

    is_drawn = False

    def __init__(
        self, size: int, spec: SensorSpec, dt: float, faults: Sequence[SensorFault] = (), seed: int = 0
    ) -> None:
        """Declare ports, state and the periodic update.

        Args:
            size: Channels n.
            spec: What the sensor does to the truth.
            dt: Period [s].
            faults: When it fails.
            seed: Of its random numbers; the same seed gives the same numbers in every Context.

        Raises:
            ParamsError: As `Corruption`.
        """
        super().__init__()
        sensor = Corruption(size, spec, dt, tuple(faults), seed)
        self._declare(self.DeclareVectorInputPort("truth", size), sensor)

    def _truth_of(self, value: FloatArray) -> FloatArray:
        return value
