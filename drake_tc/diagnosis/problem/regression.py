"""Least squares of a set of effects, with blockwise cross-validation.

Residuals are told in the drive's effort: K (z - z_hat), the effort that the model asks too little (`columns`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.bounded import collinear, cross_validated
from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term, prior_coefficients
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.thresholds import LEAST_EFFORT
from drake_tc.effects.current_lag import CurrentLag
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import FloatArray, IntArray

LEAST_STIFFNESS = 1e-12
"""Lower bound of 1/K [N m/effort]."""
FOLDS = 5
NUDGE = 1e-3
"""Step of a difference quotient over the standard deviation of the effort."""


def fold_of(block: IntArray) -> IntArray:
    """Blocks dealt to folds in pairs, so that neighbours mostly share a fold."""
    return np.asarray((block // 2) % FOLDS)


@dataclass(frozen=True)
class Fit:
    """Least squares of one set of terms.

    Attributes:
        terms: In the order of the columns, after the drive's own.
        beta: (1 + sum k,) [1/K, theta ...].
        residual: (N,) K (z - z_hat) on the training rows [effort].
        rms: Of the residual.
        cv_rms: The same, every fold predicted from the others; infinite where the columns are no model.
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


def fit(columns: Columns, terms: Sequence[Term]) -> Fit:
    """Least squares with blockwise cross-validation, from normal equations of the folds.

    The cross-validated error is infinite where the columns cannot be told apart, and where the effects explain the load
    without the drive, 1/K then being zero.

    Args:
        columns: Reduced columns of the training rows.
        terms: The effects.
    """
    x, z, block = columns.design(terms), columns.target, columns.samples.block
    fold = fold_of(block)
    parts = [(x[rows], z[rows]) for rows in (fold == f for f in range(FOLDS))]
    grams, moments = np.array([a.T @ a for a, _ in parts]), np.array([a.T @ b for a, b in parts])
    low, high = bounds_of(terms, columns.declared_gain)
    precision = columns.prior_precision(terms)
    beta, by_fold = cross_validated(grams, moments, low, high, precision)
    if columns.samples.sensor_prior is not None:  # their prior counts against the noise that this fit leaves
        precision = columns.prior_precision(terms, float(np.mean((z - x @ beta) ** 2)))
        beta, by_fold = cross_validated(grams, moments, low, high, precision)
    told = ~(prior_coefficients(terms) & (low == high))
    told[0] = not columns.effort_is_target
    left = effort_left(columns, terms)
    gram = (grams.sum(0) + np.diag(precision))[np.ix_(told, told)]
    sound = beta[0] > LEAST_STIFFNESS and left > LEAST_EFFORT and not collinear(gram)
    gain = columns.gain or 1.0 / float(beta[0])
    held = np.full_like(z, np.inf)
    if sound:
        held = (z - np.einsum("nk,nk->n", x, by_fold[fold])) * gain
        held *= max(_noise_smoothed(columns, terms, z - x @ beta), 1.0 / left)
    residual = (z - x @ beta) * gain
    return Fit(
        terms=tuple(terms),
        beta=beta,
        residual=residual,
        rms=rms(residual),
        cv_rms=rms(held),
        block_sse=np.bincount(block, held**2, int(block.max()) + 1).astype(float),
    )


def predict(columns: Columns, fitted: Fit) -> FloatArray:
    """Residual K (z - z_hat) (N,) of a fit on other samples, e.g. held-out runs."""
    return np.asarray((columns.target - columns.design(fitted.terms) @ fitted.beta) * (columns.gain or fitted.gain))


def effort_left(columns: Columns, terms: Sequence[Term]) -> float:
    """Share of the effort y that the drive effects f among the terms leave; 1 where the effort is not the target.

    Without a known torque a dead zone or a limit could explain the effort, or its noise, by taking it away. An error is
    therefore told as a share of the effort that is left: the smaller of std(f(y))/std(y) and the RMS of the slope
    df/dy, at most 1, which is the share of white noise that passes f.
    """
    if not columns.effort_is_target or not columns.drives(terms):
        return 1.0
    whole = max(float(np.std(columns.effort(()))), 1e-300)
    nudge = NUDGE * whole
    high, low = (columns.acting_effort(terms, by)[columns.samples.rows] for by in (nudge, -nudge))
    passed = min(rms((high - low) / (2.0 * nudge)), 1.0)
    return min(float(np.std(columns.effort(terms))) / whole, passed)


def _noise_smoothed(columns: Columns, terms: Sequence[Term], residual: FloatArray) -> float:
    """RMS of the residual before the lags among the terms over that after them, e + T de/dt over e; at least 1.

    Where the effort is the target, a lag would otherwise explain whatever is fast in it by smoothing it away.
    """
    lags = [t.shape["lag"] for t in terms if isinstance(t.effect, CurrentLag)]
    if not columns.effort_is_target or not lags:
        return 1.0
    before = residual
    for lag in lags:
        before = before + lag * columns.samples.rate(before)
    return max(rms(before) / max(rms(residual), 1e-300), 1.0)


def noise_floor(columns: Columns, fitted: Fit) -> float:
    """What the noise of the sensors alone leaves in the rows under a fit's coefficients [effort]."""
    known = BalanceCoefficients.of(fitted.terms, fitted.beta, columns.samples.signals.rotor_inertia)
    return float(fitted.gain * columns.samples.floor.torque(known.stiffness, known.viscous, known.inertia))
