"""Feedback on the joints' motion, see `drake_tc.control.inverse_dynamics`."""

from drake_tc.kernels.compiling import OUT_VECTOR, VECTOR, kernel
from drake_tc.types import FloatArray

LARGEST = 1e12
"""Inputs beyond this count as not finite."""


@kernel(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, OUT_VECTOR)
def feedback(
    estimate: FloatArray,
    reference: FloatArray,
    position: FloatArray,
    others: FloatArray,
    gains: FloatArray,
    out: FloatArray,
) -> bool:
    """[Ks e + Kd edot; Ks e; Kd edot] (3n,) into out.

    Args:
        estimate: (3n,) [q; qdot; qddot].
        reference: (3n,) the desired ones.
        position: (n,) q to take in e; empty: that of the estimate.
        others: Inputs of which only is asked whether they are finite.
        gains: (2n,) or more, [Ks; Kd].
        out: (3n,) written.

    Returns:
        Whether all inputs are finite; `out` is not to be used else.
    """
    n = estimate.shape[0] // 3
    finite = True
    for j in range(3 * n):
        error = reference[j] - estimate[j]
        if j < n and position.shape[0]:
            error = reference[j] - position[j]
        finite = finite and abs(estimate[j]) <= LARGEST and abs(error) <= LARGEST  # not where one is NaN
        if j < 2 * n:
            out[n + j] = gains[j] * error
    for j in range(others.shape[0]):
        finite = finite and abs(others[j]) <= LARGEST
    for j in range(n):
        out[j] = out[n + j] + out[2 * n + j]
    return finite
