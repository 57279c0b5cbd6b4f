"""What a tick says about itself: the flags of `state.FLAGS` and `state.CONTACT_FLAGS`."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.estimation.base.state import BaseState
from drake_tc.estimation.base.valid_sample import ValidSample
from drake_tc.estimation.base.velocity_update import Loads, Motion, Setting
from drake_tc.types import FloatArray

_SETTLED = 0.1
"""How long a contact must have been in the air before its sensor should read nothing [s]."""
_UNLOADED = 0.25
"""Share of the load that ends a contact below which it is in the air, not on its way there."""
_AIR_TIME, _LOAD_TIME = 0.3, 1.0
"""Over which loads in the air, and the sum of loads, are averaged [s]."""


class StatusFlags(NamedTuple):
    """Flags, and the averages that some of them rest on.

    Attributes:
        flags: (9,). contact_flags: (k, 5).
        air_load: k means [N]. mismatch: [N].
    """

    flags: FloatArray
    contact_flags: FloatArray
    air_load: list[float]
    mismatch: float


def status_flags(
    setting: Setting,
    state: BaseState,
    sample: ValidSample,
    loads: Loads,
    motion: Motion,
    inconsistent: bool,
    foot_up: FloatArray,
    airborne: list[float],
    *,
    bias_up: float,
    weight: float,
) -> StatusFlags:
    """The flags after a tick.

    Args:
        setting: Worked out once.
        state: Before the tick.
        sample: Readings after validation.
        loads: What the contacts carry.
        motion: Of stage 1.
        inconsistent: Whether references were taken anew.
        foot_up: (k, 3) the vertical in the contacts' axes at touch-down.
        airborne: k ticks in the air.
        bias_up: Bias of the gyro about the vertical [rad/s].
        weight: Of the robot [N].
    """
    spec, soles, on, load = setting.spec, setting.soles, loads.on, loads.load
    dt = spec.period
    rows, air = [], []
    heaviest = 0.0
    soles_only = any(on)
    by_contact = zip(state.contacts.tolist(), on, motion.slip.dropped, load, airborne, soles.flat.tolist(), strict=True)
    steady = (loads.up * foot_up).sum(axis=1).tolist()
    for i, ((*_, mean), touches, dropped, force, ticks, flat) in enumerate(by_contact):
        unloaded = abs(force) < max(_UNLOADED * setting.limits[i][1], 3.0 * spec.force_offset)
        if unloaded and ticks * dt > _SETTLED and not sample.wrench_missing:
            mean += min(1.0, dt / _AIR_TIME) * (force - mean)
        air.append(mean)
        soles_only = soles_only and (flat > 0.0 or not touches)
        heaviest += force if flat else 0.0
        tilted = touches and flat > 0.0 and steady[i] < math.cos(spec.tilted)
        rows.append((touches, touches and motion.limited[i], dropped > 0.0, tilted, abs(mean) > spec.force_offset))
    mismatch = state.mismatch
    if soles_only and not sample.wrench_missing:
        mismatch += min(1.0, dt / _LOAD_TIME) * (heaviest - weight - mismatch)
    flags = (
        not any(on),
        sample.encoder_missing,
        sample.encoder_spike,
        sample.imu_missing,
        sample.wrench_missing,
        abs(bias_up) > spec.yaw_drift,
        abs(mismatch) > spec.force_offset,
        inconsistent,
        False,
    )
    return StatusFlags(np.array(flags, dtype=float), np.array(rows, dtype=float), air, mismatch)
