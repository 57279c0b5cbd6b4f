"""Recursive Newton-Euler with accelerations of joints and base, by the helpers of `dynamics`.

With the base's proper acceleration (a - g) in place of its acceleration, the forces hold gravity.
"""

import numpy as np

from drake_tc.kernels.compiling import MATRIX, OUT_VECTOR, TABLE, VECTOR, helper, kernel
from drake_tc.kernels.dynamics import BODY_WIDTH, inertia_into, load_into, move
from drake_tc.types import FloatArray, IntArray

_SCREW, _ACCELERATION = 12, 24


@helper
def add_joint_accelerations(bodies: FloatArray, places: IntArray, vdot: FloatArray) -> None:
    """A_i of bodies that were moved with vdot = 0 becomes that with vdot (n,)."""
    added = np.zeros((bodies.shape[0], 6))
    for j in range(places.shape[0]):
        parent, rate = places[j, 0], vdot[places[j, 3]]
        for k in range(6):
            added[j + 1, k] = added[parent, k] + bodies[j + 1, _SCREW + k] * rate
            bodies[j + 1, _ACCELERATION + k] += added[j + 1, k]


@helper
def carry_along(bodies: FloatArray, acceleration: FloatArray) -> None:
    """A_i + [alpha; a] (6,) of the base, whose bodies were moved without."""
    for i in range(bodies.shape[0]):
        for k in range(6):
            bodies[i, _ACCELERATION + k] += acceleration[k]


@helper
def wrenches_needed(bodies: FloatArray, places: IntArray, constants: FloatArray, trunk: FloatArray) -> FloatArray:
    """F (rows + 1, 6), the base's first."""
    n = places.shape[0]
    loads, inertia, momentum, scratch = np.empty((n + 1, 6)), np.empty(10), np.empty(6), np.empty(12)
    inertia_into(inertia, bodies[0], trunk, 0, scratch)
    load_into(loads[0], inertia, bodies[0], momentum)
    for j in range(n):
        inertia_into(inertia, bodies[j + 1], constants[j], 15, scratch)
        load_into(loads[j + 1], inertia, bodies[j + 1], momentum)
    for j in range(n - 1, -1, -1):
        parent = places[j, 0]
        for k in range(6):
            loads[parent, k] += loads[j + 1, k]
    return loads


@helper
def add_joint_forces(bodies: FloatArray, loads: FloatArray, places: IntArray, out: FloatArray) -> None:
    """s_j . F_j added to the place of each joint's velocity in out."""
    for j in range(places.shape[0]):
        for k in range(6):
            out[places[j, 3]] += bodies[j + 1, _SCREW + k] * loads[j + 1, k]


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
