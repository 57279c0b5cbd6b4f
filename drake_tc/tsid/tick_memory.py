"""What a tick leaves to its outputs and to the next tick, in one array, as the compiled call reads and writes it.

What one tick tells the next, as numbers of a fixed size, so that it may stand in a Context's discrete state.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.robust.active_set import FREE, ActiveSet, Start
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


class PreviousTick(NamedTuple):
    """What a tick knows of the last one.

    Attributes:
        torque: (n,) [N m].
        start: Of its solution.
        falling: `Status.FALLING`.
    """

    torque: FloatArray
    start: Start | None
    falling: float = 0.0


class TickMemory:
    """The layout [tau (n); vdot (nv); f (K); status (11); start] of one tick; zeros are no tick.

    Attributes:
        places: Of "torque", "acceleration", "contact_force" and "status", in this order.
        width: How many numbers these have together.
        falling: Place of `Status.FALLING`.
        size: S, all numbers.
    """

    def __init__(self, joints: int, velocities: int, forces: int, status: int, falling: int) -> None:
        """Lay it out.

        Args:
            joints: n.
            velocities: nv.
            forces: K of all contacts.
            status: Numbers of a status.
            falling: Which of these is `Status.FALLING`.
        """
        sizes = {"torque": joints, "acceleration": velocities, "contact_force": forces, "status": status}
        ends = np.cumsum([0, *sizes.values()]).tolist()
        self.places = {name: slice(first, end) for name, first, end in zip(sizes, ends, ends[1:], strict=False)}
        self._warm = WarmStart(joints)
        self.width: int = ends[-1]
        self.falling = self.places["status"].start + falling
        self.size = self.width + self._warm.size

    def shown(self, memory: FloatArray) -> list[FloatArray]:
        """The parts in `places`, as views of memory (S,)."""
        return [memory[place] for place in self.places.values()]

    def start(self, memory: FloatArray) -> Start | None:
        """What the next tick's solve knows of a tick."""
        return self._warm.unpack(memory[self.width :])

    def previous(self, memory: FloatArray) -> PreviousTick:
        """A tick as the next one knows it."""
        return PreviousTick(memory[self.places["torque"]], self.start(memory), float(memory[self.falling]))

    def packed(self, before: PreviousTick) -> FloatArray:
        """(S,) with what the next tick knows."""
        memory = np.zeros(self.size)
        memory[self.places["torque"]], memory[self.falling] = before.torque, before.falling
        self._warm.pack(before.start, memory[self.width :])
        return memory

    def keep(self, shown: Sequence[FloatArray], start: Start | None, memory: FloatArray) -> None:
        """Write a tick.

        Args:
            shown: The parts in the order of `places`.
            start: For the next tick.
            memory: (S,) written.
        """
        np.concatenate(shown, out=memory[: self.width])
        self._warm.pack(start, memory[self.width :])
