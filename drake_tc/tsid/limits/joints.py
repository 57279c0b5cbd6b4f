"""Limits of the joints: torques, and accelerations that keep positions and velocities.

What the drives can give: lower <= tau <= upper.

How fast joints may speed up and brake, their ranges of position and velocity folded in.

Bounds on a joint's acceleration under which it never leaves its range of positions and velocities.

A joint moves from (q, v) with a constant acceleration a for a period h, |a| <= A, and must keep q within [ql, qu] at
every instant and v within [vl, vu], for ever. Towards the upper end:

- It brakes with B = min(A, -vl/h), so that a period of braking never ends below vl, and travels beta(v) = v^2 / (2 B)
  further from v > 0. A state is safe where q + beta(v) <= qu; braking keeps q + beta(v) as it is. Where A h <= -vl no
  state is safe beyond these: nothing stops the joint sooner.
- More acceleration means more position and more velocity at every later instant, and beta grows with v: the a that lead
  to safe states are those up to a ceiling. With room r = qu - q and w = v + h a:
      r >= h v / 2:  w >= 0 from  r - h (v + w)/2 = beta(w),  w = sqrt(2 B (r - h v / 2) + (B h / 2)^2) - B h / 2
      r <  h v / 2:  the joint turns within the period, its turning point at qu:  a = -v^2 / (2 r)
  At a safe state a = -B is among them, so the ceiling is no less.
- The lower end is the mirror image. For v >= 0 it allows a = 0. The ceiling of the upper end is then either >= 0, or
  ends the period with w >= 0, or the joint turns at qu and ends the period with -w <= W = B h, after at most h W / 2
  of the way back; the lower end takes that where  qu - ql >= h W / 2 + W^2 / (2 B_lower).
So the two ends never contradict each other, nor the velocity's bounds nor A, at any state that is safe for both
(viable), and what follows from any choice between the bounds is viable again.

Source: Del Prete, Joint position and velocity bounds in discrete-time acceleration/torque control of robot arms, RA-L
2018, which brakes with A; B is ours, for limits of velocity that one period at A crosses.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.fused import Entry
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import LimitRows, Parts, Terms, identity, selection
from drake_tc.types import FloatArray, IntArray


class TorqueLimit:
    """lower <= tau <= upper [N m], n rows of the identity; an infinite side has no limit."""

    group = "torque"

    def __init__(
        self, joints: Sequence[str], lower: FloatArray, upper: FloatArray, *, name: str = "torque limits"
    ) -> None:
        """Keep the limits.

        Args:
            joints: n names, in the robot's order.
            lower: (n,) [N m].
            upper: (n,) [N m].
            name: Of the limit.

        Raises:
            ParamsError: another number of values, NaN, or a joint whose lower limit is not below its upper one.
        """
        low, high = np.array(lower, dtype=float), np.array(upper, dtype=float)
        if low.shape != (len(joints),) or high.shape != low.shape:
            raise ParamsError(f"{name}: expected {len(joints)} values a side, got {low.shape} and {high.shape}")
        for joint, a, b in zip(joints, low, high, strict=True):
            if not a < b:
                raise ParamsError(f"{name} of {joint!r}: expected lower < upper [N m], got {a:g} and {b:g}")
        self.name = name
        labels = tuple(f"{joint} torque" for joint in joints)
        self._rows = LimitRows(name, self.group, Parts(torque=identity(len(joints))), low, high, labels)

    @classmethod
    def of(cls, robot: Robot, share: float = 1.0) -> "TorqueLimit":
        """`share` of the efforts that the robot file, or else its URDF, allows.

        Raises:
            ParamsError: a share that is not positive, or above 1.
        """
        if not 0.0 < share <= 1.0:
            raise ParamsError(f"torque limits: expected a positive share, 1 at most, got {share:g}")
        effort = share * joint_limits(robot).effort
        return cls(robot.joints, -effort, effort)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        rows = self._rows
        return Entry("bounds", rows.lower.size, (), (rows.lower, rows.upper))

    def rows(self, terms: Terms) -> LimitRows:
        """The same rows at every state."""
        return self._rows


_BOUNDS = Kernel("tsid.rows", "viable")


@dataclass(frozen=True, eq=False)
class JointRange:
    """What n joints may do.

    Attributes:
        joints: Names.
        lower, upper: (n,) positions [rad], infinite where there is no limit.
        velocity_lower, velocity_upper: (n,) [rad/s], infinite where there is no limit.
        acceleration: (n,) A: what every joint can brake and speed up with [rad/s^2].
        period: h, for which an acceleration holds [s].

    Raises:
        ParamsError: a value that is not a number, an empty range, zero velocity not inside its range, acceleration or
            period not positive, or a range so narrow that the joint cannot turn in it within two periods.
    """

    joints: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray
    velocity_lower: FloatArray
    velocity_upper: FloatArray
    acceleration: FloatArray
    period: float

    def __post_init__(self) -> None:
        n = len(self.joints)
        for key in ("lower", "upper", "velocity_lower", "velocity_upper", "acceleration"):
            value = np.array(getattr(self, key), dtype=float)
            if value.shape != (n,):
                raise ParamsError(f"{key}: expected {n} values, one a joint, got shape {value.shape}")
            value.setflags(write=False)
            object.__setattr__(self, key, value)
        if not (np.isfinite(self.period) and self.period > 0.0):
            raise ParamsError(f"period: expected a positive number [s], got {self.period:g}")
        need = np.maximum(_turn(self, upper=True), _turn(self, upper=False))
        for i, joint in enumerate(self.joints):
            if not (np.isfinite(self.acceleration[i]) and self.acceleration[i] > 0.0):
                raise ParamsError(
                    f"acceleration of {joint!r}: expected a positive number, got {self.acceleration[i]:g}"
                )
            low, high = self.velocity_lower[i], self.velocity_upper[i]
            if not low < 0.0 < high:
                raise ParamsError(f"velocities of {joint!r}: expected lower < 0 < upper, got {low:g} and {high:g}")
            low, high = self.lower[i], self.upper[i]
            if not high - low >= need[i]:
                raise ParamsError(
                    f"positions of {joint!r}: expected upper - lower >= {need[i]:.3g} rad, in which it can turn,"
                    f" got {low:g} and {high:g}"
                )


def _turn(limits: JointRange, *, upper: bool) -> FloatArray:
    """(n,) h W / 2 + W^2 / (2 B) with the B of the other end: the room that a joint needs that turns at one end."""
    here, there = _braking(limits)
    if not upper:
        here, there = there, here
    most = here * limits.period
    with np.errstate(all="ignore"):
        return np.asarray(0.5 * limits.period * most + most**2 / (2.0 * there))


def _braking(limits: JointRange) -> tuple[FloatArray, FloatArray]:
    """(n,) B at the upper and at the lower end [rad/s^2]."""
    a, h = limits.acceleration, limits.period
    return np.minimum(a, -limits.velocity_lower / h), np.minimum(a, limits.velocity_upper / h)


class Viability:
    """The bounds of a `JointRange` at any state.

    At a state that is not viable limits give way: the position's first, outwards to where braking with B stops the
    joint; then the velocity's, to what braking with A leaves after a period; the acceleration's A never. So a joint
    beyond its range may not go further out, and is not driven back either: where the task brings it back, the limit
    closes behind it. That this happened is told: by the count of `bounds`, and by `law.Status.RELAXED` of a tick.
    """

    def __init__(self, limits: JointRange) -> None:
        """Keep the constants.

        Args:
            limits: Of n joints.
        """
        ends = limits.lower, limits.upper, limits.velocity_lower, limits.velocity_upper, limits.acceleration
        self._limits = *ends, np.concatenate(_braking(limits)), limits.period
        self._all = np.arange(len(limits.joints))

    @property
    def numbers(self) -> tuple[FloatArray | float, ...]:
        """As `drake_tc.kernels.tsid.rows.viable` takes them, as its limits."""
        return self._limits

    def bounds(
        self, q: FloatArray, v: FloatArray, places: IntArray | None = None
    ) -> tuple[FloatArray, FloatArray, int]:
        """(lower, upper) (n,) for the next period, and the number of joints of which a limit gave way.

        Args:
            q: (n,) positions [rad].
            v: Velocities [rad/s].
            places: (n,) where those of the joints stand in v; None for the joints' own (n,).
        """
        bounds: tuple[FloatArray, FloatArray, int] = _BOUNDS(
            q, v, self._all if places is None else places, self._limits
        )
        return bounds


class AccelerationLimit:
    """lower(q, v) <= vdot of the joints <= upper(q, v), from `Viability`: kept from one viable state to the next.

    At other states the limits of position, velocity and acceleration contradict each other. The position's gives way
    first, then the velocity's, the acceleration's never; the rows say for how many joints (`LimitRows.relaxed`).
    """

    group = "acceleration"

    def __init__(
        self, limits: JointRange, actuated: IntArray, velocities: int, *, name: str = "acceleration limits"
    ) -> None:
        """Prepare the rows.

        Args:
            limits: Of n joints, in the robot's order.
            actuated: (n,) index in v of each.
            velocities: nv of the plant.
            name: Of the limit.
        """
        self.name = name
        self._labels = tuple(f"{joint} acceleration" for joint in limits.joints)
        self._actuated = np.array(actuated, dtype=np.int64)
        self._viability = Viability(limits)
        self._parts = selection(self._actuated, velocities)

    @classmethod
    def of(
        cls,
        model: TsidModel,
        *,
        period: float,
        acceleration: float | FloatArray = 100.0,
        velocity: float | FloatArray | None = None,
        margin: float = 0.0,
    ) -> "AccelerationLimit":
        """The limits of the robot file, or else of its URDF.

        Args:
            model: Of the robot.
            period: Of the controller [s].
            acceleration: [rad/s^2], one for all or (n,).
            velocity: Replaces the robot's [rad/s], one for all or (n,).
            margin: Kept to both ends of the positions [rad].

        Raises:
            ParamsError: a margin that is negative or not finite; else see `JointRange`.
        """
        if not (np.isfinite(margin) and margin >= 0.0):
            raise ParamsError(f"margin: expected a finite number >= 0 [rad], got {margin!r}")
        known, n = joint_limits(model.robot), len(model.robot.joints)
        speed = _each("velocity", known.velocity if velocity is None else velocity, n)
        most = _each("acceleration", acceleration, n)
        ends = known.lower + margin, known.upper - margin
        ranges = JointRange(model.robot.joints, *ends, -speed, speed, most, period)
        return cls(ranges, model.actuated, model.nv)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("viable", self._actuated.size, (self._actuated,), self._viability.numbers)

    def rows(self, terms: Terms) -> LimitRows:
        """N rows; a joint's acceleration each [rad/s^2]."""
        lower, upper, relaxed = self._viability.bounds(terms.joint_position, terms.v, self._actuated)
        return LimitRows(self.name, self.group, self._parts, lower, upper, self._labels, relaxed)


def _each(where: str, value: float | FloatArray, n: int) -> FloatArray:
    """(n,) from one number for all or one a joint."""
    given = np.asarray(value, dtype=float)
    if given.shape not in ((), (n,)):
        raise ParamsError(f"{where}: expected a number or {n} of them, one a joint, got shape {given.shape}")
    return np.broadcast_to(given, (n,))
