"""Contacts on soft soles: the point that stands still is not in the sole's surface, but on the floor above it."""

from typing import NamedTuple

import numpy as np

from drake_tc.estimation.base.kinematics import Posture, skews
from drake_tc.estimation.base.soft_sole import SoftSole
from drake_tc.estimation.base.state import BaseState
from drake_tc.types import FloatArray

_FLAT = 2.0
"""g above which a sole is on its edge, and its tilt no longer sure [-]."""


class Sinking(NamedTuple):
    """How far k soles give way at their centres of pressure.

    Attributes:
        posture: With the contacts' origins moved up by the sink, in the floor, and at the speed of the material there.
        depth: k sinks s [m]. shape: k shapes g [-].
        back: (k,) along the contacts' z, how far the floor is from where the centre of pressure moved in the sole,
            since the last tick [m].
    """

    posture: Posture
    depth: list[float]
    shape: list[float]
    back: FloatArray


def shown_vertical(soles: list[SoftSole | None], posture: Posture, state: BaseState) -> FloatArray | None:
    """(3,) the vertical in B that soft soles show on a level ground by where their loads are; None where none does.

    A mean by load, of the last tick's loads and centres of pressure, of soles that no more than `_FLAT` bends.

    Args:
        soles: k of them.
        posture: Contacts against the base.
        state: Before the tick.
    """
    total, found = 0.0, np.zeros(3)
    rows = zip(soles, state.contacts.tolist(), state.pressure.tolist(), strict=True)
    for i, (sole, (on, load, dropped, _, _, shape, *_), (x, y)) in enumerate(rows):
        if sole is not None and on and not dropped and 0.0 < shape < _FLAT:
            a, b = sole.tilt(x, y, load)
            total += load
            found += load * (posture.rotation[i] @ np.array([-a, -b, 1.0]))
    if not total > 0.0:
        return None
    up: FloatArray = found / np.sqrt(found @ found)
    return up


def sinking(
    soles: list[SoftSole | None],
    posture: Posture,
    on: list[bool],
    load: list[float],
    pressure: list[tuple[float, float]],
    state: BaseState,
    period: float,
) -> Sinking:
    """What soft soles do in one tick.

    Args:
        soles: k of them.
        posture: Contacts against the base, turning with it.
        on: Which carry load.
        load: [N].
        pressure: Centres of pressure as measured [m].
        state: Before the tick.
        period: Of a tick [s].
    """
    depths, shapes, backs, rates = [], [], [], []
    rows = zip(soles, on, load, pressure, state.contacts.tolist(), strict=True)
    for sole, touches, force, (x, y), (before, force_before, _, _, depth_before, shape_before, *_) in rows:
        depth = shape = back = rate = 0.0
        if sole is not None and touches:
            shape = sole.shape(x, y)
            depth = force * shape / sole.stiffness
            if before and shape_before:
                back = 0.25 * (force + force_before) * (shape - shape_before) / sole.stiffness
                rate = (depth - depth_before - back) / period
        depths.append(depth)
        shapes.append(shape)
        backs.append(back)
        rates.append(rate)
    up = posture.rotation[:-1, :, 2]
    lift = up * np.array(depths)[:, None]
    position, velocity = posture.position.copy(), posture.velocity.copy()
    position[:-1] += lift
    velocity[:-1] += (skews(posture.rate[:-1]) @ lift[:, :, None])[:, :, 0] + up * np.array(rates)[:, None]
    moved = posture._replace(position=position, velocity=velocity)
    return Sinking(moved, depths, shapes, np.array(backs))
