"""What one tick tells the next, as numbers of a fixed size, so that it may stand in a Context's discrete state."""

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.robust.active_set import FREE, ActiveSet
from drake_tc.tsid.robust.solution import Start
from drake_tc.types import FloatArray

_SIZE, _PACK, _UNPACK = (Kernel("warm_start", name) for name in ("size", "pack", "unpack"))


class WarmStart:
    """A `Start` as the numbers that `drake_tc.kernels.warm_start` lays out, and back."""

    def __init__(self, joints: int) -> None:
        """Lay it out for n joints."""
        self._n = joints
        self.size = int(_SIZE(joints))

    def pack(self, start: Start | None, out: FloatArray) -> None:
        """`start` into out (size,); zeros where there is none."""
        if start is None:
            out[:] = 0.0
        else:
            inner = out[:0] if start.inner is None else start.inner
            _PACK(start.torque, start.rows, start.weight, *start.active_set, inner, out)

    def unpack(self, packed: FloatArray) -> Start | None:
        """The `Start` in packed (size,)."""
        if packed[0] != 1.0:
            return None
        torque, held, sides, multipliers, inner = _UNPACK(packed, self._n)
        active_set = ActiveSet(held, sides, multipliers) if held.size else FREE
        return Start(torque, int(packed[1]), active_set, float(packed[2]), inner if inner.size else None)
