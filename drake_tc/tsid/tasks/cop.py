"""The centre of pressure of a sole stays near a reference point."""

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows
from drake_tc.tsid.tables import Entry
from drake_tc.tsid.tasks.base import Gains, gains
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray

_ROWS = Kernel("rows", "pressure")


class CopTask:
    """x_d fz + ty = 0 and y_d fz - tx = 0 of one surface contact: its centre of pressure (-ty, tx) / fz is (x_d, y_d).

    Linear in f: the rows are the distance to the reference point times fz [N m]. Without rows while the contact is off.
    Reference (2,): [x_d; y_d] in the contact's frame [m].
    """

    reference_size = 2

    def __init__(self, model: TsidModel, contact: str, *, weight: Gains = 1.0, name: str | None = None) -> None:
        """Keep the weights.

        Args:
            model: Of the robot.
            contact: A surface contact of the model.
            weight: Of x and y, or one for both.
            name: Of the task; None for "<contact> pressure".

        Raises:
            ParamsError: a contact that is not there or is a point; weights that are negative, not finite or of
                another size.
        """
        self.name = f"{contact} pressure" if name is None else name
        surfaces = {item.name: i for i, item in enumerate(model.contacts) if item.kind == "surface"}
        if contact not in surfaces:
            raise ParamsError(
                f"task {self.name!r}: no surface contact {contact!r}; possible: {', '.join(surfaces) or 'none'}"
            )
        self._index = surfaces[contact]
        self.weight = gains(f"task {self.name!r}: weight", weight, 2)
        self._none = np.zeros(0)

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        if self._index not in contacts.index:
            return Entry("pressure", 0, (0,), ())
        start = contacts.rows[contacts.index.index(self._index)].start
        return Entry("pressure", 2, (start,), (self.weight,))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        active = terms.contacts
        if self._index not in active.index:
            return TaskRows(self.name, Parts(force=np.zeros((0, active.size))), self._none, self._none)
        start = active.rows[active.index.index(self._index)].start
        matrix = _ROWS(reference, start, active.size)
        return TaskRows(self.name, Parts(force=matrix), np.zeros(2), self.weight)
