"""Results that no joint has: what they say is that the columns, signs or runs are not what the rig file says."""

from collections.abc import Mapping

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.types import FloatArray

Interval = tuple[float, float]

MOST_APART = 2.0
"""Factor between the drive gains of two runs of one joint."""


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


def require_alike_runs(joint: str, gains: Mapping[str, Interval | None]) -> None:
    """Refuse runs of which the intervals of K_tau are more than a factor of two apart.

    A drive's gain does not change between runs; friction and loads do, and are not compared.

    Args:
        joint: For the message.
        gains: Name of the run to its interval; None where it cannot tell.

    Raises:
        IdentificationError: names the two runs that are farthest apart.
    """
    known = {name: gain for name, gain in gains.items() if gain is not None and gain[0] > 0.0}
    if len(known) < 2:
        return
    lowest = min(known, key=lambda name: known[name][1])
    highest = max(known, key=lambda name: known[name][0])
    if known[highest][0] > MOST_APART * known[lowest][1]:
        shown = " and ".join(f"[{known[n][0]:.4g}, {known[n][1]:.4g}] in {n}" for n in (lowest, highest))
        raise IdentificationError(
            f"{joint}: the runs are not of one joint: K_tau is {shown}; leave out the run of another joint, drive or"
            " setting"
        )
