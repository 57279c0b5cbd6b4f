"""Contacts on soft soles: the point that stands still is not in the sole's surface, but on the floor above it.

See `drake_tc.estimation.base.velocity` for the shape g of a sole's table.
"""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.base_kinematics import Posture
from drake_tc.kernels.base_options import ORIGIN, STEP, STIFFNESS
from drake_tc.kernels.base_state import DROPPED, LOAD, ON, SHAPE, SINK, Memory
from drake_tc.kernels.compiling import helper
from drake_tc.kernels.vectors import cross, dot, times
from drake_tc.types import BoolArray, FloatArray

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
        sole: Row of the contact, see `base_options`.
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
def shown_vertical(soles: FloatArray, tables: FloatArray, posture: Posture, before: Memory) -> FloatArray:
    """(3,) the vertical in B that soft soles show on a level ground by where their loads are; zero where none does.

    A mean by load, of the last tick's loads and centres of pressure, of soles that no more than `_FLAT` bends.

    Args:
        soles: (k, w) rows of the contacts.
        tables: (k, m m).
        posture: Contacts against the base.
        before: The state before the tick.
    """
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
def sinking(
    soles: FloatArray,
    tables: FloatArray,
    posture: Posture,
    on: BoolArray,
    load: FloatArray,
    pressure: FloatArray,
    before: Memory,
    period: float,
) -> Sinking:
    """What soft soles do in one tick.

    Args:
        soles: (k, w) rows of the contacts.
        tables: (k, m m).
        posture: Contacts against the base, turning with it.
        on: (k,) which carry load.
        load: (k,) [N].
        pressure: (k, 2) centres of pressure as measured [m].
        before: The state before the tick.
        period: Of a tick [s].
    """
    k = soles.shape[0]
    depth, shape, back = np.zeros(k), np.zeros(k), np.zeros(k)
    position, velocity = posture.position.copy(), posture.velocity.copy()
    for i in range(k):
        if soles[i, STIFFNESS] <= 0.0 or not on[i]:
            continue
        row, rate, stiffness = before.contacts[i], 0.0, soles[i, STIFFNESS]
        shape[i] = shape_of(soles[i], tables[i], pressure[i, 0], pressure[i, 1])
        depth[i] = load[i] * shape[i] / stiffness
        if row[ON] and row[SHAPE]:
            back[i] = 0.25 * (load[i] + row[LOAD]) * (shape[i] - row[SHAPE]) / stiffness
            rate = (depth[i] - row[SINK] - back[i]) / period
        up = posture.rotation[i, :, 2].copy()
        position[i] += depth[i] * up
        velocity[i] += cross(posture.rate[i], depth[i] * up) + rate * up
    return Sinking(Posture(posture.rotation, position, posture.rate, velocity), depth, shape, back)
