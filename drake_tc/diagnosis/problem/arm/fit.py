"""Weighted least squares of all joints together, with blockwise cross-validation, grown one effect at a time."""

from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.arm.rows import ArmRows
from drake_tc.diagnosis.problem.bounded import cross_validated
from drake_tc.diagnosis.problem.columns import FOLDS, Term, fold_of
from drake_tc.types import FloatArray

RIDGE = 1e-9


@dataclass(frozen=True)
class ShaftEffect:
    """An effect on a shaft."""

    axis: int
    term: Term


@dataclass(frozen=True, eq=False)
class ArmFit:
    """One set of columns fitted to all joints; errors of joint j are weighed by 1/sigma_j.

    Attributes:
        rows: What it was fitted on.
        sigma: (n,) [N m].
        shaft_effects: Effects, in the order of their columns, after the p rigid ones.
        design: (N, n, m) unweighted.
        lower, upper: (m,) bounds of the coefficients.
        grams, moments: (FOLDS, m, m), (FOLDS, m) weighted.
        beta: (m,) [pi, theta ...].
        held: (N, n) residual of each fold, predicted from the other folds [N m].
    """

    rows: ArmRows
    sigma: FloatArray
    shaft_effects: tuple[ShaftEffect, ...]
    design: FloatArray
    lower: FloatArray
    upper: FloatArray
    grams: FloatArray
    moments: FloatArray
    beta: FloatArray
    held: FloatArray

    @property
    def residual(self) -> FloatArray:
        """(N, n) on the rows of the fit [N m]."""
        return np.asarray(self.rows.torque - self.design @ self.beta)

    @property
    def cv_rms(self) -> FloatArray:
        """(n,) cross-validated [N m]."""
        return np.asarray(np.sqrt(np.mean(self.held**2, axis=0)))

    def block_sse(self, joints: FloatArray) -> FloatArray:
        """(B,) cross-validated squared error by block over the joints (n,) of weight > 0, in units of sigma."""
        error = np.sum((self.held / self.sigma)[:, joints > 0] ** 2, axis=1)
        return np.bincount(self.rows.block, error).astype(np.float64)

    def predict(self, rows: ArmRows) -> FloatArray:
        """Y pi + phi theta (N', n) on other rows of the same robot [N m]."""
        return np.asarray(design_of(rows, self.shaft_effects) @ self.beta)


def design_of(rows: ArmRows, shaft_effects: tuple[ShaftEffect, ...]) -> FloatArray:
    """(N, n, m): rigid columns, then each effect's."""
    blocks = [rows.rigid] + [rows.spread(p.axis, rows.of(p.axis, p.term)) for p in shaft_effects]
    return np.concatenate(blocks, axis=2)


def fit_arm(rows: ArmRows, shaft_effects: tuple[ShaftEffect, ...], sigma: FloatArray) -> ArmFit:
    """Fit from scratch."""
    return _solved(rows, shaft_effects, sigma, design_of(rows, shaft_effects))


def reweighted(fit: ArmFit, sigma: FloatArray) -> ArmFit:
    """The same columns with the joints' errors weighed by 1/sigma (n,)."""
    return _solved(fit.rows, fit.shaft_effects, sigma, fit.design)


def grown(parent: ArmFit, place: ShaftEffect) -> ArmFit:
    """The parent's columns and one more effect."""
    more = parent.rows.spread(place.axis, parent.rows.of(place.axis, place.term))
    design = np.concatenate([parent.design, more], axis=2)
    return _solved(parent.rows, (*parent.shaft_effects, place), parent.sigma, design)


def without(fit: ArmFit, place: ShaftEffect) -> ArmFit:
    """The fit without one of its effects."""
    return fit_arm(fit.rows, tuple(p for p in fit.shaft_effects if p is not place), fit.sigma)


def _bounds(rigid: int, shaft_effects: tuple[ShaftEffect, ...]) -> tuple[FloatArray, FloatArray]:
    parameters = [q for p in shaft_effects for q in p.term.effect.coefficients]
    free = np.full(rigid, np.inf)
    return (
        np.concatenate([-free, [q.lower for q in parameters]]),
        np.concatenate([free, [q.upper for q in parameters]]),
    )


def _solved(rows: ArmRows, shaft_effects: tuple[ShaftEffect, ...], sigma: FloatArray, design: FloatArray) -> ArmFit:
    lower, upper = _bounds(rows.rigid.shape[2], shaft_effects)
    folds = fold_of(rows.block)
    weighted, goal = design / sigma[None, :, None], rows.torque / sigma
    m = design.shape[2]
    grams, moments = np.zeros((FOLDS, m, m)), np.zeros((FOLDS, m))
    for f in range(FOLDS):
        a, b = weighted[folds == f].reshape(-1, m), goal[folds == f].reshape(-1)
        grams[f], moments[f] = a.T @ a, a.T @ b
    beta, by_fold = cross_validated(ridged(grams), moments, lower, upper)
    held = np.empty_like(rows.torque)
    for f in range(FOLDS):
        held[folds == f] = rows.torque[folds == f] - design[folds == f] @ by_fold[f]
    return ArmFit(rows, sigma, shaft_effects, design, lower, upper, grams, moments, beta, held)


def ridged(gram: FloatArray) -> FloatArray:
    """Matrices (..., m, m) with their diagonals raised a little: what no row excites stays 0."""
    return np.asarray(gram * (1.0 + RIDGE * np.eye(gram.shape[-1])))
