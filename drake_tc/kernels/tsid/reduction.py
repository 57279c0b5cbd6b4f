"""Accelerations and contact forces as what torques make of them; `drake_tc.tsid.assembly` has the equations."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, VECTOR, WHOLE, helper, kernel
from drake_tc.kernels.linear_algebra import inverse_factor
from drake_tc.types import FloatArray, IntArray

RANK_LOST, RANK_KEPT = 1e-8, 1e-6
"""Relative eigenvalues of the scaled J M^-1 J^T: below the first a direction is dropped, above the second kept."""


@helper
def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """X of matrix x = right for a positive semidefinite matrix, filtered where that loses rank."""
    n = matrix.shape[0]
    root = inverse_factor(matrix)
    if root[0, 0] == root[0, 0]:
        # Scaled to a diagonal of ones, the largest eigenvalue is at most n and the smallest at least 1 / trace(inverse)
        whole, spread = np.dot(root.T, root), 0.0
        for i in range(n):
            spread += matrix[i, i] * whole[i, i]
        if spread * n * RANK_KEPT < 1.0:
            found: FloatArray = np.dot(whole, right)
            return found
    answer, scale = np.full(right.shape, np.nan), np.empty(n)
    for i in range(n):
        scale[i] = 1.0 / math.sqrt(matrix[i, i]) if matrix[i, i] > 0.0 else 1.0
        for j in range(n):
            if not abs(matrix[i, j]) < np.inf:
                return answer
    within = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            within[i, j] = matrix[i, j] * scale[i] * scale[j]
        for j in range(right.shape[1]):
            answer[i, j] = right[i, j] * scale[i]
    answer = filtered(within, answer)
    for i in range(n):
        for j in range(right.shape[1]):
            answer[i, j] *= scale[i]
    return answer


@helper
def filtered(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The same for a scaled matrix that loses rank: sum_i filter(lambda_i) / lambda_i u_i (u_i^T right)."""
    n = matrix.shape[0]
    values, vectors = np.linalg.eigh(matrix)
    turned = np.dot(np.ascontiguousarray(vectors.T), right)
    for i in range(n):
        relative = max(values[i] / values[n - 1], 1e-300)
        step = min(max(math.log(relative / RANK_LOST) / math.log(RANK_KEPT / RANK_LOST), 0.0), 1.0)
        gain = step * step * (3.0 - 2.0 * step)
        share = gain / values[i] if gain > 0.0 else 0.0
        for j in range(right.shape[1]):
            turned[i, j] *= share
    found: FloatArray = np.dot(np.ascontiguousarray(vectors), turned)
    return found


@helper
def caused(
    mass: FloatArray, bias: FloatArray, actuated: IntArray, jacobian: FloatArray, drift: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """[C_v, c_v] (nv, n + 1) and [C_f, c_f] (k, n + 1) of vdot = C_v tau + c_v, f = C_f tau + c_f.

    Args:
        mass: (nv, nv) M.
        bias: (nv,) h.
        actuated: (n,) index in v of each joint.
        jacobian: (k, nv) J.
        drift: (k,) Jdot v - a_c.
    """
    nv, n, k = bias.size, actuated.size, drift.size
    root, free = inverse_factor(mass), np.empty((nv, n + 1))
    pulled = np.dot(root, bias)
    for i in range(nv):
        for j in range(n):
            free[i, j] = root[i, actuated[j]]
        free[i, n] = -pulled[i]
    push = np.zeros((k, n + 1))
    if k:
        pushes = np.dot(root, np.ascontiguousarray(jacobian.T))
        across = np.ascontiguousarray(pushes.T)
        right = np.dot(across, free)
        for i in range(k):
            for j in range(n + 1):
                right[i, j] = -right[i, j]
            right[i, n] -= drift[i]
        push = solved(np.dot(across, pushes), right)
        free += np.dot(pushes, push)
    return np.dot(root.T, free), push


@kernel(MATRIX, VECTOR, INDEX, MATRIX, VECTOR)
def causes(
    mass: FloatArray, bias: FloatArray, actuated: IntArray, jacobian: FloatArray, drift: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """See `caused`."""
    return caused(mass, bias, actuated, jacobian, drift)


NOTHING, DENSE, PICKED = 0, 1, 2
"""How a part of rows is given: not at all, written out, or as rows of the identity."""


class Over(NamedTuple):
    """Rows over y = (vdot, f, tau) by their parts: A_v or the rows of the identity that it is, A_f and A_tau."""

    kinds: IntArray
    vdot: FloatArray
    picks: IntArray
    force: FloatArray
    torque: FloatArray


@helper
def over_torques(rows: Over, count: int, motion: FloatArray, push: FloatArray) -> FloatArray:
    """(count, n + 1) [matrix over tau, value at tau = 0] of rows over y.

    With y = C tau + c (by its parts), a row A y is (A_v C_v + A_f C_f + A_tau) tau + A_v c_v + A_f c_f.
    """
    width, kinds = motion.shape[1], rows.kinds
    out = np.empty((count, width))
    if kinds[0] == DENSE and count:
        np.dot(rows.vdot, motion, out)
    elif kinds[0] == PICKED:
        for i in range(count):
            for j in range(width):
                out[i, j] = motion[rows.picks[i], j]
    else:
        out[:] = 0.0
    if kinds[1] == DENSE and count and push.shape[0]:
        out += np.dot(rows.force, push)
    elif kinds[1] == PICKED:
        out += push
    if kinds[2] == DENSE:
        for i in range(count):
            for j in range(width - 1):
                out[i, j] += rows.torque[i, j]
    elif kinds[2] == PICKED:
        for i in range(count):
            out[i, i] += 1.0
    return out


@kernel(VECTOR, MATRIX, MATRIX, INDEX, WHOLE)
def response(
    torque: FloatArray, motion: FloatArray, push: FloatArray, entries: IntArray, size: int
) -> tuple[FloatArray, FloatArray]:
    """Vdot (nv,), and the forces (size,) of all contacts, that torques (n,) cause; 0 where no entry (k,) is."""
    n = torque.size
    vdot, force = np.empty(motion.shape[0]), np.zeros(size)
    for i in range(motion.shape[0]):
        vdot[i] = motion[i, n]
        for j in range(n):
            vdot[i] += motion[i, j] * torque[j]
    for i in range(push.shape[0]):
        value = push[i, n]
        for j in range(n):
            value += push[i, j] * torque[j]
        force[entries[i]] = value
    return vdot, force
