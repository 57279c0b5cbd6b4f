"""How fast joints may speed up and brake, their ranges of position and velocity folded in."""

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.limits.viability import JointRange, Viability
from drake_tc.tsid.rows import LimitRows, selection
from drake_tc.tsid.tables import Entry
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray, IntArray


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
        robot: Robot,
        actuated: IntArray,
        velocities: int,
        *,
        period: float,
        acceleration: float | FloatArray = 100.0,
        velocity: float | FloatArray | None = None,
        margin: float = 0.0,
    ) -> "AccelerationLimit":
        """The limits of the robot file, or else of its URDF.

        Args:
            robot: From `load_robot`.
            actuated: (n,) index in v of each joint.
            velocities: nv of the plant.
            period: Of the controller [s].
            acceleration: [rad/s^2], one for all or (n,).
            velocity: Replaces the robot's [rad/s], one for all or (n,).
            margin: Kept to both ends of the positions [rad].

        Raises:
            ParamsError: a margin that is negative or not finite; else see `JointRange`.
        """
        if not (np.isfinite(margin) and margin >= 0.0):
            raise ParamsError(f"margin: expected a finite number >= 0 [rad], got {margin!r}")
        known, n = joint_limits(robot), len(robot.joints)
        speed = _each("velocity", known.velocity if velocity is None else velocity, n)
        most = _each("acceleration", acceleration, n)
        ends = known.lower + margin, known.upper - margin
        return cls(JointRange(robot.joints, *ends, -speed, speed, most, period), actuated, velocities)

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
