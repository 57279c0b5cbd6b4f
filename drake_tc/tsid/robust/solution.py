"""What a formulation of robust TSID hands back."""

from typing import NamedTuple

from drake_tc.tsid.qp.problem import Outcome
from drake_tc.tsid.robust.active_set import ActiveSet
from drake_tc.types import FloatArray, IntArray


class Start(NamedTuple):
    """What the next tick's solve may know of this one; a change of the contacts makes only a part of it useless.

    Attributes:
        torque: (n,) [N m].
        rows: How many rows the problem had, for which `active_set` is meant.
        active_set: Rows that held the solution.
        weight: Of the robustness where a constraint R <= R_min chose it; 0 elsewhere.
        inner: The box: half width (1,) of "box", sides (2 r,) [sigma] of "rectangle" and the rows (m,) at which x
            itself is held; None elsewhere.
    """

    torque: FloatArray
    rows: int
    active_set: ActiveSet
    weight: float = 0.0
    inner: FloatArray | None = None


class RobustSolution(NamedTuple):
    """A torque and how safe it is.

    Attributes:
        torque: (n,) [N m]; finite whatever the outcome.
        robustness: R = -log p of the formulation's own approximation of p (R_ind, R_rect, R_box); 0 for "classic".
        p_ind: Product of the probabilities of all sides (Del Prete and Mansard, 2015, eq. 7) at the torque,
            whatever the formulation's measure.
        cost: ||D tau - d||^2.
        active: (m,) 1 at the upper side, -1 at the lower side, 0 elsewhere.
        outcome: SOLVED where the torque keeps every limit, and R <= R_min where that was asked for; RISKY where it
            keeps the limits alone.
        converged: Whether the accuracy was reached within the budget.
        iterations: Steps of Newton's method.
        programs: Steps that needed the QP solver.
        start: For the next tick.
    """

    torque: FloatArray
    robustness: float
    p_ind: float
    cost: float
    active: IntArray
    outcome: Outcome
    converged: bool
    iterations: int
    programs: int
    start: Start | None
