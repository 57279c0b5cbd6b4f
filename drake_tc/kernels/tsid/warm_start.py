"""What one tick of robust TSID tells the next, as numbers of a fixed size.

    [known, rows, weight, held rows, inner size; torque (n); held rows: index, side, multiplier (r each); inner (i)]

There is room for r = 2 n + 2 rows that hold a solution and for i = 8 n numbers of an interior-point method's state.
What is more than that is left out, which costs the next tick time but not its answer.
"""

from typing import Any

import numpy as np

from drake_tc.kernels.compiling import INDEX, OUT_VECTOR, REAL, VECTOR, WHOLE, helper, kernel, together
from drake_tc.types import FloatArray, IntArray

KNOWN, ROWS, WEIGHT, HELD, INNER, HEAD = 0, 1, 2, 3, 4, 5
"""Places of the first numbers, and how many there are."""


@helper
def held_room(joints: int) -> int:
    """Most rows that hold a solution."""
    return 2 * joints + 2


@helper
def inner_room(joints: int) -> int:
    """Most numbers of an interior-point method."""
    return 8 * joints


@kernel(WHOLE)
def size(joints: int) -> int:
    """How many numbers there are for n joints."""
    return HEAD + joints + 3 * held_room(joints) + inner_room(joints)


HELD_ROWS = together(INDEX, INDEX, VECTOR)
"""(a,) rows that hold a solution, their sides and their multipliers."""


@kernel(VECTOR, together(WHOLE, REAL), HELD_ROWS, VECTOR, OUT_VECTOR)
def pack(
    torque: FloatArray, known: tuple[int, float], holding: tuple[Any, ...], inner: FloatArray, out: FloatArray
) -> None:
    """A start into its numbers.

    Args:
        torque: (n,) [N m].
        known: How many rows the problem had, weight of the robustness.
        holding: See `HELD_ROWS`.
        inner: (.,) of an interior-point method; empty where there is none.
        out: (size,) written.
    """
    held, sides, multipliers = holding
    n, room = torque.size, held_room(torque.size)
    out[:] = 0.0
    out[KNOWN], out[ROWS], out[WEIGHT] = 1.0, known[0], known[1]
    out[HEAD : HEAD + n] = torque
    if held.size <= room:
        out[HELD] = held.size
        for i in range(held.size):
            at = HEAD + n + i
            out[at], out[at + room], out[at + 2 * room] = held[i], sides[i], multipliers[i]
    if inner.size <= inner_room(n):
        out[INNER] = inner.size
        first = HEAD + n + 3 * room
        out[first : first + inner.size] = inner


@kernel(VECTOR, WHOLE)
def unpack(packed: FloatArray, joints: int) -> tuple[FloatArray, IntArray, IntArray, FloatArray, FloatArray]:
    """Torque (n,), held rows, their sides and multipliers (a,), and what an interior-point method left.

    Args:
        packed: (size,) as `pack` writes them.
        joints: n.
    """
    count, room, first = int(packed[HELD]), held_room(joints), HEAD + joints
    held, sides = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for i in range(count):
        held[i], sides[i] = int(packed[first + i]), int(packed[first + room + i])
    multipliers = packed[first + 2 * room : first + 2 * room + count].copy()
    inner = packed[first + 3 * room : first + 3 * room + int(packed[INNER])].copy()
    return packed[HEAD:first].copy(), held, sides, multipliers, inner
