"""The terms of M vdot + h = S^T tau + J^T f at one state, see `drake_tc.tsid.rows`."""

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, TABLE, VECTOR, WHOLE, helper, kernel
from drake_tc.kernels.dynamics import (
    BODY_WIDTH,
    forces_and_inertias,
    frame_jacobian,
    frame_motion,
    frame_pose,
    move,
)
from drake_tc.types import FloatArray, IntArray


@helper
def arranged(
    mass: FloatArray,
    load: FloatArray,
    places: IntArray,
    first: int,
    gravity: FloatArray,
    matrix: FloatArray,
    bias: FloatArray,
    columns: FloatArray,
) -> None:
    """M (nv, nv), h = C v - M a_g (nv,) and M's rows of the base (6, nv), in the order of v; followers add up."""
    n, skip = places.shape[0], 6 if first >= 0 else 0
    order = np.empty(skip + n, dtype=np.int64)
    for i in range(skip):
        order[i] = first + i
    for j in range(n):
        order[skip + j] = places[j, 3]
    inner = 6 - skip
    for i in range(skip + n):
        to, row = order[i], mass[inner + i]
        bias[to] += load[inner + i] - row[3] * gravity[0] - row[4] * gravity[1] - row[5] * gravity[2]
        for j in range(skip + n):
            matrix[to, order[j]] += row[inner + j]
        for k in range(6):
            columns[k, to] += row[k]


@helper
def about_com(rows: FloatArray, x: float, y: float, z: float) -> None:
    """Momentum about Bo, its columns (6, r), becomes momentum about the centre of mass at (x, y, z) from Bo."""
    for j in range(rows.shape[1]):
        px, py, pz = rows[3, j], rows[4, j], rows[5, j]
        rows[0, j] += z * py - y * pz
        rows[1, j] += x * pz - z * px
        rows[2, j] += y * px - x * py


@helper
def contact_rows(
    bodies: FloatArray,
    places: IntArray,
    first: int,
    frames: FloatArray,
    frame_bodies: IntArray,
    contacts: IntArray,
    active: IntArray,
    jacobian: FloatArray,
    drift: FloatArray,
) -> None:
    """J (k, nv) and Jdot v (k,) of the active contacts, each [force; moment] in its own axes or the world's."""
    pose, motion, whole = np.empty(12), np.empty(12), np.empty((6, jacobian.shape[1]))
    row = 0
    for i in active:
        frame, upright, size = contacts[i, 0], contacts[i, 1], contacts[i, 2]
        body = frame_bodies[frame]
        frame_pose(bodies, body, frames[frame], pose)
        frame_motion(bodies, body, pose, 9, motion)
        frame_jacobian(bodies, body, pose, 9, places, first, whole)
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


@kernel(VECTOR, VECTOR, VECTOR, INDEX, TABLE, MATRIX, VECTOR, VECTOR, MATRIX, INDEX, TABLE, INDEX)
def terms(
    q: FloatArray,
    v: FloatArray,
    held: FloatArray,
    floating: IntArray,
    places: IntArray,
    constants: FloatArray,
    trunk: FloatArray,
    gravity: FloatArray,
    frames: FloatArray,
    frame_bodies: IntArray,
    contacts: IntArray,
    active: IntArray,
) -> tuple[FloatArray, ...]:
    """All terms at a state.

    Args:
        q: (nq,).
        v: (nv,).
        held: (7,) pose of a base that does not float.
        floating: (2,) where a floating base's pose stands in q and its velocity in v; -1 where it is held.
        places: Tree of n joints, those that follow others among them, see `dynamics`.
        constants: The same.
        trunk: (10,) the base's body.
        gravity: (3,) [m/s^2].
        frames: (F, 12).
        frame_bodies: (F,) row of each frame's body.
        contacts: (C, 3) frame of each contact, 1 where its axes are the world's, 6 or 3.
        active: Those that carry.

    Returns:
        bodies (n + 1, 30), M, h, J (k, nv), Jdot v, J v, centre of mass (3,), its velocity, A_G (6, nv), Adot_G v (6,).
    """
    n, nv, first = places.shape[0], v.shape[0], floating[1]
    base = np.zeros(13)
    if first >= 0:
        base[:7] = q[floating[0] : floating[0] + 7]
        base[7:] = v[first : first + 6]
    else:
        base[:7] = held
    bodies = np.empty((n + 1, BODY_WIDTH))
    move(base, q, v, places, constants, bodies)
    mass, load = np.zeros((6 + n, 6 + n)), np.empty(6 + n)
    whole = forces_and_inertias(bodies, places, constants, trunk, mass, load)
    matrix, bias, momentum = np.zeros((nv, nv)), np.zeros(nv), np.zeros((6, nv))
    arranged(mass, load, places, first, gravity, matrix, bias, momentum)
    x, y, z = whole[1] / whole[0], whole[2] / whole[0], whole[3] / whole[0]
    rate = np.empty((6, 1))
    rate[:, 0] = load[:6]
    about_com(momentum, x, y, z)
    about_com(rate, x, y, z)
    com, com_velocity = np.empty(3), np.dot(momentum[3:], v) / whole[0]
    com[0], com[1], com[2] = base[4] + x, base[5] + y, base[6] + z
    size = 0
    for i in active:
        size += contacts[i, 2]
    jacobian, drift = np.empty((size, nv)), np.empty(size)
    contact_rows(bodies, places, first, frames, frame_bodies, contacts, active, jacobian, drift)
    return bodies, matrix, bias, jacobian, drift, np.dot(jacobian, v), com, com_velocity, momentum, rate[:, 0].copy()


@kernel(VECTOR, VECTOR, INDEX, TABLE, MATRIX, VECTOR, WHOLE, WHOLE)
def frame_terms(
    q: FloatArray,
    held: FloatArray,
    floating: IntArray,
    places: IntArray,
    bodies: FloatArray,
    frame: FloatArray,
    body: int,
    velocities: int,
) -> tuple[FloatArray, ...]:
    """R (3, 3), p (3,), [omega; v] (6,), J (6, nv) and [alpha; a] at vdot = 0 (6,) of a frame where `bodies` are."""
    pose, motion, jacobian = np.empty(12), np.empty(12), np.empty((6, velocities))
    frame_pose(bodies, body, frame, pose)
    frame_motion(bodies, body, pose, 9, motion)
    frame_jacobian(bodies, body, pose, 9, places, floating[1], jacobian)
    rotation, position = pose[:9].copy().reshape(3, 3), np.empty(3)
    for k in range(3):
        start = held[4 + k] if floating[0] < 0 else q[floating[0] + 4 + k]
        position[k] = start + pose[9 + k]
    return rotation, position, motion[:6].copy(), jacobian, motion[6:].copy()
