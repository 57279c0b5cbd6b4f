"""Forces of the joints by the helpers of `newton_euler`, which others use without waiting for this to be compiled."""

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_VECTOR, TABLE, VECTOR, kernel
from drake_tc.kernels.dynamics import BODY_WIDTH, move
from drake_tc.kernels.newton_euler import add_joint_accelerations, add_joint_forces, carry_along, wrenches_needed
from drake_tc.types import FloatArray, IntArray


@kernel(VECTOR, VECTOR, VECTOR, TABLE, MATRIX, VECTOR, VECTOR, OUT_VECTOR)
def joint_forces(
    q: FloatArray,
    v: FloatArray,
    vdot: FloatArray,
    places: IntArray,
    constants: FloatArray,
    trunk: FloatArray,
    base: FloatArray,
    out: FloatArray,
) -> None:
    """M vdot + h (n,) of the joints, on a base that moves as given.

    Args:
        q: (n,).
        v: (n,).
        vdot: (n,).
        places: Tree, see `dynamics`.
        constants: The same.
        trunk: (10,) the base's body.
        base: (19,) quaternion and place of the base, [omega; v], and [alpha; proper acceleration] of its origin.
        out: (n,) written.
    """
    bodies = np.empty((places.shape[0] + 1, BODY_WIDTH))
    move(base, q, v, places, constants, bodies)
    add_joint_accelerations(bodies, places, vdot)
    carry_along(bodies, base[13:19])
    loads = wrenches_needed(bodies, places, constants, trunk)
    out[:] = 0.0
    add_joint_forces(bodies, loads, places, out)
