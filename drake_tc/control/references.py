"""References of points and frames in closed form: from place to place, from one orientation to another, to and fro.

All are three times differentiable in time, before, during and after they move, so that acceleration and its rate have
no jump: s(u) = 35 u^4 - 84 u^5 + 70 u^6 - 20 u^7 goes from 0 to 1 with three derivatives that vanish at both ends. The
paper, which does not print its functions, has "smooth exponential functions".

The step from 0 to 1 that references take, with three derivatives that vanish at both ends, for many samples.

What references refuse: numbers without sense, directions without length, pieces that do not meet.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from drake_tc.control.rotation import rotation_matrix, rotation_vector
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import SWING, KernelCall
from drake_tc.kernels.equations import Quadruple, Triple, orientation_row, step_at, swinging, unit
from drake_tc.types import Call, FloatArray


class Motion(NamedTuple):
    """A motion and its derivatives in time, (T, m) each: places, or angles and their rates in the world."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray


def smooth_step(time: FloatArray, begin: float, duration: float) -> FloatArray:
    """(4, T): s(u) and its first three derivatives in time, u = (t - begin)/duration, 0 before and 1 after.

    Args:
        time: (T,) [s].
        begin: When it starts to rise [s].
        duration: > 0, how long it does [s].
    """
    u = np.clip((np.asarray(time, dtype=np.float64) - begin) / duration, 0.0, 1.0)
    left = 1.0 - u
    value = u**4 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)))
    first = 140.0 * (u * left) ** 3
    second = 420.0 * (u * left) ** 2 * (1.0 - 2.0 * u)
    third = 840.0 * u * left * (1.0 - 5.0 * u * left)
    return np.stack([value, first / duration, second / duration**2, third / duration**3])


SHORTEST = 1e-6
"""Duration [s]: below it, rates are no numbers any more."""
MEETING = 1e-6
"""Ends as near as this are one [m, or parts of a quaternion]."""


def check_times(what: str, numbers: tuple[float, ...], begin: float, duration: float) -> None:
    """Refuse numbers that are not finite and durations below `SHORTEST`.

    Raises:
        ParamsError: as said.
    """
    if not all(map(math.isfinite, (*numbers, begin))):
        raise ParamsError(f"{what}: expected finite numbers, got {numbers} and begin {begin!r}")
    if not (math.isfinite(duration) and duration > 0.0):
        raise ParamsError(f"{what}: expected a positive duration [s], got {duration!r}")
    if duration < SHORTEST:
        raise ParamsError(f"{what}: expected a duration of at least {SHORTEST:g} s, got {duration!r}")


def check_quaternions(what: str, *quaternions: tuple[float, ...]) -> None:
    """Refuse quaternions without direction.

    Raises:
        ParamsError: not four numbers, all zero, or a length that is no number.
    """
    for quaternion in quaternions:
        if len(quaternion) != 4 or not any(quaternion) or not math.isfinite(math.hypot(*quaternion)):
            raise ParamsError(f"{what}: expected a quaternion [w x y z] that is not zero, got {quaternion}")


def meet(one: tuple[float, ...], other: tuple[float, ...], *, turns: bool) -> bool:
    """Whether two ends are one: places by their distance, quaternions up to length and sign.

    Args:
        one: m numbers.
        other: As many.
        turns: Whether these are quaternions [w x y z].
    """
    if not turns:
        return math.dist(one, other) <= MEETING
    first, second = unit(one), unit(other)
    return min(math.dist(first, second), math.dist(first, [-part for part in second])) <= MEETING


class Path(Protocol):
    """A reference as a function of time.

    Attributes:
        size: Of `row`.
    """

    @property
    def size(self) -> int:
        """Of `row`."""
        ...

    def row(self, time: float) -> FloatArray:
        """(size,) what a task follows at `time` [s]."""
        ...


@dataclass(frozen=True)
class PointToPoint:
    """x(t) = x_0 + s(u) (x_1 - x_0), of a point of any size m.

    Attributes:
        start, goal: x_0, x_1, of one length [m].
        begin: [s].
        duration: At least 1 us [s].

    Raises:
        ParamsError: two lengths, a number that is not finite, or a duration that is too short.

    Example:
        >>> PointToPoint((0.0,), (0.2,), begin=1.0, duration=2.0).row(2.0).tolist()  # halfway
        [0.1, 0.21875, 0.0]
    """

    start: tuple[float, ...]
    goal: tuple[float, ...]
    begin: float
    duration: float

    def __post_init__(self) -> None:
        if len(self.start) != len(self.goal) or not self.start:
            raise ParamsError(
                f"point to point: expected start and goal of one length, got {len(self.start)} and {len(self.goal)}"
            )
        check_times("point to point", (*self.start, *self.goal), self.begin, self.duration)

    @property
    def size(self) -> int:
        """3m: place, velocity, acceleration."""
        return 3 * len(self.start)

    def at(self, time: FloatArray) -> Motion:
        """The motion at times (T,) [s]."""
        step = smooth_step(time, self.begin, self.duration)
        way = np.subtract(self.goal, self.start)
        orders = step[:, :, None] * way
        return Motion(self.start + orders[0], orders[1], orders[2], orders[3])

    def row(self, time: float) -> FloatArray:
        """[x; xd; xdd] at `time` [s]: the reference of a centre of mass."""
        way = [one - other for one, other in zip(self.goal, self.start, strict=True)]
        share, rate, growth = step_at(time, self.begin, self.duration)
        place = [first + share * part for first, part in zip(self.start, way, strict=True)]
        return np.array([*place, *(rate * part for part in way), *(growth * part for part in way)])


@dataclass(frozen=True)
class Slerp:
    """From one orientation to another about the axis of their difference: R(t) = exp(s(u) phi) R_0.

    phi = log(R_1 R_0^T), the shorter way, in the world; it stays, so omega = s' phi, alpha = s'' phi.

    Attributes:
        start, goal: Quaternions [w x y z] of R_0 and R_1, of any length but zero.
        begin: [s].
        duration: At least 1 us [s].

    Raises:
        ParamsError: a quaternion without direction, a number that is not finite, or a duration that is too short.

    Example:
        >>> Slerp((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), begin=0.0, duration=2.0).row(5.0)[:4].round(9).tolist()
        [0.0, 0.0, 0.0, 1.0]
    """

    start: tuple[float, float, float, float]
    goal: tuple[float, float, float, float]
    begin: float
    duration: float

    def __post_init__(self) -> None:
        check_times("slerp", (*self.start, *self.goal), self.begin, self.duration)
        check_quaternions("slerp", self.start, self.goal)

    @property
    def size(self) -> int:
        """10: see `row`."""
        return 10

    @cached_property
    def _turn(self) -> FloatArray:
        """(3,) phi [rad]."""
        return rotation_vector(_matrix(self.goal) @ _matrix(self.start).T)

    @cached_property
    def _plain(self) -> tuple[Triple, float, Quadruple]:
        """Axis and angle of phi, and R_0, for `row`."""
        angle = math.hypot(*self._turn.tolist())
        x, y, z = self._turn.tolist() if angle else (0.0, 0.0, 0.0)
        size = angle or 1.0
        return (x / size, y / size, z / size), angle, unit(self.start)

    def at(self, time: FloatArray) -> tuple[FloatArray, Motion]:
        """R_WD (T, 3, 3), and the motion at times (T,): s phi [rad], omega, alpha and its rate in the world."""
        orders = smooth_step(time, self.begin, self.duration)[:, :, None] * self._turn
        return _turned(orders[0], _matrix(self.start)), Motion(*orders)

    def row(self, time: float) -> FloatArray:
        """[quaternion w x y z; omega; alpha] at `time` [s]: the reference of an orientation."""
        axis, angle, first = self._plain
        share, rate, growth = step_at(time, self.begin, self.duration)
        return np.array(orientation_row(axis, (share * angle, rate * angle, growth * angle), first))


@dataclass(frozen=True)
class Swing:
    """To and fro about an axis of the world: R(t) = exp(a(t) n) R_0, a = A s(u) sin(2 pi f (t - begin)).

    s rises from 0 at `begin` to 1 over `rise`, so omega = a' n and alpha = a'' n start from rest without a jump.

    Attributes:
        start: Quaternion [w x y z] of R_0.
        axis: n in the world, of any length but zero.
        amplitude: A [rad].
        frequency_hz: f > 0 [Hz].
        begin: [s].
        rise: At least 1 us [s].

    Raises:
        ParamsError: an axis or a quaternion without direction, or a number that is not possible.

    Example:
        >>> Swing((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0), amplitude=0.3, frequency_hz=0.5).row(0.0).tolist()
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """

    start: tuple[float, float, float, float]
    axis: tuple[float, float, float]
    amplitude: float
    frequency_hz: float
    begin: float = 0.0
    rise: float = 1.0

    def __post_init__(self) -> None:
        check_times("swing", (*self.start, *self.axis, self.amplitude), self.begin, self.rise)
        check_quaternions("swing", self.start)
        if not (math.isfinite(self.frequency_hz) and self.frequency_hz > 0.0):
            raise ParamsError(f"swing: expected a positive frequency_hz, got {self.frequency_hz!r}")
        if not (any(self.axis) and math.isfinite(math.hypot(*self.axis))):
            raise ParamsError(f"swing: expected an axis with a direction, got {self.axis}")

    @property
    def size(self) -> int:
        """10: see `row`."""
        return 10

    def angle(self, time: FloatArray) -> FloatArray:
        """(4, T): a [rad] and its first three derivatives at times (T,) [s]."""
        s = self.amplitude * smooth_step(time, self.begin, self.rise)
        w = 2.0 * math.pi * self.frequency_hz
        phase = w * (np.asarray(time, dtype=np.float64) - self.begin)
        sine, cosine = np.sin(phase), np.cos(phase)
        return np.stack(
            [
                s[0] * sine,
                s[1] * sine + s[0] * w * cosine,
                s[2] * sine + 2.0 * s[1] * w * cosine - s[0] * w**2 * sine,
                s[3] * sine + 3.0 * s[2] * w * cosine - 3.0 * s[1] * w**2 * sine - s[0] * w**3 * cosine,
            ]
        )

    def at(self, time: FloatArray) -> tuple[FloatArray, Motion]:
        """R_WD (T, 3, 3), and the motion at times (T,): a n [rad], omega, alpha and its rate in the world."""
        axis = np.array(self.axis) / math.hypot(*self.axis)
        orders = self.angle(time)[:, :, None] * axis
        return _turned(orders[0], _matrix(self.start)), Motion(*orders)

    @cached_property
    def _plain(self) -> tuple[Triple, Quadruple]:
        """The axis, and R_0, for `row`."""
        (x, y, z), length = self.axis, math.hypot(*self.axis)
        return (x / length, y / length, z / length), unit(self.start)

    def call(self, until: FloatArray, out: FloatArray, later: Call) -> KernelCall:
        """`row` into `out` (10,), as a function of the time [s].

        Args:
            until: (1,) up to which time [s].
            out: Written.
            later: What to call after that time.
        """
        axis, first = self._plain
        numbers = np.array([*axis, self.amplitude, self.begin, self.rise, 2.0 * math.pi * self.frequency_hz, *first])
        return KernelCall(SWING, later, numbers, until, out)

    def row(self, time: float) -> FloatArray:
        """[quaternion w x y z; omega; alpha] at `time` [s]: the reference of an orientation."""
        axis, first = self._plain
        a, (share, rate, growth) = self.amplitude, step_at(time, self.begin, self.rise)
        w = 2.0 * math.pi * self.frequency_hz
        wave = swinging((a * share, a * rate, a * growth), w, w * (time - self.begin))
        return np.array(orientation_row(axis, wave, first))


def _matrix(quaternion: Quadruple) -> FloatArray:
    """(3, 3) of a quaternion of any length: squares of it could be 0 or infinite."""
    return rotation_matrix(np.array(unit(quaternion)))


def _turned(angles: FloatArray, first: FloatArray) -> FloatArray:
    """(T, 3, 3) exp(angles) first, of rotation vectors (T, 3)."""
    half = 0.5 * np.linalg.norm(angles, axis=1, keepdims=True)
    quaternions = np.hstack([np.cos(half), 0.5 * np.sinc(half / math.pi) * angles])
    return np.array([rotation_matrix(quaternion) @ first for quaternion in quaternions])
