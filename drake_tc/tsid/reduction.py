"""Accelerations and contact forces as what the torques make them (B, the reduced form).

    M vdot + h = S^T tau + J^T f,   J vdot = -Jdot v + a_c

a_c is the contacts' wanted acceleration, zero as a rule. With M = L L^T, X = L^-1 J^T, Z = L^-1 S^T, z = L^-1 h:

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
from typing import Any

import numpy as np
from scipy.linalg.blas import dgemm
from scipy.linalg.lapack import dpotrf, dtrtri

from drake_tc.tsid.assembly import Map, cost_of, polytope_of
from drake_tc.tsid.polytope import LeastSquares, Polytope
from drake_tc.tsid.rows import LimitRows, TaskRows
from drake_tc.tsid.terms import Terms
from drake_tc.types import FloatArray

RANK_LOST, RANK_KEPT = 1e-8, 1e-6
"""Relative eigenvalues of the scaled J M^-1 J^T: below the first a direction is dropped, above the second kept."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """The problem over the torques alone.

    Attributes:
        causes: y of tau.
        cost: ||D tau - d||^2.
        polytope: lower <= G tau <= upper; bounds on the torques first.
    """

    causes: Map
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


def causes_of(terms: Terms, contact_acceleration: FloatArray | None = None) -> Map:
    """C and c of y = C tau + c, by its parts; NaN where the terms have some."""
    n, k, nv = terms.actuated.size, terms.contact_bias.size, terms.bias.size
    inverse = _inverse_factor(terms.mass_matrix)
    if inverse is None:
        return Map(np.full((nv, n + 1), np.nan), np.full((k, n + 1), np.nan))
    free = np.empty((nv, n + 1), order="F")  # [Z, -z]
    np.take(inverse.T, terms.actuated, axis=0, out=free.T[:n], mode="clip")
    free[:, n] = -inverse.dot(terms.bias)
    if k:
        pushes = dgemm(1.0, inverse, terms.contact_jacobian.T)
        wanted = dgemm(-1.0, pushes, free, trans_a=1)
        wanted[:, n] -= terms.contact_bias
        if contact_acceleration is not None:
            wanted[:, n] += contact_acceleration
        force = _solve(dgemm(1.0, pushes, pushes, trans_a=1), wanted)
        free = dgemm(1.0, pushes, force, 1.0, free, overwrite_c=1)
    else:
        force = np.zeros((0, n + 1))
    return Map(dgemm(1.0, inverse, free, trans_a=1), force)


def _inverse_factor(matrix: FloatArray) -> FloatArray | None:
    """L^-1 of matrix = L L^T; None where it is not positive definite or not a number."""
    factor, failed = dpotrf(matrix, lower=1)
    if failed:
        return None
    inverse, failed = dtrtri(factor, lower=1, overwrite_c=1)
    return None if failed else np.asarray(inverse)


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution x of matrix x = right for a positive semidefinite matrix, as the module says."""
    diagonal = matrix.diagonal()
    inverse = _inverse_factor(matrix)
    if inverse is not None:
        # Scaled to a diagonal of ones, the largest eigenvalue is at most k and the smallest at least 1 / trace(inverse)
        whole = dgemm(1.0, inverse, inverse, trans_a=1)
        if diagonal.dot(whole.diagonal()) * diagonal.size * RANK_KEPT < 1.0:
            return np.asarray(dgemm(1.0, whole, right))
    if not np.isfinite(matrix).all():
        return np.full_like(right, np.nan)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))[:, None]
    return _filtered(matrix * scale * scale.T, right * scale) * scale


def _filtered(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The same for a scaled matrix that loses rank."""
    values, vectors = np.linalg.eigh(matrix)
    relative = np.maximum(values / values[-1], 1e-300)
    step = np.clip(np.log(relative / RANK_LOST) / np.log(RANK_KEPT / RANK_LOST), 0.0, 1.0)
    gain: Any = step * step * (3.0 - 2.0 * step)
    inverse = np.divide(gain, values, out=np.zeros_like(values), where=gain > 0.0)
    return np.asarray((vectors * inverse) @ (vectors.T @ right))
