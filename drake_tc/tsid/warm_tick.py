"""A whole tick by one compiled call (`drake_tc.kernels.warm_tick`), from where the last tick ended."""

import math
from typing import NamedTuple

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.fused import FusedProblem, WrittenRows
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.robust import convex
from drake_tc.tsid.robust.active_set import ActiveSet
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.measures import BOX_DAMPING, EXACT
from drake_tc.tsid.robust.rectangle import WIDTH
from drake_tc.tsid.robust.solution import Start
from drake_tc.types import FloatArray

_WARM_TICK = Kernel("warm_tick", "warm_tick")
_NONE: FloatArray = np.zeros(0)
_RELAXED = 7
"""`drake_tc.tsid.law.Status.RELAXED`."""


class WarmResult(NamedTuple):
    """A solved tick; see `drake_tc.tsid.tick.Tick`."""

    torque: FloatArray
    acceleration: FloatArray
    force: FloatArray
    status: FloatArray
    start: Start


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
        self._form: FloatArray = np.array((*numbers, options.budget.iterations, largest), dtype=np.float64)
        self._fused, self._joints, self._forces = fused, model.n, model.force_size
        self._inner = measure in ("box", "rectangle")

    @staticmethod
    def solves(formulation: Formulation) -> bool:
        """Whether it is a trade-off by one program, and no clock may end it."""
        one = formulation.use == "trade_off" or formulation.measure == "classic"
        return type(formulation) is Formulation and one and math.isinf(formulation.options.budget.seconds)

    def __call__(
        self, given: FloatArray, contacts: ActiveContacts, written: WrittenRows, start: Start
    ) -> WarmResult | None:
        """The tick; None where there is no problem, or no torque of it by this call alone.

        Args:
            given: (nq + nv + .,) q, v and all references.
            contacts: That carry.
            written: Rows of tasks and limits that are no tables.
            start: Where the last tick ended.
        """
        if start.torque.size != self._joints:
            return None
        sizes = np.array((start.rows, self._forces))
        inner = _NONE if start.inner is None else start.inner
        code, torque, vdot, force, status, rows, sides, multipliers, inner, limits = _WARM_TICK(
            given,
            *self._fused.arguments(contacts, written),
            self._form,
            sizes,
            start.torque,
            *start.active_set,
            inner,
            contacts.entries,
        )
        if code:
            return None
        status[_RELAXED] += written.relaxed
        held = ActiveSet(rows, sides, multipliers)
        return WarmResult(torque, vdot, force, status, Start(torque, limits, held, 0.0, inner if self._inner else None))
