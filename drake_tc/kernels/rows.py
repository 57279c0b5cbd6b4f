"""Targets and bounds of the built-in tasks and limits at one state, see `drake_tc.tsid.tasks` and `.limits`."""

import math
from typing import Any

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, REAL, VECTOR, WHOLE, helper, kernel, together
from drake_tc.kernels.dynamics import product_into, rotate_into, rotation_of_quaternion
from drake_tc.types import FloatArray, IntArray

NEGLIGIBLE = 1e-9
"""What rounding may add to a position or a velocity [rad, rad/s]."""
WORLD, FRAME, REFERENCE = 0, 1, 2
"""In whose axes a frame's rows stand."""


GAINS = together(VECTOR, VECTOR)
"""kp and kd."""


@kernel(VECTOR, VECTOR, together(INDEX, INDEX, INDEX), GAINS, VECTOR)
def posture(
    q: FloatArray, v: FloatArray, places: tuple[IntArray, ...], gains: tuple[FloatArray, ...], reference: FloatArray
) -> FloatArray:
    """qdd_d + kp (q_d - q) + kd (qd_d - qd) (r,) of joints; reference (3 n,): q_d, qd_d, qdd_d of all.

    `places` are those of the joints among all, in q and in v.
    """
    joints, positions, velocities = places
    target, n = np.empty(joints.size), reference.size // 3
    for i in range(joints.size):
        j = joints[i]
        error, lag = reference[j] - q[positions[i]], reference[n + j] - v[velocities[i]]
        target[i] = reference[2 * n + j] + gains[0][i] * error + gains[1][i] * lag
    return target


@kernel(together(MATRIX, VECTOR, REAL, VECTOR, VECTOR), GAINS, VECTOR, INDEX)
def com(
    body: tuple[Any, ...], gains: tuple[FloatArray, ...], reference: FloatArray, axes: IntArray
) -> tuple[FloatArray, FloatArray]:
    """J_com and xdd_d + kp (x_d - x) + kd (xd_d - xd) - Jdot_com v, of the axes; reference (9,): x_d, xd_d, xdd_d.

    `body` is A_G (6, nv), Adot_G v (6,), the mass [kg], x (3,) and xd (3,).
    """
    momentum, rate, mass, place, velocity = body
    matrix, target = np.empty((axes.size, momentum.shape[1])), np.empty(axes.size)
    for i in range(axes.size):
        k = axes[i]
        error, lag = reference[k] - place[k], reference[3 + k] - velocity[k]
        target[i] = reference[6 + k] + gains[0][k] * error + gains[1][k] * lag - rate[3 + k] / mass
        for j in range(momentum.shape[1]):
            matrix[i, j] = momentum[3 + k, j] / mass
    return matrix, target


@kernel(together(MATRIX, VECTOR, VECTOR), VECTOR, VECTOR, INDEX)
def momentum(
    body: tuple[FloatArray, ...], stiffness: FloatArray, reference: FloatArray, axes: IntArray
) -> tuple[FloatArray, FloatArray]:
    """A_G's angular rows and Ldot_d + kp (L_d - L) - Adot_G v, of the axes; reference (6,): L_d, Ldot_d.

    `body` is A_G (6, nv), Adot_G v (6,) and v (nv,).
    """
    matrix, rate, v = body
    rows, target = np.empty((axes.size, matrix.shape[1])), np.empty(axes.size)
    for i in range(axes.size):
        k = axes[i]
        now = 0.0
        for j in range(matrix.shape[1]):
            rows[i, j] = matrix[k, j]
            now += matrix[k, j] * v[j]
        target[i] = reference[3 + k] + stiffness[k] * (reference[k] - now) - rate[k]
    return rows, target


@kernel(VECTOR, WHOLE, WHOLE)
def pressure(reference: FloatArray, start: int, size: int) -> FloatArray:
    """(2, size) over f: how far the centre of pressure of the sole at `start` is from (x_d, y_d), times fz."""
    matrix = np.zeros((2, size))
    matrix[0, start + 2], matrix[0, start + 4] = reference[0], 1.0
    matrix[1, start + 2], matrix[1, start + 3] = reference[1], -1.0
    return matrix


@helper
def rotation_vector(out: FloatArray, rotation: FloatArray) -> None:
    """log(R) into out[:3], axis times angle in [0, pi]; accurate at all angles, as it starts from its largest part."""
    a, e, i = rotation[0], rotation[4], rotation[8]
    w, x, y, z = 1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i
    if w >= x and w >= y and w >= z:
        x, y, z = rotation[7] - rotation[5], rotation[2] - rotation[6], rotation[3] - rotation[1]
    elif x >= y and x >= z:
        w, y, z = rotation[7] - rotation[5], rotation[1] + rotation[3], rotation[2] + rotation[6]
    elif y >= z:
        w, x, z = rotation[2] - rotation[6], rotation[1] + rotation[3], rotation[5] + rotation[7]
    else:
        w, x, y = rotation[3] - rotation[1], rotation[2] + rotation[6], rotation[5] + rotation[7]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * math.atan2(sine, w) / sine if sine > 0.0 else 2.0 if sine == 0.0 else math.nan
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@helper
def turned_back(out: FloatArray, at: int, rotation: FloatArray, vector: FloatArray, i: int) -> None:
    """out[at : at + 3] = R^T vector[i : i + 3]."""
    x, y, z = vector[i], vector[i + 1], vector[i + 2]
    for k in range(3):
        out[at + k] = rotation[k] * x + rotation[3 + k] * y + rotation[6 + k] * z


@helper
def _in_reference(
    goal: FloatArray, own: FloatArray, velocity: FloatArray, reference: FloatArray, asked: tuple[FloatArray, ...]
) -> None:
    """The angular parts of `asked`, error, lag and what is asked for without them, in the reference's axes.

    omega_d x (omega - omega_d) is added (see `FrameTask`).
    """
    error, lag, free = asked
    back, turn, carried, angles = np.empty(9), np.empty(9), np.empty(3), np.empty(3)
    for i in range(3):
        for j in range(3):
            back[3 * i + j] = goal[3 * j + i]
    product_into(turn, back, own)
    rotation_vector(angles, turn)
    x, y, z = reference[7], reference[8], reference[9]
    carried[0] = free[0] + y * velocity[2] - z * velocity[1]
    carried[1] = free[1] + z * velocity[0] - x * velocity[2]
    carried[2] = free[2] + x * velocity[1] - y * velocity[0]
    rotate_into(free, 0, back, carried, 0)
    rotate_into(lag, 0, back, lag.copy(), 0)
    for k in range(3):
        error[k] = -angles[k]


@kernel(together(MATRIX, VECTOR, VECTOR, MATRIX, VECTOR), GAINS, VECTOR, INDEX, WHOLE)
def frame(
    motion: tuple[FloatArray, ...],
    gains: tuple[FloatArray, ...],
    reference: FloatArray,
    selected: IntArray,
    axes: int,
) -> tuple[FloatArray, FloatArray]:
    """Rows and targets of a frame's pose, see `drake_tc.tsid.tasks.frame.FrameTask`.

    Args:
        motion: What `terms.frame_terms` returns.
        gains: (6,) each.
        reference: (19,).
        selected: Which of the six rows.
        axes: WORLD, FRAME or REFERENCE.
    """
    rotation, position, velocity, jacobian, bias = motion
    own, goal, turn = np.empty(9), np.empty(9), np.empty(9)
    for i in range(3):
        for j in range(3):
            own[3 * i + j] = rotation[i, j]
    rotation_of_quaternion(goal, reference)
    # error, lag and what is asked for without them; then into the rows' axes
    error, lag, free, into = np.empty(6), np.empty(6), np.empty(6), np.zeros(9)
    into[0] = into[4] = into[8] = 1.0
    for k in range(3):
        error[3 + k] = reference[4 + k] - position[k]
    for k in range(6):
        lag[k], free[k] = reference[7 + k] - velocity[k], reference[13 + k] - bias[k]
    if axes == REFERENCE:
        _in_reference(goal, own, velocity, reference, (error, lag, free))
        into[:] = goal
    else:
        for i in range(3):
            for j in range(3):
                turn[3 * i + j] = (
                    goal[3 * i] * own[3 * j] + goal[3 * i + 1] * own[3 * j + 1] + goal[3 * i + 2] * own[3 * j + 2]
                )
        rotation_vector(error, turn)
        if axes == FRAME:
            into[:] = own
            for part in range(0, 6, 3):
                for values in (error, lag, free):
                    turned_back(values, part, own, values.copy(), part)
    matrix, target = np.empty((selected.size, jacobian.shape[1])), np.empty(selected.size)
    for i in range(selected.size):
        k = selected[i]
        target[i] = free[k] + gains[0][k] * error[k] + gains[1][k] * lag[k]
        part = k - k % 3
        if axes == WORLD or (axes == REFERENCE and part):
            matrix[i] = jacobian[k]
            continue
        a, b, c = into[k % 3], into[3 + k % 3], into[6 + k % 3]
        for j in range(jacobian.shape[1]):
            matrix[i, j] = a * jacobian[part, j] + b * jacobian[part + 1, j] + c * jacobian[part + 2, j]
    return matrix, target


@helper
def _ceiling(
    q: float, v: float, ends: tuple[float, float], rates: tuple[float, float], period: float
) -> tuple[float, bool]:
    """Upper end of the accelerations of one joint, and whether a limit gave way there; the lower end is its mirror.

    Args:
        q: Position.
        v: Velocity.
        ends: Of position and velocity.
        rates: A and B.
        period: h [s].
    """
    (end, fastest), (most, braking) = ends, rates
    forward = max(v, 0.0)
    stop = forward * forward / (2.0 * braking)
    room = end - q
    beyond = stop - room
    room = max(room, stop)
    rest = room - 0.5 * period * v
    drop = 0.5 * period * braking
    if rest >= 0.0:
        ceiling = (math.sqrt(2.0 * braking * rest + drop * drop) - drop - v) / period
    else:
        ceiling = -v * v / (2.0 * room)
    slower = (fastest - v) / period
    late = -most - slower
    ceiling = min(min(ceiling, max(slower, -most)), most)
    if ceiling != ceiling or v != v or q != q:
        ceiling = math.nan
    return ceiling, beyond > NEGLIGIBLE or late > NEGLIGIBLE / period


@kernel(VECTOR, VECTOR, INDEX, together(VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, REAL))
def viable(
    q: FloatArray, v: FloatArray, places: IntArray, limits: tuple[Any, ...]
) -> tuple[FloatArray, FloatArray, int]:
    """Bounds (n,) on the acceleration of joints, and of how many a limit gave way; see `tsid.limits.viability`.

    Args:
        q: (n,).
        v: (nv,).
        places: (n,) of the joints in v.
        limits: (n,) lower and upper positions, lowest and highest velocities, A; (2 n,) B at the upper ends, then at
            the lower ones; h [s].
    """
    lower, upper, slowest, fastest, most, braking, period = limits
    n, relaxed = q.size, 0
    low, high = np.empty(n), np.empty(n)
    for i in range(n):
        speed = v[places[i]]
        above, gave = _ceiling(q[i], speed, (upper[i], fastest[i]), (most[i], braking[i]), period)
        below, also = _ceiling(-q[i], -speed, (-lower[i], -slowest[i]), (most[i], braking[n + i]), period)
        high[i], low[i] = above, min(-below, above)
        relaxed += gave or also
    return low, high, relaxed
