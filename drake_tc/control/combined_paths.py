"""References made of others: one after the other, or an orientation together with a place."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drake_tc.control.references import PointToPoint, Slerp, Swing, meet
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Chain:
    """One path after the other: that of the pieces which began last, before all of them the first.

    Attributes:
        pieces: In order of time, each where the one before has ended, of one kind.

    Raises:
        ParamsError: no piece, one that begins before the one before has ended or elsewhere, or of another size.

    Example:
        >>> up = PointToPoint((0.0,), (0.2,), begin=0.0, duration=1.0)
        >>> Chain((up, PointToPoint((0.2,), (0.0,), begin=2.0, duration=1.0))).row(4.0)[0].item()
        0.0
    """

    pieces: tuple[PointToPoint | Slerp, ...]

    def __post_init__(self) -> None:
        if not self.pieces or len({piece.size for piece in self.pieces}) > 1:
            raise ParamsError(f"chain: expected pieces of one size, got {[piece.size for piece in self.pieces]}")
        for one, other in pairwise(self.pieces):
            if other.begin < one.begin + one.duration - 1e-9:
                raise ParamsError(
                    f"chain: expected each piece after the one before; {other.begin:g} s is before"
                    f" {one.begin + one.duration:g} s"
                )
            if not meet(one.goal, other.start, turns=isinstance(one, Slerp)):
                raise ParamsError(
                    f"chain: expected each piece where the one before has ended; it ends at {one.goal}, the next begins"
                    f" at {other.start}"
                )

    @property
    def size(self) -> int:
        """That of its pieces."""
        return self.pieces[0].size

    def row(self, time: float) -> FloatArray:
        """That of the piece at `time` [s]."""
        begun = [piece for piece in self.pieces if piece.begin <= time]
        return (begun[-1] if begun else self.pieces[0]).row(time)


@dataclass(frozen=True)
class PosePath:
    """An orientation and a place together: the reference of a `FrameTask`, which `ReferenceSource` feeds to its port.

    Attributes:
        orientation: Of the frame.
        place: Of its origin, three numbers [m].

    Raises:
        ParamsError: a place of other than three numbers.

    Example:
        >>> upright = (1.0, 0.0, 0.0, 0.0)
        >>> place = PointToPoint((0.4, 0.0, 0.5), (0.4, 0.0, 0.7), begin=0.5, duration=1.0)
        >>> hand = PosePath(Swing(upright, (0.0, 0.0, 1.0), amplitude=0.2, frequency_hz=0.5), place)
        >>> hand.size, hand.row(3.0)[4:7].tolist()
        (19, [0.4, 0.0, 0.7])
    """

    orientation: Slerp | Swing
    place: PointToPoint

    def __post_init__(self) -> None:
        if len(self.place.start) != 3:
            raise ParamsError(f"pose: expected a place of three numbers [m], got {len(self.place.start)}")

    @property
    def size(self) -> int:
        """19: see `row`."""
        return 19

    def row(self, time: float) -> FloatArray:
        """[quaternion, p; omega, v; alpha, a] at `time` [s]."""
        turn, place = self.orientation.row(time), self.place.row(time)
        return np.concatenate((turn[:4], place[:3], turn[4:7], place[3:6], turn[7:], place[6:]))
