"""Forces of the joints by the helpers of `newton_euler`, which others use without waiting for this to be compiled."""

from typing import Any

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_VECTOR, TABLE, VECTOR, kernel, together
from drake_tc.kernels.dynamics import BODY_WIDTH, move
from drake_tc.kernels.newton_euler import add_joint_accelerations, add_joint_forces, carry_along, wrenches_needed
from drake_tc.types import FloatArray

TREE = together(TABLE, MATRIX, VECTOR)
"""places and constants of a tree, see `dynamics`, and (10,) the base's body."""


@kernel(together(VECTOR, VECTOR, VECTOR), TREE, VECTOR, OUT_VECTOR)
def joint_forces(motion: tuple[FloatArray, ...], tree: tuple[Any, ...], base: FloatArray, out: FloatArray) -> None:
    """M vdot + h (n,) of the joints, on a base that moves as given.

    Args:
        motion: (n,) q, v and vdot.
        tree: See `TREE`.
        base: (19,) quaternion and place of the base, [omega; v], and [alpha; proper acceleration] of its origin.
        out: (n,) written.
    """
    (q, v, vdot), (places, constants, trunk) = motion, tree
    bodies = np.empty((places.shape[0] + 1, BODY_WIDTH))
    move(base, q, v, places, constants, bodies)
    add_joint_accelerations(bodies, places, vdot)
    carry_along(bodies, base[13:19])
    loads = wrenches_needed(bodies, places, constants, trunk)
    out[:] = 0.0
    add_joint_forces(bodies, loads, places, out)
