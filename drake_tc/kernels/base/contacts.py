"""What contacts carry, which of them do, and which of those are left out because they slip.

Contacts on soft soles: the point that stands still is not in the sole's surface, but on the floor above it.

See `drake_tc.estimation.base_estimator` for the shape g of a sole's table.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.base.attitude import Attitude
from drake_tc.kernels.base.sample import (
    BREAK,
    FLAT,
    MAKE,
    MIDDLE,
    ORIGIN,
    STEP,
    STIFFNESS,
    Given,
    Options,
    Posture,
    external_wrench,
)
from drake_tc.kernels.base.state import DROPPED, LOAD, ON, SHAPE, SINK
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.linear_algebra import cross, dot, times, times_transposed
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
    given: Given, between: FloatArray, sensed: tuple[FloatArray, FloatArray], posture: Posture, pose: Attitude
) -> Loads:
    """External wrenches at the contacts, and which of them touch.

    Args:
        given: Beside the sample.
        between: (k, 54) what stands between sensor and contact.
        sensed: (6k,) of the sensors, after validation, and (k,) switches of `Readings`.
        posture: Contacts against the base.
        pose: Orientation.
    """
    soles, before, (reading, switch) = given.soles, given.before, sensed
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
def slipping(contacts: tuple[Any, ...], against: FloatArray, before: Slip, options: Options) -> Slip:
    """Drop the contact whose velocity is furthest from the others', and let it back when it has stood still.

    m[n+1] = m[n] + (d - m[n]) dt/slip_time with d (k, 3) the base velocity that a contact says, less the one that the
    last tick and the accelerometer say. At most one contact a tick is dropped, the one with the largest |m| above
    `slip_speed`, and never the last one: against the IMU alone it is more likely right. A dropped contact counts again
    after |m| < slip_speed/2 for `slip_hold`, or, as the most loaded one, when the others bear next to nothing: a foot
    in the air says nothing about a foot that stands.

    Args:
        contacts: (k,) which carry load, which do so since this tick, and how much [N].
        against: (k, 3) d [m/s].
        before: After the last tick.
        options: Of the estimator.
    """
    on, new, load = contacts
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


_FLAT = 2.0
"""g above which a sole is on its edge, and its tilt no longer sure [-]."""


@helper
def node(at: float, sole: FloatArray, axis: int, count: int) -> tuple[int, float]:
    """The node before a coordinate [m], and which share of a step it is beyond; of `count` nodes."""
    u = (at - sole[ORIGIN + axis]) / sole[STEP + axis]
    u = min(u, count - 1 - 1e-9) if u > 0.0 else 0.0  # 0 where it is NaN, too
    i = int(u)
    return i, u - i


@helper
def shape_of(sole: FloatArray, table: FloatArray, x: float, y: float) -> float:
    """G at a centre of pressure [m]; outside the sole, that of the nearest node.

    Args:
        sole: Row of the contact, see `base.sample`.
        table: (m m,) g at the nodes, first index along x.
        x: Of the centre of pressure [m].
        y: The same across [m].
    """
    count = round(math.sqrt(table.size))
    i, u = node(x, sole, 0, count)
    j, v = node(y, sole, 1, count)
    low, high = count * i + j, count * (i + 1) + j
    before: float = (1.0 - v) * table[low] + v * table[low + 1]
    after: float = (1.0 - v) * table[high] + v * table[high + 1]
    return (1.0 - u) * before + u * after


@helper
def tilt_of(sole: FloatArray, table: FloatArray, x: float, y: float, load: float) -> tuple[float, float]:
    """(a, b): under a load [N] the floor's normal in the sole's axes is (-a, -b, 1) [rad]; F dg/dc/(2K)."""
    u, v = sole[STEP], sole[STEP + 1]
    flat = load / (4.0 * sole[STIFFNESS])
    return (
        flat * (shape_of(sole, table, x + u, y) - shape_of(sole, table, x - u, y)) / u,
        flat * (shape_of(sole, table, x, y + v) - shape_of(sole, table, x, y - v)) / v,
    )


@helper
def shown_vertical(given: Given, posture: Posture) -> FloatArray:
    """(3,) the vertical in B that soft soles show on a level ground by where their loads are; zero where none does.

    A mean by load, of the last tick's loads and centres of pressure, of soles that no more than `_FLAT` bends.
    """
    soles, tables, before, _ = given
    total, found, normal = 0.0, np.zeros(3), np.ones(3)
    for i in range(soles.shape[0]):
        row = before.contacts[i]
        if soles[i, STIFFNESS] > 0.0 and row[ON] and not row[DROPPED] and 0.0 < row[SHAPE] < _FLAT:
            a, b = tilt_of(soles[i], tables[i], before.pressure[i, 0], before.pressure[i, 1], row[LOAD])
            normal[0], normal[1] = -a, -b
            total += row[LOAD]
            found += row[LOAD] * times(posture.rotation[i], normal)
    return found / math.sqrt(dot(found, found)) if total > 0.0 else np.zeros(3)


class Sinking(NamedTuple):
    """How far k soles give way at their centres of pressure.

    Attributes:
        posture: With the contacts' origins moved up by the sink, in the floor, and at the speed of the material there.
        depth: (k,) sinks s [m]. shape: (k,) shapes g [-].
        back: (k,) along the contacts' z, how far the floor is from where the centre of pressure moved in the sole,
            since the last tick [m].
    """

    posture: Posture
    depth: FloatArray
    shape: FloatArray
    back: FloatArray


@helper
def sinking(given: Given, posture: Posture, loads: Loads) -> Sinking:
    """What soft soles do in one tick.

    Args:
        given: Beside the sample.
        posture: Contacts against the base, turning with it.
        loads: What the contacts carry.
    """
    soles, tables, before, options = given
    load, pressure = loads.load, loads.pressure
    k = soles.shape[0]
    depth, shape, back = np.zeros(k), np.zeros(k), np.zeros(k)
    position, velocity = posture.position.copy(), posture.velocity.copy()
    for i in range(k):
        if soles[i, STIFFNESS] <= 0.0 or not loads.on[i]:
            continue
        row, rate, stiffness = before.contacts[i], 0.0, soles[i, STIFFNESS]
        shape[i] = shape_of(soles[i], tables[i], pressure[i, 0], pressure[i, 1])
        depth[i] = load[i] * shape[i] / stiffness
        if row[ON] and row[SHAPE]:
            back[i] = 0.25 * (load[i] + row[LOAD]) * (shape[i] - row[SHAPE]) / stiffness
            rate = (depth[i] - row[SINK] - back[i]) / options.period
        up = posture.rotation[i, :, 2].copy()
        position[i] += depth[i] * up
        velocity[i] += cross(posture.rate[i], depth[i] * up) + rate * up
    return Sinking(Posture(posture.rotation, position, posture.rate, velocity), depth, shape, back)


class Stance(NamedTuple):
    """What a tick knows before it looks for the base: how it stands.

    Attributes:
        pose: Orientation.
        loads: What the contacts carry.
        sunk: How soft soles give way; with the contacts against the base.
    """

    pose: Attitude
    loads: Loads
    sunk: Sinking
