"""From rest into a periodic motion and out of it: polynomials of degree five that keep the limits."""

import math
from collections.abc import Callable

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.types import FloatArray

LENGTHS = (0.5, 1.0, 2.0, 3.0, 5.0)
"""Lengths that are tried [s]."""
PLACES = 41
"""Positions of rest that are tried."""


def quintic(start: FloatArray, end: FloatArray, length: float, time: FloatArray) -> FloatArray:
    """(4, T) position, velocity, acceleration, jerk of the polynomial between two states (3,) in `length` [s]."""
    rows = np.concatenate([_powers(np.array([at]), order) for at in (0.0, length) for order in range(3)])
    weights = np.linalg.solve(rows, np.concatenate([start, end]))
    return np.stack([_powers(time, order) @ weights for order in range(4)])


def _powers(time: FloatArray, order: int) -> FloatArray:
    """(T, 6) derivatives of an order of 1, t, ..., t^5."""
    out = np.zeros((time.size, 6))
    for p in range(order, 6):
        out[:, p] = math.perm(p, order) * time ** (p - order)
    return out


def lead_in(
    state: FloatArray,
    limits: JointLimits,
    joint: str,
    torque: Callable[[FloatArray], FloatArray] | None = None,
) -> tuple[float, float]:
    """(position of rest [rad], length [s]) of the shortest polynomial from rest to a state (3,) within the limits.

    Run backwards with the velocity turned it leads from that state to rest.

    Args:
        state: Position, velocity and acceleration at its end.
        limits: That it keeps.
        joint: For the message.
        torque: (4, T) motion to the motor's torque (T,) [N m]; None where the torque has no limit.

    Raises:
        ParamsError: None of the lengths keeps the limits.
    """
    low, high = limits.position
    bounds = np.array([limits.velocity, limits.acceleration, limits.jerk])[:, None]
    for length in LENGTHS:
        time = np.linspace(0.0, length, 101)
        for rest in sorted(np.linspace(low, high, PLACES), key=lambda q: abs(q - state[0])):
            made = quintic(np.array([rest, 0.0, 0.0]), state, length, time)
            inside = low - 1e-9 <= made[0].min() and made[0].max() <= high + 1e-9
            if not inside or (np.abs(made[1:]) > bounds * (1.0 + 1e-9)).any():
                continue
            if torque is None or float(np.abs(torque(made)).max()) <= limits.torque * (1.0 + 1e-9):
                return float(rest), length
    raise ParamsError(
        f"joint {joint}: no lead-in of up to {LENGTHS[-1]:g} s from rest keeps the limits; raise the limit of the jerk "
        "or of the torque"
    )
