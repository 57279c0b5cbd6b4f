"""Recursive Newton-Euler with accelerations of joints and base, by the helpers of `dynamics`.

With the base's proper acceleration (a - g) in place of its acceleration, the forces hold gravity.
"""

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.kernels.dynamics import inertia_into, load_into
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
