"""Whether what is left of a position servo's effort may come from the instants at which its command was sampled.

A command that is up to half a sampling period T older or younger than the model takes it to be makes an error of up to
T/2 |dq_d/dt|. Where two clocks drift against each other, the error wanders between these bounds.
"""

import numpy as np

from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.thresholds import HELD_FROM_PERIOD, MOST_WHERE_SLOW, ResidualThresholds


def may_be_age_of_command(split: DataSplit, floor: float) -> bool:
    """Whether all but noise of the residual lies within +-T/2 |dq_d/dt|, and most of it where the command is fast.

    Args:
        split: Rows of a position servo, from runs that took no part in the fit.
        floor: Noise floor [rad].
    """
    samples, left = split.samples, np.abs(split.after)
    period = samples.signals.period
    if period < HELD_FROM_PERIOD or left.size == 0:
        return False
    rate = np.zeros(len(samples.signals))
    for segment in samples.segments:
        rate[segment] = np.gradient(samples.signals.command[segment], period)
    speed = np.abs(samples.reduce(rate))
    beyond = np.maximum(left - 0.5 * period * speed, 0.0)
    slow = speed <= np.median(speed)
    share = float(np.sum(left[slow] ** 2) / max(np.sum(left**2), 1e-300))
    return rms(beyond) <= ResidualThresholds().least_floors * floor and share <= MOST_WHERE_SLOW
