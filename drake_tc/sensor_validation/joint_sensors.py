"""`JointSensors`: encoders on both sides of series springs and the gauges in them, each checked against the others."""

from collections.abc import Sequence

import numpy as np

from drake_tc.array_stage import Arrays, ArrayStage, StageSystem, places
from drake_tc.kernels.calls import REMEMBER, VOTE, Kernel, KernelCall, above, copying
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


class JointSensors(StageSystem):
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
        self._declare(dict.fromkeys(_NAMES, n))

    def on_arrays(self) -> ArrayStage:
        """This stage without its ports; the state is [memory of the vote; ring; ticks of flags; flags; of losses]."""
        n, flags = self._springs.shape[1], len(FLAGS)
        memory, ring = ROWS * n + 1, HISTORY * 3 * n
        ends = np.cumsum([memory, ring, flags, flags]).tolist()

        def bind_early(arrays: Arrays) -> tuple[Sequence[Call], None]:
            *_, up, left_of_lost = np.split(arrays.before, ends)
            return (copying(up, arrays.out[:flags]), above(left_of_lost, 0.0, arrays.out[flags:])), None

        def bind(arrays: Arrays) -> tuple[Call, Call]:
            now, vote = [arrays.inputs[name] for name in _NAMES], _Vote(n)
            before, past = np.split(arrays.before, ends)[:2]
            after, next_past, *counters = np.split(arrays.after, ends)
            vote.given = arrays.out.reshape(len(_OUTPUTS), n)
            memory_of = before, past.reshape(HISTORY, 3 * n)
            kept = (after, next_past.reshape(HISTORY, 3 * n), *counters)

            def voted(time: float) -> None:
                _VOTE(tuple(now), memory_of, self._springs, self._repeats, (vote.after, vote.given, vote.found))

            def update(time: float) -> None:
                _REMEMBER((vote.after, vote.found), self._hold, kept)

            given = (*now, *memory_of, self._springs, self._repeats)
            outputs = KernelCall(VOTE, voted, *given, vote.after, vote.given, vote.found)
            return outputs, KernelCall(REMEMBER, update, vote.after, vote.found, self._hold, *kept)

        of_state = places({"flags": slice(flags), "lost": slice(flags, flags + n)})
        early, start = ArrayStage(flags + n, of_state, bind_early), np.zeros(ends[-1] + n)
        ports = places({name: slice(row * n, (row + 1) * n) for row, name in enumerate(_OUTPUTS)})
        width = len(_OUTPUTS) * n
        return ArrayStage(width, ports, bind, frozenset(_NAMES), start=start, period=self._dt, early=early)
