"""Centroidal tasks: centre of mass and angular momentum.

The centre of mass follows a point.

The angular momentum about the centre of mass follows a reference.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.rows import Parts, TaskRows, Terms
from drake_tc.tsid.tables import Entry
from drake_tc.tsid.tasks.base import Gains, axes, gains
from drake_tc.types import FloatArray

_ROWS = Kernel("tsid.rows", "com")


class ComTask:
    """J_com vdot + Jdot_com v = xdd_d + kp (x_d - x) + kd (xd_d - xd), in world axes; the masked axes of them.

    Reference (9,): [x_d; xd_d; xdd_d] [m, m/s, m/s^2].
    """

    reference_size = 9

    def __init__(
        self, kp: Gains, kd: Gains, *, weight: Gains = 1.0, mask: Sequence[bool] | None = None, name: str = "com"
    ) -> None:
        """Keep the gains.

        Args:
            kp: Of each axis, or one for all [1/s^2].
            kd: The same [1/s].
            weight: Of each axis, or one for all.
            mask: Which of x, y, z take part; None for all.
            name: Of the task.

        Raises:
            ParamsError: gains or weights that are negative, not finite or of another size; a mask without an axis.
        """
        self.name = name
        self._kp, self._kd = gains(f"task {name!r}: kp", kp, 3), gains(f"task {name!r}: kd", kd, 3)
        self._axes = axes(f"task {name!r}: mask", mask, 3)
        weights = gains(f"task {name!r}: weight", weight, 3)
        self.weight = weights[self._axes]

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.concatenate((terms.com, np.zeros(6)))

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("com", self._axes.size, (self._axes,), (self._kp, self._kd, self.weight))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        state = terms.momentum_matrix, terms.momentum_bias, terms.mass, terms.com, terms.com_velocity
        matrix, target = _ROWS(state, (self._kp, self._kd), reference, self._axes)
        return TaskRows(self.name, Parts(vdot=matrix), target, self.weight)


_MOMENTUM_ROWS = Kernel("tsid.rows", "momentum")


class AngularMomentumTask:
    """A_G vdot + Adot_G v = Ldot_d + kp (L_d - L), the angular rows, in world axes; the masked axes of them.

    Reference (6,): [L_d; Ldot_d] [N m s, N m].
    """

    reference_size = 6

    def __init__(
        self,
        kp: Gains,
        *,
        weight: Gains = 1.0,
        mask: Sequence[bool] | None = None,
        name: str = "angular momentum",
    ) -> None:
        """Keep the gains.

        Args:
            kp: Of each axis, or one for all [1/s].
            weight: Of each axis, or one for all.
            mask: Which of x, y, z take part; None for all.
            name: Of the task.

        Raises:
            ParamsError: gains or weights that are negative, not finite or of another size; a mask without an axis.
        """
        self.name = name
        self._kp = gains(f"task {name!r}: kp", kp, 3)
        self._axes = axes(f"task {name!r}: mask", mask, 3)
        weights = gains(f"task {name!r}: weight", weight, 3)
        self.weight = weights[self._axes]

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("momentum", self._axes.size, (self._axes,), (self._kp, self.weight))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        state = terms.momentum_matrix, terms.momentum_bias, terms.v
        matrix, target = _MOMENTUM_ROWS(state, self._kp, reference, self._axes)
        return TaskRows(self.name, Parts(vdot=matrix), target, self.weight)
