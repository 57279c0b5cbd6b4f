"""Accelerations and contact forces as what the torques make them (B, the reduced form).

    M vdot + h = S^T tau + J^T f,   J vdot = -Jdot v + a_c

a_c is the contacts' reference acceleration, zero as a rule. With M = L L^T, X = L^-1 J^T, Z = L^-1 S^T, z = L^-1 h:

    (X^T X) f = X^T (z - Z tau) - Jdot v + a_c
    vdot = L^-T (Z tau - z + X f)

Where J loses rank (a knee that is stretched between two feet, a contact given twice), (X^T X) f = b has no or many
solutions. With D the diagonal that makes the diagonal of D X^T X D one, so that no unit matters, and its eigenvalues
lambda_i relative to the largest, f is then D sum_i filter(lambda_i) / lambda_i u_i (u_i^T D b): the force that is
smallest in D^-1 f, of the accelerations that come nearest. filter goes from 0 at RANK_LOST to 1 at RANK_KEPT with
a continuous derivative, so forces move smoothly where rank comes and goes. Forces that cancel each other are then not
free in the reduced form as they are in the full one: make a sole one surface contact rather than points at its corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.kernels.lazy import Kernel
from drake_tc.tsid.assembly import AffineMap, cost_of, polytope_of
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.rows import LimitRows, TaskRows
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray

_CAUSES = Kernel("reduction", "causes")


@dataclass(frozen=True, eq=False)
class Reduced:
    """The problem over the torques alone.

    Attributes:
        causes: y of tau.
        cost: ||D tau - d||^2.
        polytope: lower <= G tau <= upper; bounds on the torques first.
    """

    causes: AffineMap
    cost: LeastSquares
    polytope: Polytope

    @property
    def matrix(self) -> FloatArray:
        """(nv + k + n, n) C of y = C tau + c."""
        causes = self.causes
        return np.concatenate([causes.vdot, causes.force, np.eye(causes.vdot.shape[1])])

    @property
    def offset(self) -> FloatArray:
        """(nv + k + n,) c."""
        causes = self.causes
        return np.concatenate([causes.vdot_offset, causes.force_offset, np.zeros(causes.vdot.shape[1])])

    def full(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The vdot (nv,) and f (k,) that torques (n,) cause."""
        causes = self.causes
        return causes.vdot.dot(torque) + causes.vdot_offset, causes.force.dot(torque) + causes.force_offset


def reduce(
    terms: Terms,
    tasks: Sequence[TaskRows],
    limits: Sequence[LimitRows],
    contact_acceleration: FloatArray | None = None,
) -> Reduced:
    """The tasks' cost and the limits' polytope over the torques.

    Args:
        terms: At the state of all rows.
        tasks: Rows over y.
        limits: Rows over y.
        contact_acceleration: (k,) a_c; None for zero.
    """
    causes = causes_of(terms, contact_acceleration)
    return Reduced(causes, cost_of(tasks, causes), polytope_of(limits, causes))


def causes_of(terms: Terms, contact_acceleration: FloatArray | None = None) -> AffineMap:
    """C and c of y = C tau + c, by its parts; NaN where the terms have some."""
    drift = terms.contact_bias if contact_acceleration is None else terms.contact_bias - contact_acceleration
    return AffineMap(*_CAUSES(terms.mass_matrix, terms.bias, terms.actuated, terms.contact_jacobian, drift))
