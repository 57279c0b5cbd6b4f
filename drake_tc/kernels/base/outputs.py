"""What the base estimator shows of its state."""

from drake_tc.kernels.base import state as base_state
from drake_tc.kernels.compiling import INDEX, OUT_VECTOR, VECTOR, WHOLE, helper, kernel
from drake_tc.kernels.linear_algebra import times, wxyz_into
from drake_tc.types import FloatArray, IntArray

_memory_of = helper(base_state.memory_of)


@kernel(VECTOR, WHOLE, WHOLE, INDEX, OUT_VECTOR)
def outputs(state: FloatArray, n: int, k: int, order: IntArray, out: FloatArray) -> None:
    """[base pose (7); q (n); base velocity (6); qd (n); 0], then the same in the plant's order, into `out`.

    Args:
        state: (s,) see `base.state`.
        n: Joints.
        k: Contacts.
        order: (nq + nv,) where each of the plant's [q; v] is in the first part.
        out: (14 + 2n + nq + nv,) written.
    """
    memory = _memory_of(state, n, k)
    wxyz_into(out, memory.rotation)
    out[4:7], out[7 : 7 + n] = memory.position, memory.q
    out[7 + n : 10 + n] = times(memory.rotation, memory.rate)
    out[10 + n : 13 + n] = times(memory.rotation, memory.velocity)
    out[13 + n : 13 + 2 * n] = memory.qd
    out[13 + 2 * n] = 0.0
    for i in range(order.size):
        out[14 + 2 * n + i] = out[order[i]]
