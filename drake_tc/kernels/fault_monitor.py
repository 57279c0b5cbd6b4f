"""The flags of a tick, see `drake_tc.sensor_validation.fault_monitor`."""

from typing import Any

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, OUT_VECTOR, VECTOR, WHOLE, helper, kernel, together
from drake_tc.types import FloatArray

_MISSING, _FROZEN, _JUMP, _UNEXPECTED = range(4)
"""Flags of a sensor, counted from its first."""
_SPEED, _OFFSET, _JUMPED_BY, _RATE = range(4)
"""Rows of what is remembered of encoders."""
_ENCODER_FLAGS = 3


@helper
def encoder_jumps(
    displacement: float, ticks: float, bounds: tuple[float, ...], encoder: FloatArray, joint: int
) -> bool:
    """Whether a new reading that differs from the last new one comes from where its joint cannot be.

    Two bounds on the displacement between two readings, one on the speed and one on its change. With the displacement
    y = u[n] - s over the g ticks since the last new reading s, and the speed w [rad per tick] at the last reading that
    did not jump:

        speed     |y| <= g step + l |w|
        change    |x| <= g^2 change + g noise + l |w|,      x = y - g w

    With l > 0, the ticks by which readings may come early or late, a reading moves w by the share 1/(1 + l) only.

    A reading that exceeds one of the bounds has jumped, and its x (y, while w is unknown) is added to the offset o: how
    far the reading is from where its joint can be. Where the joint goes on at the speed of the jump, it was the joint
    that changed its speed, as in a collision, and x is taken out of o again.

    Args:
        displacement: y [rad].
        ticks: g.
        bounds: Largest step in one tick [rad], largest acceleration times the tick squared [rad], what noise and
            resolution of the readings add to it [rad], and l.
        encoder: (4, n) w, o, x and y/g of a jump one reading ago; NaN where unknown. Updated.
        joint: Its column.
    """
    (step, change, noise, timing), w = bounds, encoder[_SPEED, joint]
    rate, x = displacement / ticks, displacement - ticks * w
    known = abs(w) if np.isfinite(w) else 0.0
    possible = abs(displacement) <= ticks * step + timing * known
    goes_on = possible and abs(rate - encoder[_RATE, joint]) < abs(rate - w)
    sudden = abs(x) > ticks**2 * change + ticks * noise + timing * known
    if goes_on:
        encoder[_OFFSET, joint] -= encoder[_JUMPED_BY, joint]
    elif sudden or not possible:
        jumped_by = x if np.isfinite(w) else displacement
        encoder[_OFFSET, joint] += jumped_by
        encoder[_JUMPED_BY, joint], encoder[_RATE, joint] = jumped_by, rate
        return True
    encoder[_JUMPED_BY, joint] = encoder[_RATE, joint] = np.nan
    encoder[_SPEED, joint] = w + (rate - w) / (1.0 + timing) if np.isfinite(w) else rate
    return False


@kernel(together(VECTOR, VECTOR), together(MATRIX, INDEX, MATRIX, INDEX, WHOLE, VECTOR), OUT_VECTOR, OUT_VECTOR)
def raise_flags(
    seen: tuple[FloatArray, FloatArray], settings: tuple[Any, ...], memory: FloatArray, flags: FloatArray
) -> float:
    """One step of the recursion of `FaultMonitor`; the level of `any_fault`.

    Args:
        seen: (N + m - 6,) or (N + m,) raw channels [encoder; wrench; command; imu], then what is filtered besides the
            IMU; (n,) reference velocity [rad/s], zero where it is unknown.
        settings: (N, 2) largest step of each channel and ticks until it is frozen; (N,) first flag of its sensor;
            checks (m, 2): what is expected and by how much it may be missed, the last inputs being those that are
            filtered; (m,) the flag of each; channels before this one are wrong from a jump until they jump back;
            options: reference speed at which a joint must be seen to move [rad/s], for how many ticks it may hang then;
            largest acceleration of a joint times the tick squared [rad], noise of the encoders [rad]; 1 - exp(-dt/T)
            of the filters; ticks for which a flag stays up; the size from which a reading is missing; and by how many
            ticks positions may come early or late.
        memory: (4 N + 4 n + m + F,) last finite reading, ticks unchanged and ticks missing of each channel; of the
            encoders as in `encoder_jumps`; sum of the jumps of each channel; filtered errors; ticks left of each flag.
            Updated.
        flags: (F,) written.
    """
    (now, reference_velocity), (channels, flags_of_channels, checks, flags_of_checks, lasting, options) = seen, settings
    moving, stuck_ticks, largest_change, noise = options[0], options[1], options[2], options[3]
    blend, hold, largest = options[4], options[5], options[6]
    raw, n, m = channels.shape[0], reference_velocity.size, checks.shape[0]
    last, same, gap = memory[:raw], memory[raw : 2 * raw], memory[2 * raw : 3 * raw]
    at = 3 * raw + 4 * n
    encoder = memory[3 * raw : at].reshape(4, n)
    moved, error, left = memory[at : at + raw], memory[at + raw : at + raw + m], memory[at + raw + m :]
    for flag in range(flags.size):
        left[flag] = max(left[flag] - 1.0, 0.0)

    for j in range(raw):
        u, s, step, flag = now[j], last[j], channels[j, 0], flags_of_channels[j]
        encodes, changed = j < n, u - s
        finite = abs(u) < largest  # also False where u is NaN
        if encodes:
            ticks = max(gap[j], same[j]) + 1.0
            jump = finite and np.isfinite(changed) and changed != 0.0
            jump = jump and encoder_jumps(changed, ticks, (step, largest_change, noise, options[7]), encoder, j)
            jump = jump or abs(encoder[_OFFSET, j]) > min(step, largest_change + noise)
        else:
            jump = finite and abs(changed) > (gap[j] + 1.0) * step
            if j < lasting:
                if jump:
                    moved[j] += changed
                jump = jump or abs(moved[j]) > step
        same[j] = same[j] + 1.0 if u == s else 0.0
        stuck = encodes and abs(reference_velocity[j]) > moving and same[j] >= stuck_ticks
        if finite:
            last[j], gap[j] = u, 0.0
        else:
            left[flag + _MISSING] = hold
            gap[j] += 1.0
        if stuck or same[j] >= channels[j, 1]:
            left[flag + _FROZEN] = hold
        if jump:
            left[flag + _JUMP] = hold

    first = now.size - m
    for i in range(m):
        x = now[first + i] - checks[i, 0]
        if abs(x) < largest:
            error[i] += blend * (x - error[i])
        if abs(error[i]) > checks[i, 1]:
            left[flags_of_checks[i]] = hold

    level = 0.0
    for flag in range(flags.size):
        flags[flag] = 1.0 if left[flag] > 0.0 else 0.0
        if left[flag] > 0.0:
            level = max(level, 2.0 if flag < _ENCODER_FLAGS else 1.0)
    return level
