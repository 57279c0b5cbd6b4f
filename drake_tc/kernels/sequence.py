"""Several kernels, one after the other, in one call. A table contains the memory addresses of their arguments.

A call from Python into a compiled function costs about a microsecond, and more where other code has run in between, as
in a simulation. Here one call replaces several. Addresses do not keep an array alive: the maker of the table
(`drake_tc.kernels.calls`) holds the arrays.
"""

import math
from typing import Any

import numba
import numpy as np
from numba.core import types as numba_types
from numba.extending import intrinsic

from drake_tc.kernels import equations
from drake_tc.kernels.actuator import advance, motors
from drake_tc.kernels.base.pose import outputs
from drake_tc.kernels.calls import (
    ABOVE,
    ADD,
    ADVANCE,
    BASE_OUTPUTS,
    BETWEEN_TICKS,
    COPY,
    COPY_AFTER,
    COPY_BELOW,
    ESTIMATE,
    FILTER,
    GATHER,
    GUARD,
    IMU,
    MOTION,
    MOTORS,
    MULTIPLY,
    RAISE_FLAGS,
    READING,
    REMEMBER,
    SOLVE,
    SPRING_LAW,
    SWING,
    VOTE,
    WRENCHES,
)
from drake_tc.kernels.compiling import OUT_VECTOR, REAL, TABLE, VECTOR, helper, kernel
from drake_tc.kernels.fault_monitor import raise_flags
from drake_tc.kernels.filters import advance as filtered
from drake_tc.kernels.guard import step
from drake_tc.kernels.joint_torque import estimate, motion_torque
from drake_tc.kernels.joint_voting import remember, vote
from drake_tc.kernels.sensors import imu, reading, wrenches
from drake_tc.kernels.series_elastic import law
from drake_tc.kernels.torque_control import solve
from drake_tc.types import FloatArray, IntArray

_step_at, _swinging, _turned = helper(equations.step_at), helper(equations.swinging), helper(equations.turned)


@kernel(REAL, VECTOR, OUT_VECTOR)
def swing(time: float, numbers: FloatArray, out: FloatArray) -> None:
    """`Swing.row`.

    Args:
        time: [s].
        numbers: (11,) axis (3), amplitude [rad], begin [s], rise [s], frequency [rad/s], first quaternion (4).
        out: (10,) [quaternion w x y z; omega; alpha]; written.
    """
    axis, first = (numbers[0], numbers[1], numbers[2]), (numbers[7], numbers[8], numbers[9], numbers[10])
    size, begin, w = numbers[3], numbers[4], numbers[6]
    share, rate, growth = _step_at(time, begin, numbers[5])
    angle = _swinging((size * share, size * rate, size * growth), w, w * (time - begin))
    out[0], out[1], out[2], out[3] = _turned(axis, angle[0], first)
    for k in range(3):
        out[4 + k], out[7 + k] = angle[1] * axis[k], angle[2] * axis[k]


types: Any = numba_types


def _pointer_to(kind: Any) -> Any:
    @intrinsic  # type: ignore[untyped-decorator]
    def pointer(typing: Any, address: Any) -> Any:
        """The address as a pointer."""

        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(kind)(types.int64), code

    return pointer


def _arguments_of(kind: Any) -> Any:
    """How an argument of (n,) and one of (m, n) numbers is read from the row of a call, by its place there."""
    pointer = _pointer_to(kind)

    @helper
    def one(row: IntArray, number: int) -> Any:
        at = 1 + 3 * number
        return numba.carray(pointer(row[at]), (row[at + 1],))

    @helper
    def two(row: IntArray, number: int) -> Any:
        at = 1 + 3 * number
        return numba.carray(pointer(row[at]), (row[at + 1], row[at + 2]))

    return one, two


vector, matrix = _arguments_of(types.float64)
index, table = _arguments_of(types.int64)


@kernel(TABLE, REAL)
def run(calls: IntArray, time: float) -> int:
    """Run the kernels of a table.

    Args:
        calls: (m, 1 + 3 A) for each call its kind, and of each argument the address and the shape.
        time: [s].

    Returns:
        Number of the first call that could not be finished, and must be repeated in Python; m where all were.
    """
    for i in range(calls.shape[0]):
        c = calls[i]
        kind = c[0]
        if kind == COPY:
            given, kept = vector(c, 0), vector(c, 1)
            for k in range(kept.shape[0]):
                kept[k] = given[k]
        elif kind == GATHER:
            source, where, target = vector(c, 0), index(c, 1), vector(c, 2)
            for k in range(where.shape[0]):
                target[k] = source[where[k]]
        elif kind == ADD:
            first, second, both = vector(c, 0), vector(c, 1), vector(c, 2)
            for k in range(both.shape[0]):
                both[k] = first[k] + second[k]
        elif kind == MULTIPLY:
            gains, factor, product = matrix(c, 0), vector(c, 1), vector(c, 2)
            for k in range(product.shape[0]):
                total = 0.0
                for j in range(factor.shape[0]):
                    total += gains[k, j] * factor[j]
                product[k] = total
        elif kind == READING:
            rows, first_tick = matrix(c, 1), index(c, 2)[0]
            tick = max(math.ceil(time / vector(c, 3)[0] - BETWEEN_TICKS), 0) - first_tick
            if rows.shape[0] > 1 and not 0 <= tick < rows.shape[0]:
                return i
            row = tick if rows.shape[0] > 1 else 0
            past, settings = (vector(c, 4), vector(c, 5)), (matrix(c, 6), index(c, 7))
            reading(vector(c, 0), rows[row], past, settings, vector(c, 8))
        elif kind == ESTIMATE:
            given = (vector(c, 0), vector(c, 1), vector(c, 2))
            robot = (table(c, 3), matrix(c, 4), vector(c, 5), vector(c, 6), index(c, 7), table(c, 8), matrix(c, 9))
            estimate(given, robot, vector(c, 10)[0], vector(c, 11))
        elif kind == MOTION:
            motion = (vector(c, 0), vector(c, 1), vector(c, 2), vector(c, 3), vector(c, 4), vector(c, 5))
            motion_torque(motion, (table(c, 6), matrix(c, 7), vector(c, 8)), vector(c, 9), vector(c, 10))
        elif kind == SOLVE:
            inputs = (vector(c, 0), vector(c, 1), vector(c, 2), vector(c, 3), vector(c, 4), vector(c, 5))
            more, tables = (vector(c, 6), vector(c, 7)), (matrix(c, 10), matrix(c, 11), table(c, 12), vector(c, 13))
            solve(inputs + more, index(c, 8), vector(c, 9)[0], tables, vector(c, 14))
        elif kind == GUARD:
            asked = (vector(c, 1), vector(c, 2), vector(c, 3)[0])
            step(vector(c, 0), asked, matrix(c, 4), vector(c, 5), vector(c, 6))
        elif kind == ADVANCE:
            now = (vector(c, 0), vector(c, 1), vector(c, 2), vector(c, 3), vector(c, 4), time)
            models = (table(c, 6), matrix(c, 7), table(c, 8), matrix(c, 9), table(c, 10), vector(c, 11), vector(c, 12))
            if advance(now, models, False, matrix(c, 14), vector(c, 15)):
                return i
        elif kind == FILTER:
            filtered(vector(c, 0), (matrix(c, 1), index(c, 2)), vector(c, 3), vector(c, 4), vector(c, 5))
        elif kind == RAISE_FLAGS:
            checked = (matrix(c, 2), index(c, 3), matrix(c, 4), index(c, 5), index(c, 6)[0], vector(c, 7))
            level = raise_flags((vector(c, 0), vector(c, 1)), checked, vector(c, 8), vector(c, 9))
            vector(c, 10)[0] = level
        elif kind == ABOVE:
            source, limit, higher = vector(c, 0), vector(c, 1)[0], vector(c, 2)
            for k in range(higher.shape[0]):
                higher[k] = 1.0 if source[k] > limit else 0.0
        elif kind == COPY_BELOW:
            given, kept, watched, limit = vector(c, 0), vector(c, 1), vector(c, 2), vector(c, 3)[0]
            for k in range(watched.shape[0]):
                if watched[k] >= limit:
                    return i
            for k in range(kept.shape[0]):
                kept[k] = given[k]
        elif kind == COPY_AFTER:
            given, kept, begins = vector(c, 0), vector(c, 1), time >= vector(c, 2)[0]
            for k in range(kept.shape[0]):
                kept[k] = given[k] if begins else 0.0
        elif kind == SWING:
            if not time <= vector(c, 1)[0]:
                return i
            swing(time, vector(c, 0), vector(c, 2))
        elif kind == MOTORS:
            motors(vector(c, 0), vector(c, 1), table(c, 2), matrix(c, 3), vector(c, 4))
        elif kind == BASE_OUTPUTS:
            outputs(vector(c, 0), index(c, 1)[0], index(c, 2)[0], index(c, 3), vector(c, 4))
        elif kind == VOTE:
            seen, left = (vector(c, 0), vector(c, 1), vector(c, 2)), (vector(c, 3), matrix(c, 4))
            vote(seen, left, matrix(c, 5), vector(c, 6), (vector(c, 7), matrix(c, 8), matrix(c, 9)))
        elif kind == REMEMBER:
            kept_of = (vector(c, 3), matrix(c, 4), vector(c, 5), vector(c, 6), vector(c, 7))
            remember((vector(c, 0), matrix(c, 1)), vector(c, 2)[0], kept_of)
        elif kind == SPRING_LAW:
            read = (vector(c, 0), vector(c, 1), vector(c, 2), vector(c, 3))
            joints = (index(c, 5), matrix(c, 6), matrix(c, 7), matrix(c, 8), vector(c, 9))
            law(read, vector(c, 4), joints, vector(c, 10), matrix(c, 11))
        elif kind == IMU:
            settled, doubts = 1.0 if time >= vector(c, 3)[0] else 0.0, (vector(c, 0), vector(c, 1), vector(c, 2))
            imu(doubts, settled, (vector(c, 4), vector(c, 5)), vector(c, 6), (vector(c, 7), vector(c, 8)))
        elif kind == WRENCHES:
            jumps, told = 1.0 if time >= vector(c, 2)[0] else 0.0, vector(c, 8)
            raw, validated = (vector(c, 0), vector(c, 1)), (vector(c, 5), vector(c, 6), vector(c, 7))
            if not wrenches(raw, jumps, vector(c, 3), vector(c, 4), validated):
                return i
            stood = vector(c, 9)
            for k in range(told.shape[0]):
                told[k] = stood[k] if np.isfinite(stood[k]) else 1.0
    return int(calls.shape[0])
