"""The law of the CommandGuard: bumpless start, limits, hold, damp; one tick as a plain function of state and inputs."""

from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import GUARD, KernelCall
from drake_tc.kernels.lazy import Kernel
from drake_tc.types import FloatArray

_STEP = Kernel("guard", "step")


class GuardMode(IntEnum):
    """What the guard is doing."""

    START = 0
    NORMAL = 1
    HOLD = 2
    DAMP = 3


@dataclass(frozen=True)
class GuardSpec:
    """Limits and times of the guard.

    Attributes:
        offset_limit: |q_d - q| of a position servo, |y| of other drives; one number or one a joint, > 0
            [rad | A | V | N m].
        rate_limit: Of the command, likewise, > 0 [1/s]. At least what the joint itself can do, or the command cannot
            follow a joint that is pushed.
        start_time: From the position at the first tick to the incoming command [s].
        start_rate: A servo's command is no faster than this until it has met the incoming one, at the start as after a
            fault, while which the reference may have gone on, > 0 [rad/s]. Other drives take `rate_limit`.
        hold_time: How long the last safe command is held after a fault [s].
        damp_time: Time constant with which the command then goes to the position (to 0 for other drives), > 0 [s].
            The drive feels like a damper of Kd = damp_time/K_tau.
        damp_rate: And its largest rate, > 0 [1/s].
        recover_time: How long inputs must be sound before they count again [s].
        blend_time: From the held to the incoming command, then [s].

    Raises:
        ParamsError: a number that is not possible.

    Example:
        >>> TorqueLoopSpec(guard=GuardSpec(offset_limit=0.1)).guard.offset_limit
        0.1
    """

    offset_limit: float | tuple[float, ...] = 0.2
    rate_limit: float | tuple[float, ...] = 20.0
    start_time: float = 0.5
    start_rate: float = 1.0
    hold_time: float = 0.1
    damp_time: float = 0.1
    damp_rate: float = 0.5
    recover_time: float = 0.02
    blend_time: float = 0.1

    def __post_init__(self) -> None:
        for part in fields(self):
            value = np.asarray(getattr(self, part.name), dtype=np.float64)
            strict = not part.name.endswith("_time") or part.name == "damp_time"
            if not np.all(np.isfinite(value) & ((value > 0.0) if strict else (value >= 0.0))):
                bound = "> 0" if strict else ">= 0"
                raise ParamsError(
                    f"guard.{part.name}: expected finite numbers {bound}, got {getattr(self, part.name)!r}"
                )


class GuardLaw:
    """x[n+1] = step(x[n], command, position, fault): see `drake_tc.control.guard.CommandGuard`. Holds no changing data.

    x = [y (n), last finite position (n), anchor (n), mode, time in hold and damp, time sound, s, 1/T], 1/T = 0 before
    the first tick; in normal mode the anchor is the y before the last.
    """

    def __init__(self, size: int, dt: float, spec: GuardSpec, servo: tuple[bool, ...] | None = None) -> None:
        """Spread the limits over the joints.

        Raises:
            ParamsError: sizes that do not agree.
        """
        flags = (True,) * size if servo is None else tuple(servo)
        if len(flags) != size:
            raise ParamsError(f"servo: expected {size} flags, one a joint, got {len(flags)}")
        self._size = size
        step = dt * self._spread("rate_limit", spec.rate_limit)
        start_step = np.where(flags, np.minimum(step, dt * spec.start_rate), step)
        offset, servos = self._spread("offset_limit", spec.offset_limit), np.array(flags, dtype=np.float64)
        self._limits: FloatArray = np.stack([offset, step, start_step, servos])
        times = (spec.start_time, spec.hold_time, spec.damp_time, spec.damp_rate, spec.recover_time, spec.blend_time)
        self._options = np.array([dt, *times])

    def _spread(self, name: str, value: float | tuple[float, ...]) -> FloatArray:
        array = np.asarray(value, dtype=np.float64)
        if array.shape not in ((), (self._size,)):
            raise ParamsError(f"guard.{name}: expected one number or {self._size}, got {array.size}")
        return np.full(self._size, array)

    def initial(self) -> FloatArray:
        """State before the first tick."""
        return np.append(np.zeros(3 * self._size), [float(GuardMode.HOLD), 0.0, 0.0, 0.0, 0.0])

    def step(
        self, state: FloatArray, command: FloatArray, position: FloatArray, fault: float, after: FloatArray
    ) -> None:
        """One tick: the next state into `after`, whose first n numbers are the outgoing command."""
        _STEP(state, command, position, fault, self._limits, self._options, after)

    def bind(
        self, state: FloatArray, command: FloatArray, position: FloatArray, fault: FloatArray, after: FloatArray
    ) -> KernelCall:
        """`step` on arrays that stay the same objects, as a function of the time [s]; fault (1,)."""

        def outputs(time: float) -> None:
            self.step(state, command, position, fault[0], after)

        return KernelCall(GUARD, outputs, state, command, position, fault, self._limits, self._options, after)
