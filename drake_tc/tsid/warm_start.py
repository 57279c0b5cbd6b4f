"""What one tick tells the next, as numbers of a fixed size, so that it may stand in a Context's discrete state."""

import numpy as np

from drake_tc.tsid.robust.active_set import FREE, ActiveSet
from drake_tc.tsid.robust.solution import Start
from drake_tc.types import FloatArray

_HEAD = 5
_INNER = 8


class WarmStart:
    """[known, rows, weight, held rows, inner size; torque (n); held rows: index, side, multiplier; inner], and back.

    There is room for 2 n + 2 rows that hold a solution and for 8 n numbers of an interior-point method's state; what is
    more than that is left out, which costs the next tick time but not its answer.
    """

    def __init__(self, joints: int) -> None:
        """Lay it out for n joints."""
        self._n = joints
        self._held = 2 * joints + 2
        self._inner = _INNER * joints
        self.size = _HEAD + joints + 3 * self._held + self._inner

    def pack(self, start: Start | None, out: FloatArray) -> None:
        """`start` into out (size,); zeros where there is none."""
        out[:] = 0.0
        if start is None:
            return
        n, room, active_set = self._n, self._held, start.active_set
        out[0], out[1], out[2] = 1.0, start.rows, start.weight
        out[_HEAD : _HEAD + n] = start.torque
        count = active_set.rows.size
        if count <= room:
            out[3] = count
            block = out[_HEAD + n : _HEAD + n + 3 * room].reshape(3, room)
            block[0, :count], block[1, :count], block[2, :count] = (
                active_set.rows,
                active_set.sides,
                active_set.multipliers,
            )
        if start.inner is not None and start.inner.size <= self._inner:
            out[4] = start.inner.size
            out[out.size - self._inner :][: start.inner.size] = start.inner

    def unpack(self, packed: FloatArray) -> Start | None:
        """The `Start` in packed (size,)."""
        if packed[0] != 1.0:
            return None
        n, room, active_set = self._n, self._held, FREE
        _, rows, weight, count, inner = packed[:_HEAD].tolist()
        if count:
            block = packed[_HEAD + n : _HEAD + n + 3 * room].reshape(3, room)[:, : int(count)]
            active_set = ActiveSet(block[0].astype(np.int64), block[1].astype(np.int64), block[2].copy())
        state = packed[packed.size - self._inner :][: int(inner)].copy() if inner else None
        return Start(packed[_HEAD : _HEAD + n].copy(), int(rows), active_set, weight, state)
