"""What scatter of the sampling instants leaves in the balance: noise that is as large as the joint is fast.

Positions that are sampled at t_k + delta_k err by qdot_k delta_k. Through the filters of acceleration and velocity,
with the momentum p = M qdot of links that a robot's model gives, row i of the balance errs by

    n_i = sum_m delta_m (J k''_(i-m) qdot_m + l''_(i-m) p_m + F_v k'_(i-m) qdot_m)

whose variance is that of independent delta_m. Effort and load are sampled with the position and err with it; what they
add is small beside the differentiated position, and partly cancels: it is left out.
"""

from collections.abc import Sequence

import numpy as np
from scipy.signal import oaconvolve

from drake_tc.diagnosis.data.channels import Channels
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.types import FloatArray, IntArray

Part = tuple[FloatArray, FloatArray]
"""Values (T,) that the scatter multiplies, and the weights of an odd number of samples through which they pass."""


def timing_moments(scatter: float, parts: Sequence[Part], rows: IntArray) -> FloatArray:
    """(N, n, n) second moments of sum_m delta_m w_(i-m) x_m on the rows (N,), for n parts (x, w).

    Args:
        scatter: Standard deviation of delta [s].
        parts: Of one uniform clock.
        rows: Where.
    """
    longest = max(weights.size for _, weights in parts)
    padded = [(x, np.pad(w, (longest - w.size) // 2)) for x, w in parts]
    out = np.zeros((rows.size, len(parts), len(parts)))
    for a, (x, w) in enumerate(padded):
        for b, (y, u) in enumerate(padded[: a + 1]):
            passed = oaconvolve(np.pad(x * y, longest // 2), w * u, mode="valid")
            out[:, a, b] = out[:, b, a] = scatter**2 * passed[rows]
    return out


def timing_of_rows(
    scatter: float, channels: Channels, light: CommonKernel, final: CommonKernel, velocity: FloatArray, rows: IntArray
) -> FloatArray:
    """(N, 3, 3) moments of what passes the inertia, the viscous friction and the links, of rows of a joint's channels.

    Runs with `acceleration_weights` have accelerations and loads that passed these weights before the light kernel.

    Args:
        scatter: Standard deviation of the sampling instants [s].
        channels: Of the joint; their `momentum` is that of the links [N m s], nil where there is none.
        light: First kernel.
        final: Second kernel.
        velocity: (T,) [rad/s].
        rows: (N,) of T.
    """
    momentum = np.nan_to_num(channels.raw("momentum"))
    rate = np.convolve(light.kernels[1], final.kernels[0])
    out = np.zeros((rows.size, 3, 3))
    for number, run in {i: run for i, run, _ in channels.pieces}.items():
        mine = channels.run_of_sample[rows] == number
        weights = run.acceleration_weights
        first = light.kernels[2] if weights is None else np.convolve(weights, light.kernels[0])
        inertial = np.convolve(first, final.kernels[0])
        parts = ((velocity, inertial), (velocity, rate), (momentum, inertial))
        out[mine] = timing_moments(scatter, parts, rows[mine])
    return out
