"""Rigid-body dynamics of a tree of joints of one degree of freedom on a base that floats or is held.

Spatial vectors [angular; linear] stand in the world's axes and refer to the point that the base's origin Bo passes.
With screw s_i of joint i, V_i = V_p + s_i v_i and A_i = A_p + V_i x s_i v_i of the parent p, and inertia I_i of body i,

    f_i = I_i A_i + V_i x* (I_i V_i) + sum of its children's f      (C v)_i = s_i . f_i      (recursive Newton-Euler)
    J_i = I_i + sum of its children's J,  F_i = J_i s_i             M_ji = s_j . F_i for j on the way to the base
                                                                    (composite rigid bodies)

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, tables 5.1 and 6.2. A_0 = [0; -omega x v], as the base's
acceleration is that of the point Bo. The base's rows of M and C v are momentum about Bo and its rate.

A tree is two tables, one row a joint, parents first:
    places (n, 4): row of the parent's body (0 is the base), 1 for a slide or 0 for a turn, index in q, index in v
    constants (n, 26): R (9) and p (3) of the joint's frame in the parent's body, its axis (3; of a joint that follows
        another one, whose indices in q and v it has, times its turns for one of that joint), mass, centre of mass (3)
        and inertia about it (xx yy zz xy xz yz) of the body, whose frame is the joint's moved one; rotor inertia
The base's body is (10,) mass, centre of mass, inertia. A frame is (12,) R and p in its body.
`bodies` has a row a body: R (9), p from Bo (3), screw (6), V (6), A (6).

Recursive Newton-Euler takes accelerations of joints and base; with the base's proper acceleration (a - g) in place of
its acceleration, the forces hold gravity.
"""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.compiling import helper
from drake_tc.types import FloatArray, IntArray

BODY_WIDTH = 30
UNIT = 1e-9
_ROTATION, _PLACE, _SCREW, _VELOCITY, _ACCELERATION = 0, 9, 12, 18, 24


class Motion(NamedTuple):
    """How a robot stands and moves.

    Attributes:
        base: (13,) quaternion, p, omega and v of Bo.
        q, v: Of which each joint takes its number.
    """

    base: FloatArray
    q: FloatArray
    v: FloatArray


class Tree(NamedTuple):
    """A robot without its state.

    Attributes:
        places, constants: Of its joints.
        trunk: (10,) the base's body.
    """

    places: IntArray
    constants: FloatArray
    trunk: FloatArray


class BodyPoint(NamedTuple):
    """A point of a body.

    Attributes:
        row: Of the body.
        place: (3,) from Bo.
    """

    row: int
    place: FloatArray


@helper
def cross_into(out: FloatArray, at: int, a: FloatArray, i: int, b: FloatArray, j: int) -> None:
    """out[at : at + 3] = a[i : i + 3] x b[j : j + 3]."""
    out[at] = a[i + 1] * b[j + 2] - a[i + 2] * b[j + 1]
    out[at + 1] = a[i + 2] * b[j] - a[i] * b[j + 2]
    out[at + 2] = a[i] * b[j + 1] - a[i + 1] * b[j]


@helper
def rotation_of_quaternion(out: FloatArray, q: FloatArray) -> None:
    """Into out[:9], row by row, from q[:4] = [w x y z] of any length."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    two = 2.0 / (w * w + x * x + y * y + z * z)
    out[0], out[1], out[2] = 1.0 - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)
    out[3], out[4], out[5] = two * (x * y + w * z), 1.0 - two * (x * x + z * z), two * (y * z - w * x)
    out[6], out[7], out[8] = two * (x * z - w * y), two * (y * z + w * x), 1.0 - two * (x * x + y * y)


@helper
def rotate_into(out: FloatArray, at: int, rotation: FloatArray, vector: FloatArray, i: int) -> None:
    """out[at : at + 3] = R vector[i : i + 3], R in rotation[:9]."""
    x, y, z = vector[i], vector[i + 1], vector[i + 2]
    for k in range(3):
        out[at + k] = rotation[3 * k] * x + rotation[3 * k + 1] * y + rotation[3 * k + 2] * z


@helper
def product_into(out: FloatArray, left: FloatArray, right: FloatArray) -> None:
    """out[:9] = left[:9] right[:9], rotations row by row."""
    for i in range(0, 9, 3):
        for j in range(3):
            out[i + j] = left[i] * right[j] + left[i + 1] * right[3 + j] + left[i + 2] * right[6 + j]


@helper
def turn_about(out: FloatArray, x: float, y: float, z: float, angle: float) -> None:
    """Rotation about a unit axis into out[:9] (Rodrigues)."""
    s, c = math.sin(angle), math.cos(angle)
    t = 1.0 - c
    out[0], out[1], out[2] = c + t * x * x, t * x * y - s * z, t * x * z + s * y
    out[3], out[4], out[5] = t * x * y + s * z, c + t * y * y, t * y * z - s * x
    out[6], out[7], out[8] = t * x * z - s * y, t * y * z + s * x, c + t * z * z


@helper
def move(motion: Motion, places: IntArray, constants: FloatArray, bodies: FloatArray) -> None:
    """Where all bodies are and how they move, into `bodies`."""
    base, q, v = motion
    root, turn, frame = bodies[0], np.empty(9), np.empty(9)
    rotation_of_quaternion(root, base)
    root[_PLACE : _SCREW + 6] = 0.0
    root[_VELOCITY : _VELOCITY + 6] = base[7:13]
    root[_ACCELERATION : _ACCELERATION + 3] = 0.0
    cross_into(root, _ACCELERATION + 3, base, 10, base, 7)
    for j in range(places.shape[0]):
        parent, body, fixed = bodies[places[j, 0]], bodies[j + 1], constants[j]
        position, speed = q[places[j, 2]], v[places[j, 3]]
        product_into(frame, parent, fixed)
        rotate_into(body, _PLACE, parent, fixed, 9)
        for k in range(3):
            body[_PLACE + k] += parent[_PLACE + k]
        rotate_into(body, _SCREW, frame, fixed, 12)
        if places[j, 1]:
            body[:9] = frame
            for k in range(3):
                body[_PLACE + k] += position * body[_SCREW + k]
                body[_SCREW + 3 + k] = body[_SCREW + k]
                body[_SCREW + k] = 0.0
        else:
            x, y, z = fixed[12], fixed[13], fixed[14]
            length = math.sqrt(x * x + y * y + z * z)
            if abs(length - 1.0) > UNIT:  # a joint that follows another one turns by `length` times its angle
                x, y, z, position = x / length, y / length, z / length, position * length
            turn_about(turn, x, y, z, position)
            product_into(body, frame, turn)
            cross_into(body, _SCREW + 3, body, _PLACE, body, _SCREW)
        for k in range(6):
            body[_VELOCITY + k] = parent[_VELOCITY + k] + speed * body[_SCREW + k]
        wx, wy, wz = body[_VELOCITY], body[_VELOCITY + 1], body[_VELOCITY + 2]
        vx, vy, vz = body[_VELOCITY + 3], body[_VELOCITY + 4], body[_VELOCITY + 5]
        ax, ay, az = speed * body[_SCREW], speed * body[_SCREW + 1], speed * body[_SCREW + 2]
        bx, by, bz = speed * body[_SCREW + 3], speed * body[_SCREW + 4], speed * body[_SCREW + 5]
        body[_ACCELERATION] = parent[_ACCELERATION] + wy * az - wz * ay
        body[_ACCELERATION + 1] = parent[_ACCELERATION + 1] + wz * ax - wx * az
        body[_ACCELERATION + 2] = parent[_ACCELERATION + 2] + wx * ay - wy * ax
        body[_ACCELERATION + 3] = parent[_ACCELERATION + 3] + wy * bz - wz * by + vy * az - vz * ay
        body[_ACCELERATION + 4] = parent[_ACCELERATION + 4] + wz * bx - wx * bz + vz * ax - vx * az
        body[_ACCELERATION + 5] = parent[_ACCELERATION + 5] + wx * by - wy * bx + vx * ay - vy * ax


@helper
def inertia_into(out: FloatArray, body: FloatArray, own: FloatArray, at: int, scratch: FloatArray) -> None:
    """(10,) m, m c, and the inertia xx yy zz xy xz yz about Bo in the world's axes; own[at : at + 10] in the body's.

    `scratch` (12,) is overwritten.
    """
    mass = own[at]
    xx, yy, zz, xy, xz, yz = own[at + 4], own[at + 5], own[at + 6], own[at + 7], own[at + 8], own[at + 9]
    half, centre = scratch[:9], scratch[9:]
    rotate_into(centre, 0, body, own, at + 1)
    for i in range(0, 9, 3):
        a, b, c = body[i], body[i + 1], body[i + 2]
        half[i], half[i + 1], half[i + 2] = a * xx + b * xy + c * xz, a * xy + b * yy + c * yz, a * xz + b * yz + c * zz
    x, y, z = centre[0] + body[_PLACE], centre[1] + body[_PLACE + 1], centre[2] + body[_PLACE + 2]
    out[0], out[1], out[2], out[3] = mass, mass * x, mass * y, mass * z
    out[4] = half[0] * body[0] + half[1] * body[1] + half[2] * body[2] + mass * (y * y + z * z)
    out[5] = half[3] * body[3] + half[4] * body[4] + half[5] * body[5] + mass * (x * x + z * z)
    out[6] = half[6] * body[6] + half[7] * body[7] + half[8] * body[8] + mass * (x * x + y * y)
    out[7] = half[0] * body[3] + half[1] * body[4] + half[2] * body[5] - mass * x * y
    out[8] = half[0] * body[6] + half[1] * body[7] + half[2] * body[8] - mass * x * z
    out[9] = half[3] * body[6] + half[4] * body[7] + half[5] * body[8] - mass * y * z


@helper
def momentum_into(out: FloatArray, inertia: FloatArray, motion: FloatArray, at: int) -> None:
    """out[:6] = I motion[at : at + 6], [about Bo; linear]."""
    m, cx, cy, cz = inertia[0], inertia[1], inertia[2], inertia[3]
    wx, wy, wz, vx, vy, vz = motion[at], motion[at + 1], motion[at + 2], motion[at + 3], motion[at + 4], motion[at + 5]
    out[0] = inertia[4] * wx + inertia[7] * wy + inertia[8] * wz + cy * vz - cz * vy
    out[1] = inertia[7] * wx + inertia[5] * wy + inertia[9] * wz + cz * vx - cx * vz
    out[2] = inertia[8] * wx + inertia[9] * wy + inertia[6] * wz + cx * vy - cy * vx
    out[3] = m * vx + wy * cz - wz * cy
    out[4] = m * vy + wz * cx - wx * cz
    out[5] = m * vz + wx * cy - wy * cx


@helper
def load_into(out: FloatArray, inertia: FloatArray, body: FloatArray, momentum: FloatArray) -> None:
    """out[:6] = I A + V x* (I V); `momentum` is overwritten by I V."""
    momentum_into(out, inertia, body, _ACCELERATION)
    momentum_into(momentum, inertia, body, _VELOCITY)
    wx, wy, wz = body[_VELOCITY], body[_VELOCITY + 1], body[_VELOCITY + 2]
    vx, vy, vz = body[_VELOCITY + 3], body[_VELOCITY + 4], body[_VELOCITY + 5]
    hx, hy, hz, px, py, pz = momentum[0], momentum[1], momentum[2], momentum[3], momentum[4], momentum[5]
    out[0] += wy * hz - wz * hy + vy * pz - vz * py
    out[1] += wz * hx - wx * hz + vz * px - vx * pz
    out[2] += wx * hy - wy * hx + vx * py - vy * px
    out[3] += wy * pz - wz * py
    out[4] += wz * px - wx * pz
    out[5] += wx * py - wy * px


@helper
def forces_and_inertias(bodies: FloatArray, tree: Tree, mass: FloatArray, load: FloatArray) -> FloatArray:
    """M and C v over [base; v] into mass (6 + n, 6 + n) and load (6 + n,), n the joints in the order of the table.

    Returns:
        (10,) inertia of the whole robot about Bo.
    """
    places, constants, trunk = tree
    n = places.shape[0]
    inertias, loads, momentum, scratch = np.empty((n + 1, 10)), np.empty((n + 1, 6)), np.empty(6), np.empty(12)
    inertia_into(inertias[0], bodies[0], trunk, 0, scratch)
    load_into(loads[0], inertias[0], bodies[0], momentum)
    for j in range(n):
        inertia_into(inertias[j + 1], bodies[j + 1], constants[j], 15, scratch)
        load_into(loads[j + 1], inertias[j + 1], bodies[j + 1], momentum)
    for j in range(n - 1, -1, -1):
        screw, parent = bodies[j + 1], places[j, 0]
        momentum_into(momentum, inertias[j + 1], screw, _SCREW)
        total = 0.0
        for k in range(6):
            total += screw[_SCREW + k] * loads[j + 1, k]
            loads[parent, k] += loads[j + 1, k]
            mass[k, 6 + j] = mass[6 + j, k] = momentum[k]
        load[6 + j] = total
        for k in range(10):
            inertias[parent, k] += inertias[j + 1, k]
        other = j + 1
        while other > 0:
            entry, above = 0.0, bodies[other]
            for k in range(6):
                entry += above[_SCREW + k] * momentum[k]
            mass[6 + j, 5 + other] = mass[5 + other, 6 + j] = entry
            other = places[other - 1, 0]
        mass[6 + j, 6 + j] += constants[j, 25]
    load[:6] = loads[0]
    whole: FloatArray = inertias[0]
    mass[0, 0], mass[1, 1], mass[2, 2] = whole[4], whole[5], whole[6]
    mass[0, 1], mass[0, 2], mass[1, 2] = whole[7], whole[8], whole[9]
    mass[1, 0], mass[2, 0], mass[2, 1] = whole[7], whole[8], whole[9]
    x, y, z = whole[1], whole[2], whole[3]
    mass[0, 4], mass[0, 5], mass[1, 5] = -z, y, -x
    mass[1, 3], mass[2, 3], mass[2, 4] = z, -y, x
    mass[4, 0], mass[5, 0], mass[5, 1] = -z, y, -x
    mass[3, 1], mass[3, 2], mass[4, 2] = z, -y, x
    mass[3, 3] = mass[4, 4] = mass[5, 5] = whole[0]
    return whole


@helper
def frame_pose(bodies: FloatArray, row: int, frame: FloatArray, pose: FloatArray) -> None:
    """R (9) and p from Bo (3) of a frame into pose[:12]."""
    body = bodies[row]
    product_into(pose, body, frame)
    rotate_into(pose, 9, body, frame, 9)
    for k in range(3):
        pose[9 + k] += body[_PLACE + k]


@helper
def frame_motion(bodies: FloatArray, row: int, place: FloatArray, at: int, out: FloatArray) -> None:
    """[omega; v] and [alpha; a] at vdot = 0 of the body's point place[at : at + 3] from Bo, into out[:12]."""
    body = bodies[row]
    x, y, z = place[at], place[at + 1], place[at + 2]
    wx, wy, wz = body[_VELOCITY], body[_VELOCITY + 1], body[_VELOCITY + 2]
    ax, ay, az = body[_ACCELERATION], body[_ACCELERATION + 1], body[_ACCELERATION + 2]
    vx = body[_VELOCITY + 3] + wy * z - wz * y
    vy = body[_VELOCITY + 4] + wz * x - wx * z
    vz = body[_VELOCITY + 5] + wx * y - wy * x
    out[0], out[1], out[2], out[3], out[4], out[5] = wx, wy, wz, vx, vy, vz
    out[6], out[7], out[8] = ax, ay, az
    out[9] = body[_ACCELERATION + 3] + ay * z - az * y + wy * vz - wz * vy
    out[10] = body[_ACCELERATION + 4] + az * x - ax * z + wz * vx - wx * vz
    out[11] = body[_ACCELERATION + 5] + ax * y - ay * x + wx * vy - wy * vx


@helper
def frame_jacobian(bodies: FloatArray, point: BodyPoint, places: IntArray, first: int, out: FloatArray) -> None:
    """J (6, nv) of [omega; v] of a point; first: index in v of the base's velocity, -1 where it is held."""
    out[:6] = 0.0
    row, x, y, z = point.row, point.place[0], point.place[1], point.place[2]
    if first >= 0:
        for k in range(6):
            out[k, first + k] = 1.0
        out[3, first + 1], out[3, first + 2] = z, -y
        out[4, first], out[4, first + 2] = -z, x
        out[5, first], out[5, first + 1] = y, -x
    while row > 0:
        screw, column = bodies[row], places[row - 1, 3]
        wx, wy, wz = screw[_SCREW], screw[_SCREW + 1], screw[_SCREW + 2]
        out[0, column] += wx
        out[1, column] += wy
        out[2, column] += wz
        out[3, column] += screw[_SCREW + 3] + wy * z - wz * y
        out[4, column] += screw[_SCREW + 4] + wz * x - wx * z
        out[5, column] += screw[_SCREW + 5] + wx * y - wy * x
        row = places[row - 1, 0]


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
def wrenches_needed(bodies: FloatArray, tree: Tree) -> FloatArray:
    """F (rows + 1, 6), the base's first."""
    places, constants, trunk = tree
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
