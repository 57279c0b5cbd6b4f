"""What a wave of the encoder's reading leaves in a joint's balance."""

import numpy as np

from drake_tc.effects.base import Signals
from drake_tc.types import FloatArray


def encoder_wave(signals: Signals, cycles: float) -> FloatArray:
    """Columns (T, 2) of e_s and e_c in q_meas = q + e_s sin(n q) + e_c cos(n q), to first order in the error.

    The error e enters all that is computed from the position: the balance misses J e_ddot + F_v e_dot + (d tau/dq) e,
    where J has the inertia of a load that is computed from the position, and d tau/dq is that load's slope.

    Args:
        signals: Of the log.
        cycles: n, waves a turn.
    """
    q, v, a = signals.position, signals.velocity, signals.acceleration
    sine, cosine = np.sin(cycles * q), np.cos(cycles * q)
    inertia, viscous, slope = signals.rotor_inertia + signals.link_inertia, signals.viscous, signals.load_slope
    fast = (cycles * v) ** 2
    of_sine = inertia * (cycles * a * cosine - fast * sine) + viscous * cycles * v * cosine + slope * sine
    of_cosine = -inertia * (cycles * a * sine + fast * cosine) - viscous * cycles * v * sine + slope * cosine
    return -np.stack([of_sine, of_cosine], axis=-1)
