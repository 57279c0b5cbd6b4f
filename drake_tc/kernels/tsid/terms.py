"""The terms of M vdot + h = S^T tau + J^T f at one state, see `drake_tc.tsid.rows`.

Accelerations and contact forces as what torques make of them; `drake_tc.tsid.assembly` has the equations.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, TABLE, VECTOR, WHOLE, helper, kernel, together
from drake_tc.kernels.dynamics import (
    BODY_WIDTH,
    BodyPoint,
    Motion,
    Tree,
    forces_and_inertias,
    frame_jacobian,
    frame_motion,
    frame_pose,
    move,
)
from drake_tc.kernels.linear_algebra import inverse_factor
from drake_tc.types import FloatArray, IntArray

ROBOT = together(VECTOR, INDEX, TABLE, MATRIX, VECTOR, VECTOR, MATRIX, INDEX, TABLE)


class Robot(NamedTuple):
    """A robot with n joints, those that follow others among them: what does not change with its state.

    Attributes:
        held: (7,) pose of a base that does not float.
        floating: (2,) where a floating base's pose stands in q and its velocity in v; -1 where it is held.
        places, constants: Of its tree, see `dynamics`.
        trunk: (10,) the base's body.
        gravity: (3,) [m/s^2].
        frames: (F, 12).
        frame_bodies: (F,) row of each frame's body.
        contacts: (C, 3) frame of each contact, 1 where its axes are the world's, 6 or 3.
    """

    held: FloatArray
    floating: IntArray
    places: IntArray
    constants: FloatArray
    trunk: FloatArray
    gravity: FloatArray
    frames: FloatArray
    frame_bodies: IntArray
    contacts: IntArray


@helper
def arranged(robot: Robot, mass: FloatArray, load: FloatArray, nv: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """M (nv, nv), h = C v - M a_g (nv,) and M's rows of the base (6, nv), in the order of v; followers add up."""
    first, gravity = robot.floating[1], robot.gravity
    n, skip = robot.places.shape[0], 6 if first >= 0 else 0
    matrix, bias, columns = np.zeros((nv, nv)), np.zeros(nv), np.zeros((6, nv))
    order = np.empty(skip + n, dtype=np.int64)
    for i in range(skip):
        order[i] = first + i
    for j in range(n):
        order[skip + j] = robot.places[j, 3]
    inner = 6 - skip
    for i in range(skip + n):
        to, row = order[i], mass[inner + i]
        bias[to] += load[inner + i] - row[3] * gravity[0] - row[4] * gravity[1] - row[5] * gravity[2]
        for j in range(skip + n):
            matrix[to, order[j]] += row[inner + j]
        for k in range(6):
            columns[k, to] += row[k]
    return matrix, bias, columns


@helper
def about_com(rows: FloatArray, x: float, y: float, z: float) -> None:
    """Momentum about Bo, its columns (6, r), becomes momentum about the centre of mass at (x, y, z) from Bo."""
    for j in range(rows.shape[1]):
        px, py, pz = rows[3, j], rows[4, j], rows[5, j]
        rows[0, j] += z * py - y * pz
        rows[1, j] += x * pz - z * px
        rows[2, j] += y * px - x * py


@helper
def contact_rows(robot: Robot, bodies: FloatArray, active: IntArray, jacobian: FloatArray, drift: FloatArray) -> None:
    """J (k, nv) and Jdot v (k,) of the active contacts, each [force; moment] in its own axes or the world's."""
    pose, motion, whole = np.empty(12), np.empty(12), np.empty((6, jacobian.shape[1]))
    row = 0
    for i in active:
        frame, upright, size = robot.contacts[i, 0], robot.contacts[i, 1], robot.contacts[i, 2]
        body = robot.frame_bodies[frame]
        frame_pose(bodies, body, robot.frames[frame], pose)
        frame_motion(bodies, body, pose, 9, motion)
        frame_jacobian(bodies, BodyPoint(body, pose[9:]), robot.places, robot.floating[1], whole)
        if upright:
            pose[:9] = 0.0
            pose[0] = pose[4] = pose[8] = 1.0
        for part in range(size // 3):
            of, to = 3 - 3 * part, row + 3 * part
            for k in range(3):
                a, b, c = pose[k], pose[3 + k], pose[6 + k]
                drift[to + k] = a * motion[6 + of] + b * motion[7 + of] + c * motion[8 + of]
                for j in range(jacobian.shape[1]):
                    jacobian[to + k, j] = a * whole[of, j] + b * whole[of + 1, j] + c * whole[of + 2, j]
        row += size


@kernel(VECTOR, VECTOR, ROBOT, INDEX)
def terms(q: FloatArray, v: FloatArray, robot: tuple[Any, ...], active: IntArray) -> tuple[FloatArray, ...]:
    """All terms at a state.

    Args:
        q: (nq,).
        v: (nv,).
        robot: See `Robot`.
        active: Contacts that carry.

    Returns:
        bodies (n + 1, 30), M, h, J (k, nv), Jdot v, J v, centre of mass (3,), its velocity, A_G (6, nv), Adot_G v (6,).
    """
    own = Robot(*robot)
    n, nv, first = own.places.shape[0], v.shape[0], own.floating[1]
    base = np.zeros(13)
    if first >= 0:
        base[:7] = q[own.floating[0] : own.floating[0] + 7]
        base[7:] = v[first : first + 6]
    else:
        base[:7] = own.held
    bodies = np.empty((n + 1, BODY_WIDTH))
    move(Motion(base, q, v), own.places, own.constants, bodies)
    mass, load = np.zeros((6 + n, 6 + n)), np.empty(6 + n)
    whole = forces_and_inertias(bodies, Tree(own.places, own.constants, own.trunk), mass, load)
    matrix, bias, momentum = arranged(own, mass, load, nv)
    x, y, z = whole[1] / whole[0], whole[2] / whole[0], whole[3] / whole[0]
    rate = np.empty((6, 1))
    rate[:, 0] = load[:6]
    about_com(momentum, x, y, z)
    about_com(rate, x, y, z)
    com, com_velocity = np.empty(3), np.dot(momentum[3:], v) / whole[0]
    com[0], com[1], com[2] = base[4] + x, base[5] + y, base[6] + z
    size = 0
    for i in active:
        size += own.contacts[i, 2]
    jacobian, drift = np.empty((size, nv)), np.empty(size)
    contact_rows(own, bodies, active, jacobian, drift)
    return bodies, matrix, bias, jacobian, drift, np.dot(jacobian, v), com, com_velocity, momentum, rate[:, 0].copy()


@kernel(VECTOR, ROBOT, MATRIX, WHOLE, WHOLE)
def frame_terms(
    q: FloatArray, robot: tuple[Any, ...], bodies: FloatArray, index: int, velocities: int
) -> tuple[FloatArray, ...]:
    """R (3, 3), p (3,), [omega; v] (6,), J (6, nv) and [alpha; a] at vdot = 0 (6,) of a frame where `bodies` are."""
    own = Robot(*robot)
    pose, motion, jacobian = np.empty(12), np.empty(12), np.empty((6, velocities))
    body = own.frame_bodies[index]
    frame_pose(bodies, body, own.frames[index], pose)
    frame_motion(bodies, body, pose, 9, motion)
    frame_jacobian(bodies, BodyPoint(body, pose[9:]), own.places, own.floating[1], jacobian)
    rotation, position = pose[:9].copy().reshape(3, 3), np.empty(3)
    for k in range(3):
        start = own.held[4 + k] if own.floating[0] < 0 else q[own.floating[0] + 4 + k]
        position[k] = start + pose[9 + k]
    return rotation, position, motion[:6].copy(), jacobian, motion[6:].copy()


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
