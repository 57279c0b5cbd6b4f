"""The terms of M vdot + h = S^T tau + J^T f at one state, see `drake_tc.tsid.rows`."""

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
