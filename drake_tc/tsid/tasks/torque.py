"""The torques stay near a reference."""

import numpy as np

from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows, identity
from drake_tc.tsid.tables import Entry
from drake_tc.tsid.tasks.base import Gains, gains
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray


class TorqueTask:
    """tau = tau_d, each joint with its weight; with tau_d = 0 the cost of torques of Faraji et al. (2015), Q_tau =
    weight^2.

    Reference (n,): tau_d in the robot's order [N m].
    """

    def __init__(self, model: TsidModel, *, weight: Gains = 1.0, name: str = "torque") -> None:
        """Keep the weights.

        Args:
            model: Of the robot.
            weight: Of each joint, or one for all.
            name: Of the task.

        Raises:
            ParamsError: weights that are negative, not finite or of another size.
        """
        self.name, self.reference_size = name, model.n
        self.weight = gains(f"task {name!r}: weight", weight, model.n)
        self._parts = Parts(torque=identity(model.n))

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("torque", self.weight.size, (), (self.weight,))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        return TaskRows(self.name, self._parts, reference, self.weight)
