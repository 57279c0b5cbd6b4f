"""The contact forces stay near a reference."""

from collections.abc import Sequence

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows, identity
from drake_tc.tsid.tables import Entry
from drake_tc.tsid.tasks.base import Gains, gains
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray


class ForceTask:
    """f = f_d of the contacts that are active, each component with its weight.

    Reference (K,): f_d of all contacts of the model, active or not, in their axes [N, N m].

    With f_d = 0 and more weight on tangential forces and moments it is the paper's force regularisation.
    """

    def __init__(
        self, model: TsidModel, *, weight: float = 1.0, components: Sequence[float] | None = None, name: str = "force"
    ) -> None:
        """Keep the weights.

        Args:
            model: Of the robot, with contacts.
            weight: Of the task (the paper's w_f).
            components: (6,) weights of [fx fy fz tx ty tz] in every contact (a point takes the first three), or (K,)
                of all contacts, which is what six are of two points; None for ones. They multiply `weight`.
            name: Of the task.

        Raises:
            ParamsError: a model without contacts; weights that are negative, not finite or of another size.
        """
        if not model.contacts:
            raise ParamsError(
                f"task {name!r}: expected a model with contacts; robot {model.robot.name!r} has none here"
            )
        whole: Gains = 1.0 if components is None else np.asarray(components, dtype=float)
        if components is not None and len(components) == 6 != model.force_size:
            whole = np.concatenate([np.asarray(components, dtype=float)[: contact.size] for contact in model.contacts])
        scale = gains(f"task {name!r}: weight", weight, 1)
        self.name, self.reference_size = name, model.force_size
        self.weight = gains(f"task {name!r}: components", whole, model.force_size) * scale

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        entries = contacts.entries
        return Entry("force", entries.size, (entries,), (self.weight[entries],))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        entries = terms.contacts.entries
        return TaskRows(self.name, Parts(force=identity(entries.size)), reference[entries], self.weight[entries])
