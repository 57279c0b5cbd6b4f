"""What a torque on a slower clock than the log's leaves in the balance: jumps whose instants it does not tell.

A torque that is sampled every T_s and interpolated between turns a jump by A into a ramp over one T_s. The jump itself
lies a time u from the middle of the ramp, with u anywhere within +-T_s/2. Through both filters k (1/s), which are wide
against T_s, a row at t errs by A u k(t - t_A), of the variance

    s^2(t) = (T_s^2/12) sum_A A^2 k(t - t_A)^2.

If the jumps recur at the samples' own rhythm, u is the same at each of them, so the error looks like an effect that
acts at jumps: a saturation, a payload, a delay. It is noise of unknown sign none the less.

Where the torque jumps is read from the torque. With x its interpolated curve and h = T_s/2,

    D(t) = d(t) - (d(t - T_s) + d(t + T_s))/2,    d(t) = x(t + h) - x(t - h)

is near 0 of a smooth curve, and the integral of D^2 over time is 2/3 A^2 T_s for a jump by A. Values that the noise of
the torque explains are no jumps.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import oaconvolve

from drake_tc.types import FloatArray

OF_A_JUMP = 2.0 / 3.0
"""Integral of D^2 over time, over A^2 T_s."""
BEYOND_NOISE = 5.0
"""Standard deviations of D from which on it is a jump."""
DEVIATION_OF_MEDIAN = 1.4826
"""Standard deviation over the median magnitude, of a normal distribution."""


def jumps_squared(torque: FloatArray, ratio: float) -> FloatArray:
    """(T,) A^2 spread over the samples near each jump: its sum over them is the sum of A^2 over the jumps.

    Args:
        torque: (T,) of one stretch, interpolated between the samples of a slower clock [N m].
        ratio: T_s over the period of the log.
    """
    at = np.arange(torque.size, dtype=np.float64)
    steps = [
        np.interp(at + (shift + 0.5) * ratio, at, torque) - np.interp(at + (shift - 0.5) * ratio, at, torque)
        for shift in (-1.0, 0.0, 1.0)
    ]
    jump = steps[1] - (steps[0] + steps[2]) / 2.0
    noise = DEVIATION_OF_MEDIAN * float(np.median(np.abs(jump)))
    return np.where(np.abs(jump) > BEYOND_NOISE * noise, jump**2 / (OF_A_JUMP * ratio), 0.0)


def between_samples(
    torque: FloatArray, segments: Sequence[slice], ratios: Sequence[float], weights: FloatArray
) -> FloatArray:
    """(T,) variances s^2 of what a torque lacks between its samples, after the filters [N m]^2.

    Args:
        torque: (T,) interpolated between its samples [N m].
        segments: Uniform stretches.
        ratios: Of each stretch, T_s over the period of the log; 1 where the torque has the clock of the log.
        weights: Of both filters together, an odd number that sums to 1.
    """
    jumps = np.zeros(torque.size)
    for segment, ratio in zip(segments, ratios, strict=True):
        if ratio > 1.0:
            jumps[segment] = ratio**2 / 12.0 * jumps_squared(torque[segment], ratio)
    passed = oaconvolve(np.pad(jumps, weights.size // 2), weights**2, mode="valid")
    return np.asarray(np.maximum(passed, 0.0))
