"""`JointSensors`: encoders on both sides of series springs and the gauges in them, each checked against the others."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, ValueProducer

from drake_tc.array_stage import Arrays, ArrayStage, PortMethods, places
from drake_tc.kernels.calls import REMEMBER, VOTE, KernelCall, above, copying
from drake_tc.kernels.lazy import Kernel
from drake_tc.types import Call, FloatArray

FLAGS = (
    "motor_encoder/missing",
    "motor_encoder/odd",
    "gauge/missing",
    "gauge/frozen",
    "gauge/odd",
    "encoder/odd",
    "joint/lost",
)
"""Not finite; at odds with the other two sensors of its joint (a frozen encoder before the spring too); repeating
itself; two of a joint's three wrong at once. What else ails encoders behind the springs, `FaultMonitor` says."""
HOLD = 0.1
"""How long a flag stays up after its cause [s]."""
GAUGE_REPEATS, LINK_REPEATS = 6, 20
"""Ticks from which a gauge, and an encoder behind a spring, is frozen."""
ROWS, HISTORY = 19, 80
"""Of the vote's memory, and ticks of the readings that it looks at, as in `drake_tc.kernels.joint_voting`."""
_VOTE, _REMEMBER = Kernel("joint_voting", "vote"), Kernel("joint_voting", "remember")
_NAMES = ("motor_angle", "torque", "link_angle")
_OUTPUTS = (*_NAMES, "position")


class _Vote:
    """Of one tick; a box for the cache, see `drake_tc.kernels.joint_voting.vote`."""

    def __init__(self, n: int) -> None:
        self.after: FloatArray = np.zeros(ROWS * n + 1)
        self.given: FloatArray = np.zeros((len(_OUTPUTS), n))
        self.found: FloatArray = np.zeros((10, n))


class JointSensors(PortMethods, LeafSystem):
    """Readings of n joints that can be believed: see `drake_tc.kernels.joint_voting` for the equations.

    Inputs (n each), raw: motor_angle [rad], torque [N m], link_angle [rad].
    Outputs: the same three, always finite, with direct feedthrough of every input; with it too
        position (n): of the links, theta - d [rad], as `LinkPosition` has it;
    and, of the state alone,
        flags (7): 1 up, 0 down, `FLAGS`, from the tick after the cause;
        lost (n): 1 for `HOLD` after the joint had two of its three sensors wrong.
    State x: memory of the vote (ROWS, n) and the number of ticks; the raw readings of `HISTORY` ticks as a ring; ticks
    that each flag, and each joint's loss, stays up; the flags. With V the vote,

        x[n+1], y[n] = V(x[n], u[n])

    While nothing is wrong the outputs are the inputs, bit by bit.
    """

    def __init__(
        self, compliance: FloatArray, spring_time: FloatArray, dt: float, noisy: tuple[bool, bool] = (True, True)
    ) -> None:
        """Declare ports, state and the periodic update.

        Args:
            compliance: (n,) c of the springs [rad/(N m)].
            spring_time: (n,) their damping over stiffness t_d [s].
            dt: Period [s].
            noisy: Whether gauges and encoders behind the springs have noise; one without may repeat itself.
        """
        super().__init__()
        n = len(compliance)
        self._springs = np.array([compliance, dt / (dt + np.asarray(spring_time, dtype=float))], dtype=float)
        self._repeats = np.where((False, *noisy), (np.inf, GAUGE_REPEATS, LINK_REPEATS), np.inf)
        self._hold, self._dt = float(np.ceil(HOLD / dt)), dt
        self._inputs: list[Any] = [self.DeclareVectorInputPort(name, n) for name in _NAMES]
        state, past = self.DeclareDiscreteState(ROWS * n + 1), self.DeclareDiscreteState(HISTORY * 3 * n)
        left, flags = self.DeclareDiscreteState(len(FLAGS)), self.DeclareDiscreteState(len(FLAGS))
        lost = self.DeclareDiscreteState(n)
        self._state, self._past, self._lost = int(state), int(past), int(lost)
        self._counters = (int(left), int(flags), int(lost))
        remembered = {self.discrete_state_ticket(state), self.discrete_state_ticket(past)}
        tickets = remembered | {port.ticket() for port in self._inputs}
        self._solved: Any = self.DeclareCacheEntry(
            "solved", ValueProducer(allocate=Value(_Vote(n)).Clone, calc=self._solve), tickets
        )
        for row, name in enumerate(_OUTPUTS):
            self.DeclareVectorOutputPort(name, n, self._writer(row), {self._solved.ticket()})
        self.DeclareStateOutputPort("flags", flags)
        self.DeclareVectorOutputPort("lost", n, self._write_lost, {self.discrete_state_ticket(lost)})
        self.DeclarePeriodicDiscreteUpdateEvent(dt, 0.0, self._update)

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports; the state is [memory of the vote; ring; ticks of flags; flags; of losses]."""
        n, flags = self._springs.shape[1], len(FLAGS)
        memory, ring = ROWS * n + 1, HISTORY * 3 * n
        shown, ends = len(_OUTPUTS) * n, np.cumsum([memory, ring, flags, flags]).tolist()

        def bind(arrays: Arrays) -> tuple[Sequence[Call], Call]:
            now, vote, out = [arrays.inputs[name] for name in _NAMES], _Vote(n), arrays.out
            before, past, _, up, left_of_lost = np.split(arrays.before, ends)
            after, next_past, *counters = np.split(arrays.after, ends)
            vote.given = out[:shown].reshape(len(_OUTPUTS), n)
            memory_of = before, past.reshape(HISTORY, 3 * n)
            kept = (after, next_past.reshape(HISTORY, 3 * n), *counters)

            def voted(time: float) -> None:
                _VOTE(tuple(now), memory_of, self._springs, self._repeats, (vote.after, vote.given, vote.found))

            def update(time: float) -> None:
                _REMEMBER((vote.after, vote.found), self._hold, kept)

            shows = copying(up, out[shown : shown + flags]), above(left_of_lost, 0.0, out[shown + flags :])
            given = (*now, *memory_of, self._springs, self._repeats)
            calls = [KernelCall(VOTE, voted, *given, vote.after, vote.given, vote.found), *shows]
            return calls, KernelCall(REMEMBER, update, vote.after, vote.found, self._hold, *kept)

        parts = {name: slice(row * n, (row + 1) * n) for row, name in enumerate(_OUTPUTS)}
        parts |= {"flags": slice(shown, shown + flags), "lost": slice(shown + flags, shown + flags + n)}
        width, start = shown + flags + n, np.zeros(ends[-1] + n)
        return ArrayStage(width, places(parts), bind, frozenset(_NAMES), start=start, period=self._dt)

    def _solve(self, context: Any, box: Any) -> None:
        """This tick's vote."""
        now, vote = [port.Eval(context) for port in self._inputs], box.get_mutable_value()
        before, past = (context.get_discrete_state(index).value() for index in (self._state, self._past))
        memory, written = (before, past.reshape(HISTORY, -1)), (vote.after, vote.given, vote.found)
        _VOTE(tuple(now), memory, self._springs, self._repeats, written)

    def _writer(self, row: int) -> Any:
        """The calc function of one output."""

        def write(context: Context, vector: Any) -> None:
            vote: Any = self._solved.Eval(context)
            vector.set_value(vote.given[row])

        return write

    def _write_lost(self, context: Context, vector: Any) -> None:
        ticks: Any = context.get_discrete_state(self._lost).value()
        vector.set_value((ticks > 0.0).astype(float))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        """x[n+1]."""
        vote: Any = self._solved.Eval(context)
        after: Any = values
        state, past, *counters = (after.get_mutable_value(i) for i in (self._state, self._past, *self._counters))
        _REMEMBER((vote.after, vote.found), self._hold, (state, past.reshape(HISTORY, -1), *counters))
