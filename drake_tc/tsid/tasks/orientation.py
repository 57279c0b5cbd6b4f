"""A frame of the robot follows a reference orientation, wherever it is."""

from collections.abc import Sequence

import numpy as np

from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import TaskRows
from drake_tc.tsid.tables import Entry
from drake_tc.tsid.tasks.base import Gains, axes, gains
from drake_tc.tsid.tasks.frame import Axes, FrameTask
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray

_PLACES = np.array([0, 1, 2, 3, 7, 8, 9, 13, 14, 15])


class OrientationTask:
    """The angular rows of a `FrameTask`: alpha = alpha_d + kp log(R_d R^T) + kd (omega_d - omega), or as it says.

    Reference (10,): [quaternion wxyz; omega_d; alpha_d] in the world [rad/s, rad/s^2].
    """

    reference_size = 10

    def __init__(
        self,
        model: TsidModel,
        frame: str,
        kp: Gains,
        kd: Gains,
        *,
        weight: Gains = 1.0,
        mask: Sequence[bool] | None = None,
        axes_of: Axes = "world",
        name: str | None = None,
    ) -> None:
        """Keep the gains.

        Args:
            model: Of the robot.
            frame: A link, a contact or a frame that the model was given.
            kp: Of each of the three rows, or one for all [1/s^2].
            kd: The same [1/s].
            weight: Of each row, or one for all.
            mask: Which of the three rows take part; None for all.
            axes_of: In whose axes the rows stand.
            name: Of the task; None for the frame's.

        Raises:
            ParamsError: see `FrameTask`.
        """
        name = frame if name is None else name
        where, still = f"task {name!r}", np.zeros(3)
        chosen = axes(f"{where}: mask", mask, 3)
        rows = np.zeros(6, dtype=bool)
        rows[chosen] = True
        whole = (
            np.concatenate((gains(f"{where}: {key}", value, 3), still))
            for key, value in (("kp", kp), ("kd", kd), ("weight", weight))
        )
        self._task = FrameTask(
            model,
            frame,
            next(whole),
            next(whole),
            weight=next(whole),
            mask=rows.tolist(),
            axes_of=axes_of,
            name=name,
        )
        self.name, self.weight = name, self._task.weight

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        reference: FloatArray = self._task.rest(terms)[_PLACES]
        return reference

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return self._task.compiled_entry(contacts)._replace(kind="orientation")

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        full = np.zeros(FrameTask.reference_size)
        full[_PLACES] = reference
        return self._task.rows(terms, full)
