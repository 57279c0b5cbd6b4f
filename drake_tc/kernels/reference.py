"""References of `drake_tc.control.references` at one instant, compiled."""

from drake_tc.kernels import instant
from drake_tc.kernels.compiling import OUT_VECTOR, REAL, VECTOR, helper, kernel
from drake_tc.types import FloatArray

_step_at, _swinging, _turned = helper(instant.step_at), helper(instant.swinging), helper(instant.turned)


@kernel(REAL, VECTOR, OUT_VECTOR)
def swing(time: float, numbers: FloatArray, out: FloatArray) -> None:
    """`Swing.row`.

    Args:
        time: [s].
        numbers: (11,) axis (3), amplitude [rad], begin [s], rise [s], frequency [rad/s], first quaternion (4).
        out: (10,) [quaternion w x y z; omega; alpha]; written.
    """
    axis, first = (numbers[0], numbers[1], numbers[2]), (numbers[7], numbers[8], numbers[9], numbers[10])
    size, begin, w = numbers[3], numbers[4], numbers[6]
    share, rate, growth = _step_at(time, begin, numbers[5])
    angle = _swinging((size * share, size * rate, size * growth), w, w * (time - begin))
    out[0], out[1], out[2], out[3] = _turned(axis, angle[0], first)
    for k in range(3):
        out[4 + k], out[7 + k] = angle[1] * axis[k], angle[2] * axis[k]
