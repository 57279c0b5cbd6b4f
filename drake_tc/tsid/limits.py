"""What the robot must not do: each limit is named rows of inequalities over accelerations, forces and torques.

Joints: torques lower <= tau <= upper, and the accelerations under which a joint never leaves its range of positions and
velocities. Contacts: what the ground can give without them slipping, tilting, twisting or lifting, and the capture
point, where the robot could come to rest, inside the polygon of the contacts.

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

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.tsid.contacts import ActiveContacts, Contact
from drake_tc.tsid.fused import Entry
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import LimitRows, Parts, Terms, identity, selection
from drake_tc.types import GRAVITY, FloatArray, IntArray


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
        """Keep the constants."""
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


Pyramid = Literal["inner", "outer"]


def cone_rows(contact: Contact, pyramid: Pyramid = "inner") -> tuple[FloatArray, FloatArray, FloatArray, list[str]]:
    """Rows of lower <= B f <= upper of one contact, f = [fx fy fz (tx ty tz)] in its axes, z outwards.

    +-fx, +-fy <= m fz              pyramid in the round cone (m = mu / sqrt 2, "inner") or around it (m = mu, "outer")
    fmin <= fz <= fmax
    x_min fz <= -ty <= x_max fz     the centre of pressure (-ty, tx) / fz stays on the sole; surface contacts only,
    y_min fz <=  tx <= y_max fz     as the next ones
    +-tz <= mu_m fz                 [mu_m in m]

    Returns:
        B (11, 6) or (5, 3), lower, upper (11,) or (5,), labels.
    """
    mu = contact.friction * (math.sqrt(0.5) if pyramid == "inner" else 1.0)
    surface = contact.kind == "surface"
    rows = [
        (axis, sign, mu, f"friction {end}{letter}")
        for axis, letter in enumerate("xy")
        for sign, end in ((1.0, "+"), (-1.0, "-"))
    ]
    if surface:
        x_min, x_max, y_min, y_max = contact.sole
        rows += [(4, -1.0, x_max, "pressure +x"), (4, 1.0, -x_min, "pressure -x")]
        rows += [(3, 1.0, y_max, "pressure +y"), (3, -1.0, -y_min, "pressure -y")]
        rows += [(5, sign, contact.moment_friction, f"twist {end}z") for sign, end in ((1.0, "+"), (-1.0, "-"))]
    matrix = np.zeros((len(rows) + 1, 6 if surface else 3))
    lower, upper = np.full(len(rows) + 1, -np.inf), np.zeros(len(rows) + 1)
    for i, (component, sign, reach, _) in enumerate(rows):
        matrix[i, component] = sign
        matrix[i, 2] = -reach
    matrix[-1, 2], lower[-1], upper[-1] = 1.0, contact.minimum_force, contact.maximum_force
    return matrix, lower, upper, [f"{contact.name} {row[3]}" for row in rows] + [f"{contact.name} normal force"]


class WrenchCones:
    """The cones of all contacts that are active: 11 rows a surface contact, 5 a point contact, the same at all states.

    Linear in f; see `cone_rows`. The true twist limit couples tz with the forces off C; the box of `twist` is the
    paper's (Del Prete and Mansard, 2015: mu, mu_moment, fmin, centre of pressure: 11 a foot).
    """

    group = "force"

    def __init__(self, contacts: Sequence[Contact], *, pyramid: Pyramid = "inner", name: str = "contact cones") -> None:
        """Prepare the rows.

        Args:
            contacts: Those of the model, in its order.
            pyramid: Whether the four friction planes are inside the round cone or around it.
            name: Of the limit.

        Raises:
            ParamsError: an unknown pyramid.
        """
        if pyramid not in get_args(Pyramid):
            raise ParamsError(f"pyramid: expected one of {', '.join(get_args(Pyramid))}, got {pyramid!r}")
        self.name = name
        blocks = tuple(cone_rows(contact, pyramid) for contact in contacts)

        @lru_cache(maxsize=256)
        def of(active: tuple[int, ...]) -> LimitRows:
            chosen = [blocks[index] for index in active]
            matrix = np.zeros([sum(block[0].shape[axis] for block in chosen) for axis in (0, 1)])
            row = column = 0
            for block, *_ in chosen:
                matrix[row : row + block.shape[0], column : column + block.shape[1]] = block
                row, column = row + block.shape[0], column + block.shape[1]
            lower, upper = (np.concatenate([np.zeros(0), *(block[side] for block in chosen)]) for side in (1, 2))
            labels = tuple(label for block in chosen for label in block[3])
            return LimitRows(name, WrenchCones.group, Parts(force=matrix), lower, upper, labels)

        self._of = of

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        rows = self._of(contacts.index)
        return Entry("forces", rows.lower.size, (), (rows.matrix.force, rows.lower, rows.upper))

    def rows(self, terms: Terms) -> LimitRows:
        """Of the contacts that are active at this state; the same object while they stay the same."""
        return self._of(terms.contacts.index)


LEAST_HEIGHT = 0.01
"""Of the centre of mass above its contacts; lower ones count as this [m]."""


def convex_hull(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Corners of the convex hull, counter-clockwise, none of them between two others (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered

    def chain(walk: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        kept: list[tuple[float, float]] = []
        for x, y in walk:
            while len(kept) > 1:
                (ax, ay), (bx, by) = kept[-2], kept[-1]
                if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                    break
                kept.pop()
            kept.append((x, y))
        return kept[:-1]

    return chain(ordered) + chain(ordered[::-1])


def half_planes(corners: Sequence[tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    """Unit normals N (r, 2) and d (r,) of N x <= d, inside the hull of the corners; 4 rows for a point or a segment."""
    hull = convex_hull(corners)
    if not hull:
        return np.zeros((0, 2)), np.zeros(0)
    if len(hull) < 3:
        return _around(hull[0], hull[-1])
    normals, reach = [], []
    x, y = hull[-1]
    for next_x, next_y in hull:
        along, across = next_x - x, next_y - y
        length = math.hypot(along, across)
        normal = across / length, -along / length
        normals.append(normal)
        reach.append(normal[0] * x + normal[1] * y)
        x, y = next_x, next_y
    return np.array(normals), np.array(reach)


def _around(one: tuple[float, float], other: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Along and across a segment, or the axes at a point."""
    x, y = other[0] - one[0], other[1] - one[1]
    length = math.hypot(x, y)
    x, y = (x / length, y / length) if length else (1.0, 0.0)
    normals = np.array([[x, y], [-x, -y], [-y, x], [y, -x]])
    return normals, (normals @ np.array([one, other]).T).max(axis=1)


class CapturePointLimit:
    """The capture point after the next period stays `margin` inside the hull of the active contacts, seen from above.

        xi = c + cdot / w,  w^2 = g / z      c, cdot: horizontal place and velocity of the centre of mass, z its height
        xi+ = xi + h cdot + (h^2 / 2 + h / w) cddot,  cddot = J_c vdot + Jdot_c v
        N xi+ <= d - margin                  one row an edge [m]

    Linear in vdot. As xidot = w (xi - p) with the centre of pressure p in the same polygon (linear inverted pendulum),
    a xi inside can be kept inside; one that is outside cannot be brought back but by turning the body, and the problem
    may then have no solution: `infeasible` names the edge. No contact, no rows.

    Source: Del Prete and Mansard, 2015, after Ramos, Mansard and Soueres (Humanoids 2014).
    """

    group = "capture_point"

    def __init__(
        self,
        contacts: Sequence[Contact],
        *,
        period: float,
        margin: float = 0.0,
        gravity: float = GRAVITY,
        name: str = "capture point",
    ) -> None:
        """Keep the numbers.

        Args:
            contacts: Those of the model, in its order.
            period: h: of the controller [s].
            margin: [m].
            gravity: [m/s^2].
            name: Of the limit.

        Raises:
            ParamsError: no contacts, a period or gravity that is not positive, or a margin that is negative or not
                finite.
        """
        for key, value in (("period", period), ("gravity", gravity)):
            if not (math.isfinite(value) and value > 0.0):
                raise ParamsError(f"{name}: {key}: expected a positive number, got {value!r}")
        if not (math.isfinite(margin) and margin >= 0.0):
            raise ParamsError(f"{name}: margin: expected a finite number >= 0 [m], got {margin!r}")
        if not contacts:
            raise ParamsError(f"{name}: expected contacts, over which it is kept, got none")
        self.name = name
        self._period, self._margin, self._gravity = period, margin, gravity
        self._places = tuple((contact.name, contact.corners[:, :2].tolist()) for contact in contacts)
        self._labels = tuple(f"{name} edge {i}" for i in range(4 * len(self._places)))

    def capture_point(self, terms: Terms) -> FloatArray:
        """(2,) xi of this state [m]."""
        _, height = self.corners(terms)
        return np.asarray(terms.com[:2] + terms.com_velocity[:2] / self._rate(terms, height))

    def rows(self, terms: Terms) -> LimitRows:
        """One row an edge of the hull."""
        corners, ground = self.corners(terms)
        normals, reach = half_planes(corners) if math.isfinite(ground) else _unknown()
        rate, h = self._rate(terms, ground), self._period
        gain = 0.5 * h * h + h / rate
        linear = (gain / terms.mass) * terms.momentum_matrix[3:5]
        bias = (gain / terms.mass) * terms.momentum_bias[3:5]
        drift = terms.com[:2] + (h + 1.0 / rate) * terms.com_velocity[:2] + bias
        matrix = normals.dot(linear)
        upper = reach - normals.dot(drift) - self._margin
        return LimitRows(
            self.name, self.group, Parts(vdot=matrix), np.full(len(reach), -np.inf), upper, self._labels[: len(reach)]
        )

    def _rate(self, terms: Terms, ground: float) -> float:
        """W [1/s]."""
        height = float(terms.com[2]) - ground
        return math.sqrt(self._gravity / (height if height > LEAST_HEIGHT else LEAST_HEIGHT))

    def corners(self, terms: Terms) -> tuple[list[tuple[float, float]], float]:
        """Corners of all active contacts from above, and the mean height of their frames [m]."""
        corners: list[tuple[float, float]] = []
        heights, active = 0.0, terms.contacts.index
        for index in active:
            name, places = self._places[index]
            rotation, position = terms.pose(name)
            (xx, xy, _), (yx, yy, _), _ = rotation.tolist()
            px, py, pz = position.tolist()
            corners += [(px + xx * x + xy * y, py + yx * x + yy * y) for x, y in places]
            heights += pz
        return corners, heights / len(active) if active else 0.0


def _unknown() -> tuple[FloatArray, FloatArray]:
    return np.full((1, 2), np.nan), np.full(1, np.nan)
