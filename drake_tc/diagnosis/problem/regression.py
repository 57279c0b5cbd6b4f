"""Least squares of a set of effects, with everything cross-validation needs in one pass.

Residuals are told in the drive's effort: K (z - z_hat), the effort that the model asks too little (`columns`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.bounded import collinear, cross_validated
from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term, prior_coefficients
from drake_tc.diagnosis.problem.effort_left import effort_left
from drake_tc.diagnosis.problem.normal_equations import FOLDS, Normal, fold_of
from drake_tc.diagnosis.thresholds import LEAST_DRIVE, LEAST_EFFORT
from drake_tc.effects.current_lag import CurrentLag
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import FloatArray

LEAST_STIFFNESS = 1e-12
"""Lower bound of 1/K [N m/effort]."""


@dataclass(frozen=True)
class Fit:
    """Least squares of one set of terms.

    Attributes:
        terms: In the order of the columns, after the drive's own.
        beta: (1 + sum k,) [1/K, theta ...].
        residual: (N,) K (z - z_hat) on the training rows [effort].
        rms: Of the residual.
        cv_rms: The same, every fold predicted from the others, noise let through weighed (`Columns.noise_ratio`).
        block_sse: (B,) cross-validated squared residual by block [effort^2].
    """

    terms: tuple[Term, ...]
    beta: FloatArray
    residual: FloatArray
    rms: float
    cv_rms: float
    block_sse: FloatArray

    @property
    def gain(self) -> float:
        """K [effort/(N m)]."""
        return float(1.0 / self.beta[0]) if self.beta[0] > 0.0 else float("nan")

    @property
    def size(self) -> int:
        """Number of parameters, shapes included."""
        return 1 + sum(t.size for t in self.terms)


def bounds_of(terms: Sequence[Term], declared_gain: float | None = None) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds of beta.

    1/K is held at a declared gain unless an effect says that it is wrong. A sensor's error within tolerance is held at
    0 where the effect itself is among the terms.
    """
    named = {t.effect.id for t in terms}
    free = declared_gain is None or any(isinstance(t.effect, ServoGain) for t in terms)
    lower, upper = (
        ([LEAST_STIFFNESS], [np.inf])
        if free or declared_gain is None
        else ([1.0 / declared_gain], [1.0 / declared_gain])
    )
    for term in terms:
        limits = np.array([(p.lower, p.upper) for p in term.effect.coefficients]).reshape(-1, 2)
        if isinstance(term.effect, WithinTolerance):
            limits[[member.id in named for member in term.effect.members]] = 0.0
        lower += limits[:, 0].tolist()
        upper += limits[:, 1].tolist()
    return np.array(lower), np.array(upper)


@dataclass(frozen=True)
class Score:
    """Coefficients and errors of a set of terms without its residual.

    Attributes:
        terms: In the order of the columns.
        beta: (1 + sum k,). by_fold: (FOLDS, 1 + sum k) fitted without each fold.
        cv_rms: Cross-validated, noise let through weighed.
        gain: K in which errors are told. noise_correction: Weight of the noise let through, and of effort taken away.
    """

    terms: tuple[Term, ...]
    beta: FloatArray
    by_fold: FloatArray
    cv_rms: float
    gain: float
    noise_correction: float


def score(columns: Columns, terms: Sequence[Term]) -> Score:
    """Least squares with blockwise cross-validation, from normal equations alone.

    The error is infinite where the columns cannot be told apart, and where the effects explain the load without the
    drive: 1/K is then zero or nearly so, and every value in units of the effort loses its meaning.
    """
    normal = columns.normal(terms)
    low, high = bounds_of(terms, columns.declared_gain)
    prior = normal.prior
    beta, by_fold = cross_validated(normal.grams, normal.moments, low, high, prior)
    if columns.samples.sensor_prior is not None:  # their prior counts against the noise that this fit leaves
        left = float(np.sum(_squared_errors(normal, np.broadcast_to(beta, by_fold.shape))))
        prior = columns.prior(terms, left / columns.target.size)
        beta, by_fold = cross_validated(normal.grams, normal.moments, low, high, prior)
    gain = columns.gain or 1.0 / float(beta[0])
    drives = float(beta[0]) > LEAST_STIFFNESS and (columns.gain is None or beta[0] * columns.gain > LEAST_DRIVE)
    gram = prior.added(normal.grams.sum(0), normal.moments.sum(0))[0]
    told = ~(prior_coefficients(terms) & (low == high))
    told[0] = not columns.effort_is_target
    left = effort_left(columns, terms)
    least = LEAST_EFFORT
    sound = drives and left > least and not collinear(gram[np.ix_(told, told)])
    if not sound:
        return Score(tuple(terms), beta, by_fold, np.inf, gain, np.inf)
    correction = columns.noise_ratio(beta, terms) * max(noise_smoothed(columns, terms, beta), 1.0 / left)
    cv_rms = gain * correction * float(np.sqrt(_squared_errors(normal, by_fold).sum() / columns.target.size))
    return Score(tuple(terms), beta, by_fold, cv_rms, gain, correction)


def noise_smoothed(columns: Columns, terms: Sequence[Term], beta: FloatArray) -> float:
    """RMS of the residual before the lags among the terms over that after them, e + T de/dt over e; at least 1.

    Where the effort is the target, a lag would otherwise explain whatever is fast in it by smoothing it away.
    """
    lags = [t.shape["lag"] for t in terms if isinstance(t.effect, CurrentLag)]
    if not columns.effort_is_target or not lags:
        return 1.0
    before = residual = columns.target - columns.design(terms) @ beta
    for lag in lags:
        before = before + lag * columns.samples.rate(before)
    return max(float(np.linalg.norm(before)) / max(float(np.linalg.norm(residual)), 1e-300), 1.0)


def _squared_errors(normal: Normal, by_fold: FloatArray) -> FloatArray:
    """(FOLDS,) squared error [N^2 m^2] of the rows of each fold under its beta (FOLDS, m)."""
    explained = np.einsum("fi,fij,fj->f", by_fold, normal.grams, by_fold)
    crossed = np.einsum("fi,fi->f", by_fold, normal.moments)
    return np.asarray(np.maximum(normal.squares - 2.0 * crossed + explained, 0.0))


def fit(columns: Columns, terms: Sequence[Term]) -> Fit:
    """Least squares with blockwise cross-validation, from normal equations of the folds.

    Args:
        columns: Reduced columns of the training rows.
        terms: The effects.
    """
    found = score(columns, terms)
    x, z, block = columns.design(terms), columns.target, columns.samples.block
    folds = fold_of(block)
    held = np.empty_like(z)
    for f in range(FOLDS):
        rows = folds == f
        held[rows] = z[rows] - x[rows] @ found.by_fold[f]
    infinite = not np.isfinite(found.noise_correction)  # of a residual of 0 too
    held = np.full_like(z, np.inf) if infinite else held * (found.gain * found.noise_correction)
    residual = (z - x @ found.beta) * found.gain
    count = int(block.max()) + 1
    return Fit(
        terms=found.terms,
        beta=found.beta,
        residual=residual,
        rms=float(np.sqrt(np.mean(residual**2))),
        cv_rms=float(np.sqrt(np.mean(held**2))),
        block_sse=np.bincount(block, held**2, count).astype(float),
    )


def predict(columns: Columns, fitted: Fit) -> FloatArray:
    """Residual K (z - z_hat) (N,) of a fit on other samples, e.g. held-out runs."""
    return np.asarray((columns.target - columns.design(fitted.terms) @ fitted.beta) * (columns.gain or fitted.gain))


def noise_floor(columns: Columns, fitted: Fit) -> float:
    """What the noise of the sensors alone leaves in the rows under a fit's coefficients [effort]."""
    known = BalanceCoefficients.of(fitted.terms, fitted.beta, columns.samples.signals.rotor_inertia)
    return float(fitted.gain * columns.samples.floor.torque(known.stiffness, known.viscous, known.inertia))
