"""One tick of the command guard, see `drake_tc.control.guard`."""

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_VECTOR, REAL, VECTOR, helper, kernel, together
from drake_tc.types import FloatArray

LARGEST = 1e6
"""Commands and positions that sum to more than this [rad | A | V | N m] count as not finite."""
UNTRUSTED = 1.5
"""From here on `fault` says that the positions are wrong, finite as they may be."""
_START, _NORMAL, _HOLD, _DAMP = 0.0, 1.0, 2.0, 3.0
"""Values of `GuardMode`."""
_OFFSET, _STEP, _START_STEP, _SERVO = range(4)
"""Rows of `limits`."""
COMPLETE = 1.0 - 1e-9
"""Share of a blend from which it has ended."""


@helper
def limited(wish: float, rest: float, last: float, offset: float, step: float) -> float:
    """y[n] of one joint near rest, and within a step of y[n-1]."""
    near = min(max(wish, rest - offset), rest + offset)
    return min(max(near, last - step), last + step)


@helper
def waiting(mode: float, waited: float, sound_for: float, sound: bool, options: FloatArray) -> tuple[float, ...]:
    """(mode, time in hold and damp, time sound) of a tick that is not sound, or follows one too closely."""
    dt, hold_time, recover_time = options[0], options[2], options[5]
    if mode < _HOLD:
        waited = 0.0
    sound_for = sound_for + dt if sound else 0.0
    if sound and sound_for >= recover_time - 0.5 * dt:
        return _START, 0.0, 0.0
    waited += dt
    return (_DAMP if waited > hold_time + 0.5 * dt else _HOLD), waited, sound_for


@helper
def blended(anchor: float, command: float, s: float) -> float:
    """From the anchor to the command as s goes from 0 to 1."""
    return anchor + s * s * (3.0 - 2.0 * s) * (command - anchor) if s < COMPLETE else command


@helper
def damping(away: float, options: FloatArray) -> float:
    """Step towards rest, which is `away`."""
    dt, damp_time, largest = options[0], options[3], options[4] * options[0]
    move: float = min(max(away * (dt / max(damp_time, dt)), -largest), largest)
    return move


@kernel(VECTOR, together(VECTOR, VECTOR, REAL), MATRIX, VECTOR, OUT_VECTOR)
def step(
    state: FloatArray,
    given: tuple[FloatArray, FloatArray, float],
    limits: FloatArray,
    options: FloatArray,
    after: FloatArray,
) -> None:
    """x[n+1] of `CommandGuard`, whose first n numbers are the outgoing command.

    Args:
        state: (3n + 5,) [y; last finite position; anchor; mode, time in hold and damp, time sound, s, 1/T]; in normal
            mode the anchor is the y before the last. 1/T = 0 before the first tick.
        given: (n,) command; (n,) position; fault as the port.
        limits: (4, n) offset limit, largest step, that of the start, and 1 for a position servo, 0 for another drive.
        options: dt, then start, hold and damp time, damp rate, recover and blend time.
        after: (3n + 5,) written.
    """
    command, position, fault = given
    n = command.shape[0]
    mode, waited, sound_for, s, rate = (
        state[3 * n],
        state[3 * n + 1],
        state[3 * n + 2],
        state[3 * n + 3],
        state[3 * n + 4],
    )
    size = 0.0
    for i in range(n):
        size += abs(command[i]) + abs(position[i])
    sound = size <= LARGEST and -0.5 < fault < 0.5
    last, anchor, rest, known = state[:n].copy(), state[2 * n : 3 * n].copy(), np.empty(n), np.empty(n, dtype=np.bool_)
    lost = False
    for i in range(n):
        known[i] = sound or (abs(position[i]) <= LARGEST and not fault >= UNTRUSTED)
        here = position[i] if known[i] else state[n + i]
        lost = lost or not (known[i] or limits[_SERVO, i] == 0.0)
        rest[i] = here * limits[_SERVO, i]
        after[n + i] = here
    if rate == 0.0:
        if lost:
            after[:n], after[2 * n :] = state[:n], state[2 * n :]
            return
        last[:], anchor[:] = rest, rest
        mode, rate = _START, 1.0 / max(options[1], options[0])
    was = mode
    if not sound or mode >= _HOLD:
        mode, waited, sound_for = waiting(mode, waited, sound_for, sound, options)
        if mode == _START:
            anchor[:] = last
            s, rate = 0.0, 1.0 / max(options[6], options[0])
    if mode == _START:
        s = min(s + options[0] * rate, 1.0)
    met = s >= COMPLETE
    for i in range(n):
        wish, largest, offset = command[i], limits[_STEP, i], limits[_OFFSET, i]
        if mode == _START:
            largest = limits[_START_STEP, i]
            wish = blended(anchor[i], command[i], s)
            near = min(max(wish, rest[i] - offset), rest[i] + offset)
            met = met and abs(near - last[i]) <= largest
        elif mode == _HOLD:
            wish = anchor[i] if was == _NORMAL else last[i]
        elif mode == _DAMP:
            wish = last[i] + (damping(rest[i] - last[i], options) if known[i] else 0.0)
        after[i] = limited(wish, rest[i], last[i], offset, largest)
    if mode == _START and met:
        mode = _NORMAL
    after[2 * n : 3 * n] = last if mode == _NORMAL else anchor
    after[3 * n], after[3 * n + 1], after[3 * n + 2], after[3 * n + 3], after[3 * n + 4] = (
        mode,
        waited,
        sound_for,
        s,
        rate,
    )
