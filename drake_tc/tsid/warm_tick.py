"""A whole tick by one compiled call (`drake_tc.kernels.warm_tick`), from where the last tick ended."""

import math

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.fused import FusedProblem, WrittenRows
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.robust import convex
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.measures import BOX_DAMPING, EXACT
from drake_tc.tsid.robust.rectangle import WIDTH
from drake_tc.types import FloatArray

_WARM_TICK = Kernel("warm_tick", "warm_tick")
_FOUND = 0
"""As `drake_tc.kernels.problem` has it."""
_RELAXED = 7
"""`drake_tc.tsid.law.Status.RELAXED`."""


class WarmTick:
    """One compiled call a tick; holds constants alone, so that many contexts share it."""

    def __init__(self, fused: FusedProblem, formulation: Formulation, model: TsidModel, largest: float) -> None:
        """Prepare the constants.

        Args:
            fused: The problem of a tick.
            formulation: One that this `solves`.
            model: Of the robot.
            largest: R that a status shows for an infinite one.
        """
        measure, options = formulation.measure, formulation.options
        weight = 0.0 if measure == "classic" else formulation.weight
        boxed, kind = measure == "box", convex.RECTANGLE if measure == "rectangle" else convex.PLAIN
        weights = (0.0, weight) if boxed else (weight, 0.0)
        accuracy, exact = options.accuracy * weight, EXACT if measure == "classic" else 0.0
        numbers = kind, *weights, BOX_DAMPING * weights[1], WIDTH, accuracy, exact
        ends = options.budget.iterations, largest, model.force_size
        self._form: FloatArray = np.array((*numbers, *ends), dtype=np.float64)
        self._fused, self._relaxed = fused, model.n + model.nv + model.force_size + _RELAXED

    @staticmethod
    def solves(formulation: Formulation) -> bool:
        """Whether it is a trade-off by one program, and no clock may end it."""
        one = formulation.use == "trade_off" or formulation.measure == "classic"
        return type(formulation) is Formulation and one and math.isinf(formulation.options.budget.seconds)

    def __call__(
        self,
        given: FloatArray,
        contacts: ActiveContacts,
        written: WrittenRows,
        before: FloatArray,
        after: FloatArray,
    ) -> bool:
        """The tick; False where there is no problem, or no torque of it by this call alone.

        Args:
            given: (nq + nv + .,) q, v and all references.
            contacts: That carry.
            written: Rows of tasks and limits that are no tables.
            before: (S,) what the last tick left, as `TickMemory` lays it out.
            after: (S,) the same of this tick, written where there is one.
        """
        robot = self._fused.arguments(contacts, written)
        code: int = _WARM_TICK(given, *robot, self._form, contacts.entries, before, after)
        if code == _FOUND and written.relaxed:
            after[self._relaxed] += written.relaxed
        return code == _FOUND
