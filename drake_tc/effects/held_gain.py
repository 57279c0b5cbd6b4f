"""Effects that scale the load torque, where the drive gain is declared.

A torque sensor that reads tau_meas = (1 + g) tau leaves of the balance y/K = tau + J qddot + tau_f

    tau_meas + J qddot = (1 + g) y/K - g J qddot - (1 + g) tau_f
    tau_meas + J qddot = y/K - tau_f + s tau_meas,                    s = g/(1 + g)

A fit with a free drive gain takes (1 + g)/K for 1/K, and g shows in the column J qddot alone. A fit that holds the
drive at the declared gain K_0 = K leaves (1 + g) y/K no place: the coefficient is s, and its column -tau_meas. The
effort is in neither, so that both hold for whatever delays and limits the drive has.
"""

from collections.abc import Mapping

import numpy as np

from drake_tc.effects.context import Context
from drake_tc.effects.signals import Signals
from drake_tc.types import FloatArray

HELD_GAIN = "held_gain"
"""Entry of the shape of such an effect: the gain K_0 that fits hold [effort/(N m)], or 0. It is no parameter."""


def held_gain(context: Context) -> dict[str, float]:
    """The shape of an effect that scales the balance: the gain that fits hold, or 0.

    An unknown load and fitted links take the scale themselves, so that no gain is held against them.
    """
    declared = context.declared.get("drive_gain") or 0.0
    return {HELD_GAIN: 0.0 if context.load in ("links", "unknown") else float(declared)}


def scale_column(signals: Signals, shape: Mapping[str, float]) -> FloatArray:
    """(T,) torque per unit of g or s [N m]: J qddot, or -tau where the drive is held at K_0."""
    if is_held(shape):
        return np.asarray(-signals.load_torque)
    return signals.rotor_inertia * signals.acceleration


def is_held(shape: Mapping[str, float]) -> bool:
    """Whether the drive is held at a gain."""
    return shape.get(HELD_GAIN, 0.0) > 0.0
