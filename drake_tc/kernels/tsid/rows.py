"""Rows of the built-in tasks and limits at one state, see `drake_tc.tsid.tasks` and `.limits`.

A table (`drake_tc.tsid.fused` writes it) has a row a task or limit: kind, how many rows, and where its whole numbers,
its numbers and its reference begin. Rows that the library does not know are DENSE: written out over (vdot, f, tau) and
two columns more, which are target and weight of a task, lower and upper side of a limit.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drake_tc.kernels.compiling import INDEX, MATRIX, REAL, VECTOR, WHOLE, helper, inlined, kernel, together
from drake_tc.kernels.dynamics import product_into, rotate_into, rotation_of_quaternion
from drake_tc.kernels.tsid.terms import DENSE, NOTHING, PICKED, Over, frame_terms, over_torques
from drake_tc.types import FloatArray, IntArray

NEGLIGIBLE = 1e-9
"""What rounding may add to a position or a velocity [rad, rad/s]."""
WORLD_AXES, FRAME_AXES, REFERENCE_AXES = 0, 1, 2
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
    """Rows and targets of a frame's pose, see `drake_tc.tsid.tasks.FrameTask`.

    Args:
        motion: What `terms.frame_terms` returns.
        gains: (6,) each.
        reference: (19,).
        selected: Which of the six rows.
        axes: WORLD_AXES, FRAME_AXES or REFERENCE_AXES.
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
    if axes == REFERENCE_AXES:
        _in_reference(goal, own, velocity, reference, (error, lag, free))
        into[:] = goal
    else:
        for i in range(3):
            for j in range(3):
                turn[3 * i + j] = (
                    goal[3 * i] * own[3 * j] + goal[3 * i + 1] * own[3 * j + 1] + goal[3 * i + 2] * own[3 * j + 2]
                )
        rotation_vector(error, turn)
        if axes == FRAME_AXES:
            into[:] = own
            for part in range(0, 6, 3):
                for values in (error, lag, free):
                    turned_back(values, part, own, values.copy(), part)
    matrix, target = np.empty((selected.size, jacobian.shape[1])), np.empty(selected.size)
    for i in range(selected.size):
        k = selected[i]
        target[i] = free[k] + gains[0][k] * error[k] + gains[1][k] * lag[k]
        part = k - k % 3
        if axes == WORLD_AXES or (axes == REFERENCE_AXES and part):
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


KIND, ROWS, INTEGERS, NUMBERS, REFERENCE = 0, 1, 2, 3, 4
"""Columns of a table."""
WRITTEN_OUT = 0
COM, POSTURE, FRAME, ORIENTATION, FORCE, TORQUE, MOMENTUM, PRESSURE = 1, 2, 3, 4, 5, 6, 7, 8
BOUNDS, FORCES, VIABLE = 1, 2, 3
"""Kinds of tasks, and of limits; `WRITTEN_OUT` is of both."""


class Given(NamedTuple):
    """Of one tick: the state, the joints' places in q, what the tables point into, and rows that are written out.

    The latter are (., nv + k + n + 2).
    """

    q: FloatArray
    v: FloatArray
    positions: IntArray
    references: FloatArray
    integers: IntArray
    numbers: FloatArray
    dense: FloatArray


class Body(NamedTuple):
    """What rows need of the terms, and of the robot's tables (`terms.Robot`)."""

    robot: tuple[Any, ...]
    bodies: FloatArray
    mass: float
    com: FloatArray
    com_velocity: FloatArray
    momentum: FloatArray
    rate: FloatArray


@helper
def over(kinds: tuple[int, int, int], vdot: FloatArray, picks: IntArray, force: FloatArray, torque: FloatArray) -> Over:
    """Rows by their parts."""
    given = np.empty(3, dtype=np.int64)
    given[0], given[1], given[2] = kinds
    return Over(given, vdot, picks, force, torque)


@inlined
def parts_of_dense(given: Given, first: int, count: int, sizes: tuple[int, int, int]) -> Over:
    """Rows that are written out."""
    nv, k, n = sizes
    whole = given.dense[first : first + count]
    return over(
        (DENSE, DENSE, DENSE),
        whole[:, :nv].copy(),
        np.zeros(0, dtype=np.int64),
        whole[:, nv : nv + k].copy(),
        whole[:, nv + k : nv + k + n].copy(),
    )


@inlined
def frame_rows(given: Given, body: Body, row: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Matrix over vdot and target of a frame's pose or of its orientation alone."""
    first, at, start = row[INTEGERS], row[NUMBERS], row[REFERENCE]
    index, axes = given.integers[first], given.integers[first + 1]
    selected = given.integers[first + 2 : first + 2 + count]
    motion = frame_terms(given.q, body.robot, body.bodies, index, given.v.size)
    reference = np.zeros(19)
    if row[KIND] == FRAME:
        reference[:] = given.references[start : start + 19]
    else:
        reference[:4] = given.references[start : start + 4]
        reference[7:10] = given.references[start + 4 : start + 7]
        reference[13:16] = given.references[start + 7 : start + 10]
    gains = given.numbers[at : at + 6], given.numbers[at + 6 : at + 12]
    found: tuple[FloatArray, FloatArray] = frame(motion, gains, reference, selected, axes)
    return found


@inlined
def task_of(
    given: Given, body: Body, row: IntArray, sizes: tuple[int, int, int]
) -> tuple[Over, FloatArray, FloatArray]:
    """Rows, targets and weights of a task."""
    kind, count, first, at, start = row[KIND], row[ROWS], row[INTEGERS], row[NUMBERS], row[REFERENCE]
    integers, numbers, references = given.integers, given.numbers, given.references
    none, nowhere, target = np.zeros((0, 0)), np.zeros(0, dtype=np.int64), np.zeros(count)
    rows, skip = over((NOTHING, NOTHING, NOTHING), none, nowhere, none, none), 0
    if count == 0:
        return rows, target, target.copy()
    if kind == COM:
        axes, skip = integers[first : first + count], 6
        gains = numbers[at : at + 3], numbers[at + 3 : at + 6]
        goal = references[start : start + 9]
        whole = body.momentum, body.rate, body.mass, body.com, body.com_velocity
        matrix, target = com(whole, gains, goal, axes)
        rows = over((DENSE, NOTHING, NOTHING), matrix, nowhere, none, none)
    elif kind == POSTURE:
        joints, positions = integers[first : first + count], integers[first + count : first + 2 * count]
        picks, skip = integers[first + 2 * count : first + 3 * count], 2 * count
        gains, n = (numbers[at : at + count], numbers[at + count : at + 2 * count]), sizes[2]
        target = posture(given.q, given.v, (joints, positions, picks), gains, references[start : start + 3 * n])
        rows = over((PICKED, NOTHING, NOTHING), none, picks.copy(), none, none)
    elif FRAME <= kind <= ORIENTATION:
        matrix, target = frame_rows(given, body, row, count)
        rows, skip = over((DENSE, NOTHING, NOTHING), matrix, nowhere, none, none), 12
    elif kind == FORCE:
        for i in range(count):
            target[i] = references[start + integers[first + i]]
        rows = over((NOTHING, PICKED, NOTHING), none, nowhere, none, none)
    elif kind == TORQUE:
        target[:] = references[start : start + count]
        rows = over((NOTHING, NOTHING, PICKED), none, nowhere, none, none)
    elif kind == MOMENTUM:
        axes, skip = integers[first : first + count], 3
        goal = references[start : start + 6]
        matrix, target = momentum((body.momentum, body.rate, given.v), numbers[at : at + 3], goal, axes)
        rows = over((DENSE, NOTHING, NOTHING), matrix, nowhere, none, none)
    elif kind == PRESSURE:
        matrix = pressure(references[start : start + 2], integers[first], sizes[1])
        rows = over((NOTHING, DENSE, NOTHING), none, nowhere, matrix, none)
    else:
        rows = parts_of_dense(given, first, count, sizes)
        last = given.dense.shape[1]
        target[:] = given.dense[first : first + count, last - 2]
        return rows, target, given.dense[first : first + count, last - 1].copy()
    return rows, target, numbers[at + skip : at + skip + count].copy()


@inlined
def limit_of(given: Given, row: IntArray, sizes: tuple[int, int, int]) -> tuple[Over, FloatArray, FloatArray, int]:
    """Rows and sides of a limit, and for how many a limit gave way."""
    kind, count, first, at = row[KIND], row[ROWS], row[INTEGERS], row[NUMBERS]
    numbers, k = given.numbers, sizes[1]
    none, nowhere = np.zeros((0, 0)), np.zeros(0, dtype=np.int64)
    if kind == BOUNDS:
        rows = over((NOTHING, NOTHING, PICKED), none, nowhere, none, none)
        return rows, numbers[at : at + count].copy(), numbers[at + count : at + 2 * count].copy(), 0
    if kind == FORCES:
        end = at + count * k
        matrix = numbers[at:end].copy().reshape(count, k)
        rows = over((NOTHING, DENSE, NOTHING), none, nowhere, matrix, none)
        return rows, numbers[end : end + count].copy(), numbers[end + count : end + 2 * count].copy(), 0
    if kind == VIABLE:
        q, picks = np.empty(count), given.integers[first : first + count]
        for i in range(count):
            q[i] = given.q[given.positions[i]]
        parts = numbers[at : at + 7 * count]
        ends = parts[:count], parts[count : 2 * count], parts[2 * count : 3 * count], parts[3 * count : 4 * count]
        braking = parts[4 * count : 5 * count], parts[5 * count :], numbers[at + 7 * count]
        lower, upper, relaxed = viable(q, given.v, picks, ends + braking)
        return over((PICKED, NOTHING, NOTHING), none, picks.copy(), none, none), lower, upper, relaxed
    rows, last = parts_of_dense(given, first, count, sizes), given.dense.shape[1]
    lower = given.dense[first : first + count, last - 2].copy()
    return rows, lower, given.dense[first : first + count, last - 1].copy(), 0


@inlined
def reduced_tasks(
    given: Given, body: Body, table: IntArray, motion: FloatArray, push: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """D and d of ||D tau - d||^2."""
    sizes = given.v.size, push.shape[0], motion.shape[1] - 1
    size = 0
    for i in range(table.shape[0]):
        size += table[i, ROWS]
    matrix, right, start = np.empty((size, sizes[2])), np.empty(size), 0
    for i in range(table.shape[0]):
        rows, target, weight = task_of(given, body, table[i], sizes)
        out = over_torques(rows, target.size, motion, push)
        for k in range(target.size):
            right[start + k] = weight[k] * (target[k] - out[k, sizes[2]])
            for j in range(sizes[2]):
                matrix[start + k, j] = weight[k] * out[k, j]
        start += target.size
    return matrix, right


@inlined
def reduced_limits(
    given: Given, table: IntArray, motion: FloatArray, push: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """G and both sides of lower <= G tau <= upper, and for how many rows a limit gave way."""
    sizes = given.v.size, push.shape[0], motion.shape[1] - 1
    size, relaxed = 0, 0
    for i in range(table.shape[0]):
        size += table[i, ROWS]
    matrix, low, high, start = np.empty((size, sizes[2])), np.empty(size), np.empty(size), 0
    for i in range(table.shape[0]):
        rows, lower, upper, gave = limit_of(given, table[i], sizes)
        out = over_torques(rows, lower.size, motion, push)
        for k in range(lower.size):
            low[start + k], high[start + k] = lower[k] - out[k, sizes[2]], upper[k] - out[k, sizes[2]]
            for j in range(sizes[2]):
                matrix[start + k, j] = out[k, j]
        start += lower.size
        relaxed += gave
    return matrix, low, high, relaxed
