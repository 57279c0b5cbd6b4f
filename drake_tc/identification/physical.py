"""Results that no joint has: what they say is that the columns or their signs are not what the rig file says."""

from collections.abc import Mapping

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.types import FloatArray

Interval = tuple[float, float]


def require_physical(
    joint: str,
    parameters: Mapping[str, float],
    intervals: Mapping[str, Interval],
    velocity: FloatArray,
    direction: FloatArray,
) -> None:
    """Refuse a drive gain below zero, and friction that drives the joint.

    With the effort  K_tau tau + K_v v + K_c s  friction takes the power  mean(K_v v^2 + K_c v s) > 0. Either is
    refused only where the upper ends of the intervals are on the wrong side, too.

    Args:
        joint: For the message.
        parameters: K_tau, K_v, K_c, if the method has them.
        intervals: 95 % intervals of the same names.
        velocity: v (T,) [rad/s].
        direction: s (T,), the smoothed sign of v.

    Raises:
        IdentificationError: names the parameter, its interval, and what to look at.
    """
    if not {"K_tau", "K_v", "K_c"} <= set(intervals):
        return
    low, high = intervals["K_tau"]
    if high < 0.0:
        raise IdentificationError(
            f"{joint}: K_tau is {parameters['K_tau']:.4g} [{low:.4g}, {high:.4g}], and expected above 0: a load torque"
            " would pull the joint against itself; check the signs and the order of the columns"
        )
    powers = [np.mean(velocity**2), np.mean(velocity * direction)]
    friction = sum(float(power) * intervals[name][1] for name, power in zip(("K_v", "K_c"), powers, strict=True))
    if friction < 0.0:
        raise IdentificationError(
            f"{joint}: friction would drive the joint (K_v at most {intervals['K_v'][1]:.4g}, K_c at most"
            f" {intervals['K_c'][1]:.4g}); check the signs, the clocks and the order of the columns"
        )
