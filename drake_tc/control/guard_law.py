"""The law of the CommandGuard: bumpless start, limits, hold, damp; one tick as a plain function of state and inputs."""

from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.types import BoolArray, FloatArray

LARGEST = 1e6
"""Commands and positions that sum to more than this [rad | A | V | N m] count as not finite."""
UNTRUSTED = 1.5
"""From here on `fault` says that the positions are wrong, finite as they may be."""


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
        self._size, self._dt, self._spec = size, dt, spec
        self._servo = np.array(flags, dtype=np.float64)
        self._all_servo = all(flags)
        self._offset = self._spread("offset_limit", spec.offset_limit)
        self._step = dt * self._spread("rate_limit", spec.rate_limit)
        self._offsets, self._steps = self._offset.tolist(), self._step.tolist()
        self._start_step = np.where(flags, np.minimum(self._step, dt * spec.start_rate), self._step)

    def _spread(self, name: str, value: float | tuple[float, ...]) -> FloatArray:
        array = np.asarray(value, dtype=np.float64)
        if array.shape not in ((), (self._size,)):
            raise ParamsError(f"guard.{name}: expected one number or {self._size}, got {array.size}")
        return np.full(self._size, array)

    def initial(self) -> FloatArray:
        """State before the first tick."""
        return np.append(np.zeros(3 * self._size), [float(GuardMode.HOLD), 0.0, 0.0, 0.0, 0.0])

    def step(self, state: FloatArray, command: FloatArray, position: FloatArray, fault: float) -> FloatArray:
        """One tick: the next state; its first n numbers are the outgoing command."""
        n = self._size
        values, commands, positions = state.tolist(), command.tolist(), position.tolist()
        mode, waited, sound_for, s, rate = values[3 * n :]
        size = sum(map(abs, commands)) + sum(map(abs, positions))  # as floats: no warning, NaN stays
        sound = size <= LARGEST and -0.5 < fault < 0.5
        if sound and mode == GuardMode.NORMAL:
            last_y = values[:n]
            y = map(_limited, commands, self._resting(positions), last_y, self._offsets, self._steps)
            return np.array([*y, *positions, *last_y, *values[3 * n :]])
        last, anchor = state[:n], state[2 * n : 3 * n]
        after = state.copy()
        known = None if sound else (np.abs(position) <= LARGEST) & (not fault >= UNTRUSTED)
        here = position if known is None else np.where(known, position, state[n : 2 * n])
        after[n : 2 * n] = here
        rest = here if self._all_servo else here * self._servo
        if rate == 0.0:
            if known is not None and not np.all(known | (self._servo == 0.0)):
                return after
            last = anchor = rest
            mode, rate = GuardMode.START, 1.0 / max(self._spec.start_time, self._dt)
        was = mode
        if not sound or mode >= GuardMode.HOLD:
            mode, waited, sound_for = self._wait(mode, waited, sound_for, sound=sound)
            if mode == GuardMode.START:
                anchor, s, rate = last, 0.0, 1.0 / max(self._spec.blend_time, self._dt)
        wish, step = command, self._step
        if mode == GuardMode.START:
            step = self._start_step
            s = min(s + self._dt * rate, 1.0)
            if s < 1.0 - 1e-9:
                wish = anchor + s * s * (3.0 - 2.0 * s) * (command - anchor)
        elif mode == GuardMode.HOLD:
            wish = anchor if was == GuardMode.NORMAL else last
        elif mode == GuardMode.DAMP:
            wish = last + self._damping(rest - last, known)
        after[:n] = list(map(_limited, wish.tolist(), rest.tolist(), last.tolist(), self._offsets, step.tolist()))
        if mode == GuardMode.START and s >= 1.0 - 1e-9 and np.all(np.abs(self._near(wish, rest) - last) <= step):
            mode = GuardMode.NORMAL
        after[2 * n : 3 * n] = last if mode == GuardMode.NORMAL else anchor
        after[3 * n :] = mode, waited, sound_for, s, rate
        return after

    def _near(self, wish: FloatArray, rest: FloatArray) -> FloatArray:
        """clip(wish, r - D, r + D)."""
        return np.minimum(np.maximum(wish, rest - self._offset), rest + self._offset)

    def _resting(self, positions: list[float]) -> list[float]:
        """r: the position for a servo, 0 for other drives."""
        if self._all_servo:
            return positions
        return [q * servo for q, servo in zip(positions, self._servo.tolist(), strict=True)]

    def _wait(self, mode: float, waited: float, sound_for: float, *, sound: bool) -> tuple[float, float, float]:
        """(mode, time in hold and damp, time sound) of a tick that is not sound, or follows one too closely."""
        half = 0.5 * self._dt
        if mode < GuardMode.HOLD:
            waited = 0.0
        sound_for = sound_for + self._dt if sound else 0.0
        if sound and sound_for >= self._spec.recover_time - half:
            return GuardMode.START, 0.0, 0.0
        waited += self._dt
        return (GuardMode.DAMP if waited > self._spec.hold_time + half else GuardMode.HOLD), waited, sound_for

    def _damping(self, away: FloatArray, known: BoolArray | None) -> FloatArray:
        """Step towards rest; none where the position is lost."""
        spec = self._spec
        largest = spec.damp_rate * self._dt
        move = np.clip(away * (self._dt / max(spec.damp_time, self._dt)), -largest, largest)
        return np.asarray(move if known is None else np.where(known, move, 0.0))


def _limited(wish: float, rest: float, last: float, offset: float, step: float) -> float:
    """y[n] of one joint near rest, and within a step of y[n-1]; plain floats, as arrays of a few joints cost more."""
    low, high = rest - offset, rest + offset
    near = low if wish < low else high if wish > high else wish
    low, high = last - step, last + step
    return low if near < low else high if near > high else near
