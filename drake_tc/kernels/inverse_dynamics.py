"""Forces of the joints, and the torque of a desired motion and of the feedback on it."""

from typing import Any

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_VECTOR, TABLE, VECTOR, kernel, together
from drake_tc.kernels.dynamics import (
    BODY_WIDTH,
    Motion,
    Tree,
    add_joint_accelerations,
    add_joint_forces,
    carry_along,
    move,
    wrenches_needed,
)
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
    (q, v, vdot), own = motion, Tree(*tree)
    places = own.places
    bodies = np.empty((places.shape[0] + 1, BODY_WIDTH))
    move(Motion(base, q, v), places, own.constants, bodies)
    add_joint_accelerations(bodies, places, vdot)
    carry_along(bodies, base[13:19])
    loads = wrenches_needed(bodies, own)
    out[:] = 0.0
    add_joint_forces(bodies, loads, places, out)


LARGEST = 1e12
"""Inputs beyond this count as not finite."""


@kernel(together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR), TREE, VECTOR, OUT_VECTOR)
def motion_torque(given: tuple[FloatArray, ...], tree: tuple[Any, ...], base: FloatArray, out: FloatArray) -> bool:
    """[M qddot_d + h; its sum with Ks e and Kd edot; Ks e; Kd edot] (4n,) into out.

    Args:
        given: (3n,) estimate [q; qdot; qddot] and reference; (n,) q to take in e, empty for that of the estimate;
            inputs of which only is asked whether they are finite; (2n,) or more, [Ks; Kd]; (2n,) or more, [q; qdot]
            where M and h are taken.
        tree: See `TREE`.
        base: See `joint_forces`.
        out: (4n,) written.

    Returns:
        Whether all inputs are finite; else the second part of `out` is NaN and the others are not to be used.
    """
    estimate, reference, position, others, gains, place = given
    n = estimate.shape[0] // 3
    finite = True
    for j in range(3 * n):
        error = reference[j] - estimate[j]
        if j < n and position.shape[0]:
            error = reference[j] - position[j]
        finite = finite and abs(estimate[j]) <= LARGEST and abs(error) <= LARGEST  # not where one is NaN
        if j < 2 * n:
            out[2 * n + j] = gains[j] * error
    for j in range(others.shape[0]):
        finite = finite and abs(others[j]) <= LARGEST
    if not finite:
        out[n : 2 * n] = np.nan
        return False
    joint_forces((place[:n], place[n : 2 * n], reference[2 * n :]), tree, base, out[:n])
    for j in range(n):
        out[n + j] = out[j] + (out[2 * n + j] + out[3 * n + j])
    return True
