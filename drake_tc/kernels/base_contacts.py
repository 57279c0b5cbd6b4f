"""What contacts carry, which of them do, and which of those are left out because they slip."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.base_attitude import Attitude
from drake_tc.kernels.base_kinematics import Posture, external_wrench
from drake_tc.kernels.base_options import BREAK, FLAT, MAKE, MIDDLE, Options
from drake_tc.kernels.base_state import ON, Memory
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.vectors import dot, times_transposed
from drake_tc.types import GRAVITY, BoolArray, FloatArray

LEAST_LOAD = 1.0
"""Below which a load says nothing about a centre of pressure [N]."""
_LEAST_SHARE = 0.05
"""Of all load, that contacts which count must bear together."""


class Loads(NamedTuple):
    """What k contacts carry.

    Attributes:
        load: (k,) [N]. on: (k,) which carry load. new: (k,) since this tick. changed: Whether any is new or off.
        wrench: (k, 6) [f; t] at the contacts, their axes [N, N m]. up: (k, 3) the vertical in them.
        pressure: (k, 2) centres of pressure as measured [m].
    """

    load: FloatArray
    on: BoolArray
    new: BoolArray
    changed: bool
    wrench: FloatArray
    up: FloatArray
    pressure: FloatArray


@helper
def carries(load: float, was: float, make: float, break_: float, switch: float) -> bool:
    """Whether a contact carries load: hysteresis between break and make [N], or as `switch` says.

    Args:
        load: [N].
        was: 1 where it carried load before.
        make: Load above which contact is made [N].
        break_: Load below which it is lost [N].
        switch: 0 by the load, above held on, below held off.
    """
    if switch != 0.0:
        return switch > 0.0
    return load > (break_ if was else make)


@helper
def find_loads(
    soles: FloatArray,
    between: FloatArray,
    before: Memory,
    reading: FloatArray,
    switch: FloatArray,
    posture: Posture,
    pose: Attitude,
) -> Loads:
    """External wrenches at the contacts, and which of them touch.

    Args:
        soles: (k, w) rows of the contacts.
        between: (k, 54) what stands between sensor and contact.
        before: The state before the tick.
        reading: (6k,) of the sensors, after validation.
        switch: (k,) of `Readings`.
        posture: Contacts against the base.
        pose: Orientation.
    """
    k = soles.shape[0]
    load, on, new = np.empty(k), np.empty(k, dtype=np.bool_), np.empty(k, dtype=np.bool_)
    wrench, up, pressure = np.empty((k, 6)), np.empty((k, 3)), np.empty((k, 2))
    changed = False
    for i in range(k):
        up[i] = times_transposed(posture.rotation[i], pose.up)
        wrench[i] = external_wrench(between[i], reading[6 * i : 6 * i + 6], -GRAVITY * up[i])
        flat, was = soles[i, FLAT] > 0.0, before.contacts[i, ON]
        load[i] = wrench[i, 2] if flat else math.sqrt(dot(wrench[i, :3], wrench[i, :3]))
        on[i] = carries(load[i], was, soles[i, MAKE], soles[i, BREAK], switch[i])
        new[i] = on[i] and not was
        changed = changed or new[i] or not on[i]
        bearing = max(wrench[i, 2], LEAST_LOAD)
        if on[i] and flat:
            pressure[i, 0], pressure[i, 1] = -wrench[i, 4] / bearing, wrench[i, 3] / bearing
        else:
            pressure[i, 0], pressure[i, 1] = soles[i, MIDDLE], soles[i, MIDDLE + 1]
    return Loads(load, on, new, changed, wrench, up, pressure)


class Slip(NamedTuple):
    """What slipping contacts leave behind; k contacts.

    Attributes:
        drift: (k, 3) averaged velocity against the reference [m/s].
        dropped: (k,) ticks until a dropped contact counts again; 0 while it counts.
    """

    drift: FloatArray
    dropped: FloatArray


@helper
def slipping(
    on: BoolArray, new: BoolArray, load: FloatArray, against: FloatArray, before: Slip, options: Options
) -> Slip:
    """Drop the contact whose velocity is furthest from the others', and let it back when it has stood still.

    m[n+1] = m[n] + (d - m[n]) dt/slip_time with d (k, 3) the base velocity that a contact says, less the one that the
    last tick and the accelerometer say. At most one contact a tick is dropped, the one with the largest |m| above
    `slip_speed`, and never the last one: against the IMU alone it is more likely right. A dropped contact counts again
    after |m| < slip_speed/2 for `slip_hold`, or, as the most loaded one, when the others bear next to nothing: a foot
    in the air says nothing about a foot that stands.

    Args:
        on: (k,) which carry load.
        new: (k,) which do so since this tick.
        load: (k,) [N].
        against: (k, 3) d [m/s].
        before: After the last tick.
        options: Of the estimator.
    """
    k, hold = on.size, math.ceil(options.slip_hold / options.period)
    share = min(1.0, options.period / options.slip_time)
    drift, dropped, speed = np.zeros((k, 3)), np.zeros(k), np.zeros(k)
    worst, heaviest, counting = -1, -1, 0
    for i in range(k):
        if not on[i]:
            continue
        if not new[i]:
            drift[i] = before.drift[i] + share * (against[i] - before.drift[i])
            speed[i] = math.sqrt(dot(drift[i], drift[i]))
            if before.dropped[i] > 0.0:
                dropped[i] = before.dropped[i] - 1.0 if speed[i] < 0.5 * options.slip_speed else hold
        if heaviest < 0 or load[i] > load[heaviest]:
            heaviest = i
        if not dropped[i]:
            counting += 1
            if worst < 0 or speed[i] > speed[worst]:
                worst = i
    if counting > 1 and speed[worst] > options.slip_speed:
        dropped[worst] = hold
    bearing = total = 0.0
    for i in range(k):
        if on[i]:
            total += load[i]
            bearing += 0.0 if dropped[i] else load[i]
    if heaviest >= 0 and bearing < _LEAST_SHARE * total:
        dropped[heaviest] = 0.0
    return Slip(drift, dropped)
