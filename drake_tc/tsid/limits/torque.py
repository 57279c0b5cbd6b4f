"""What the drives can give: lower <= tau <= upper."""

from collections.abc import Sequence

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import joint_limits
from drake_tc.robot.robot import Robot
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.rows import LimitRows, Parts, identity
from drake_tc.tsid.tables import Entry
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray


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
