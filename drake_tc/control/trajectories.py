"""Reference motions as Drake trajectories, for `TrajectorySource(trajectory, 2)`: [q_d; qdot_d; qddot_d].

References made of others: one after the other, or an orientation together with a place.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from pydrake.polynomial import Polynomial
from pydrake.trajectories import PiecewisePolynomial
from scipy.interpolate import make_interp_spline

from drake_tc.control.references import PointToPoint, Slerp, Swing, meet
from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

SAMPLES_PER_PERIOD = 64
"""Knots a period of a sinusoid: the quintic spline through them misses it by less than 1e-7 of its amplitude."""


def _checked(times: FloatArray | Sequence[float], values: object, fewest: int) -> tuple[FloatArray, FloatArray]:
    t, x = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if t.ndim != 1 or t.size < fewest or not np.all(np.isfinite(t)) or not np.all(np.diff(t) > 0.0):
        raise ParamsError(f"times: expected at least {fewest} finite, increasing times [s], got {t.tolist()}")
    if x.ndim != 2 or x.shape[0] != t.size or x.shape[1] < 1:
        raise ParamsError(f"values: expected shape ({t.size}, n), a row a time, got {x.shape}")
    if not np.all(np.isfinite(x)):
        row = int(np.argmin(np.isfinite(x).all(axis=1)))
        raise ParamsError(f"values: expected finite numbers; row {row} has {x[row].tolist()}")
    return t, x


def _spline(t: FloatArray, x: FloatArray, starts: FloatArray, ends: FloatArray) -> PiecewisePolynomial:
    """Quintic spline (C^4) through x (m, n), with the derivatives `starts`, `ends` (2, n) at its ends."""
    given = ([(1, starts[0]), (2, starts[1])], [(1, ends[0]), (2, ends[1])])
    spline = make_interp_spline(t, x, k=5, bc_type=given)
    rising = np.array([spline(t[:-1], nu=order) / math.factorial(order) for order in range(6)])  # (6, m - 1, n)
    pieces: list[Any] = [np.array([[Polynomial(c)] for c in rising[:, piece].T]) for piece in range(t.size - 1)]
    return PiecewisePolynomial(pieces, t.tolist())


def knot_trajectory(
    times: FloatArray | Sequence[float], values: FloatArray | Sequence[Sequence[float]]
) -> PiecewisePolynomial:
    """Smooth motion through knots: a quintic spline, C^4, at rest (velocity and acceleration 0) at both ends.

    Two knots give the minimum-jerk motion. Before the first and after the last time it stays there. A spline through
    knots that repeat a value swings around it in between.

    Args:
        times: (m,) [s], increasing, m >= 2.
        values: (m, n) [rad].

    Raises:
        ParamsError: times that do not increase, shapes that do not agree, or a value that is not finite.

    Example:
        >>> path = knot_trajectory([0.0, 1.0, 2.0], [[0.0, 0.0], [0.4, -0.2], [0.1, 0.0]])
        >>> path.value(1.0).ravel()
        array([ 0.4, -0.2])
    """
    t, x = _checked(times, values, 2)
    nil = np.zeros((2, x.shape[1]))
    return _spline(t, x, nil, nil)


@dataclass(frozen=True)
class Sinusoid:
    """x(t) = centre + (a0 + a t) sin(2 pi f t): grows from an amplitude a0 (Del Prete et al., 2016, section 3).

    Attributes:
        centre: (n,) [rad].
        amplitude: (n,) a0 [rad].
        growth: (n,) a [rad/s].
        frequency_hz: f > 0 [Hz], of all joints.
        duration: > 0 [s].

    Raises:
        ParamsError: lengths that do not agree, or a number that is not possible.

    Example:
        >>> swing = Sinusoid(centre=(0.0,), amplitude=(0.2,), growth=(0.0,), frequency_hz=0.5, duration=4.0)
        >>> position, velocity, acceleration = swing.at(np.array([0.5]))
        >>> round(float(position[0, 0]), 6)
        0.2
    """

    centre: tuple[float, ...]
    amplitude: tuple[float, ...]
    growth: tuple[float, ...]
    frequency_hz: float
    duration: float

    def __post_init__(self) -> None:
        sizes = {name: len(getattr(self, name)) for name in ("centre", "amplitude", "growth")}
        if len(set(sizes.values())) > 1 or not self.centre:
            raise ParamsError(
                f"sinusoid: expected centre, amplitude and growth of one length, one a joint, got {sizes}"
            )
        for name in ("frequency_hz", "duration"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ParamsError(f"sinusoid.{name}: expected a positive number, got {value!r}")
        if not np.all(np.isfinite([*self.centre, *self.amplitude, *self.growth])):
            raise ParamsError("sinusoid: expected finite centre, amplitude and growth, got one that is not")

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(x, xdot, xddot), each (T, n), at times (T,) [s]."""
        t = np.asarray(time, dtype=np.float64)[:, None]
        w = 2.0 * math.pi * self.frequency_hz
        growth = np.asarray(self.growth)
        size = np.asarray(self.amplitude) + growth * t
        sine, cosine = np.sin(w * t), np.cos(w * t)
        return (
            np.asarray(self.centre) + size * sine,
            growth * sine + size * w * cosine,
            2.0 * growth * w * cosine - size * w * w * sine,
        )


def sinusoid_trajectory(sinusoid: Sinusoid) -> PiecewisePolynomial:
    """The sinusoid as a quintic spline (C^4) that has its velocity and acceleration at both ends.

    It starts and ends in motion: the CommandGuard blends in.

    Args:
        sinusoid: What to follow.

    Example:
        >>> path = sinusoid_trajectory(Sinusoid((0.0,), (0.2,), (0.0,), frequency_hz=0.5, duration=4.0))
        >>> round(float(path.value(0.5)[0, 0]), 4)
        0.2
    """
    count = max(2, math.ceil(sinusoid.duration * sinusoid.frequency_hz * SAMPLES_PER_PERIOD) + 1)
    t = np.linspace(0.0, sinusoid.duration, max(count, 8))
    x, v, a = sinusoid.at(t)
    return _spline(t, x, np.array([v[0], a[0]]), np.array([v[-1], a[-1]]))


def constant_trajectory(values: FloatArray | Sequence[float]) -> PiecewisePolynomial:
    """A posture (n,) [rad], for ever.

    Raises:
        ParamsError: no value, or one that is not finite.

    Example:
        >>> constant_trajectory([0.1, 0.2]).value(5.0).ravel()
        array([0.1, 0.2])
    """
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1 or x.size < 1 or not np.all(np.isfinite(x)):
        raise ParamsError(f"values: expected n finite numbers, got {x.tolist()}")
    column: Any = x[:, None]
    return PiecewisePolynomial(column)


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
