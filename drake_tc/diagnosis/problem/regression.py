"""Least squares of a set of effects, with blockwise cross-validation.

Residuals are told in the drive's effort: K (z - z_hat), the effort that the model asks too little (`columns`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.priors import LEAST_EFFORT
from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term, drives, prior_coefficients
from drake_tc.effects.current_lag import CurrentLag
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import BoolArray, FloatArray, IntArray

LEAST_STIFFNESS = 1e-12
"""Lower bound of 1/K [N m/effort]."""
FOLDS = 5
NUDGE = 1e-3
"""Step of a difference quotient over the standard deviation of the effort."""
LEAST_SIZE = 1e-9
"""Norm of a column over the largest one, below which the column holds rounding errors only."""
LEAST_OUTSIDE_FOLD = 1e-6
"""Norm of a column outside a fold over that in all folds, below which the other folds do not identify it."""
SLACK = 1e-12
"""How far beyond its bound a scaled coefficient may lie."""


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
    if not columns.effort_is_target or not drives(terms):
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


def solve_bounded(
    gram: FloatArray, moment: FloatArray, lower: FloatArray, upper: FloatArray, held: BoolArray | bool = False
) -> FloatArray:
    """Argmin beta' G beta / 2 - m' beta in a box, (m,), by an active set that only grows (few bounds are ever active).

    A column that is zero up to rounding identifies no coefficient: the quotient of two rounding errors may be 1e100.
    Its coefficient is held at the value of the box that is closest to 0.

    Args:
        gram: G (m, m).
        moment: (m,).
        lower: (m,) bounds.
        upper: (m,).
        held: (m,) further coefficients to hold.
    """
    norms = np.sqrt(np.maximum(np.diag(gram), 0.0))
    dead = norms <= LEAST_SIZE * norms.max()
    scale = np.where(dead, 1.0, norms)
    g, m = gram / np.outer(scale, scale) + 1e-12 * np.eye(scale.size), moment / scale
    low, high = lower * scale, upper * scale
    beta, fixed = np.clip(np.zeros(m.size), low, high), dead | (low == high) | held
    for _ in range(m.size + 1):
        free = ~fixed
        beta[free] = np.linalg.solve(g[np.ix_(free, free)], m[free] - g[np.ix_(free, fixed)] @ beta[fixed])
        outside = free & ((beta < low - SLACK) | (beta > high + SLACK))
        if not outside.any():
            break
        beta[outside] = np.clip(beta[outside], low[outside], high[outside])
        fixed |= outside
    return np.clip(beta / scale, lower, upper)


def cross_validated(
    grams: FloatArray, moments: FloatArray, lower: FloatArray, upper: FloatArray, precision: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Least squares in a box: beta (m,) of all folds, and (F, m) without each of them.

    A coefficient whose column is zero outside a fold is 0 there.

    Args:
        grams: (F, m, m) X'X by fold.
        moments: (F, m) X'z by fold.
        lower: (m,) bounds.
        upper: (m,).
        precision: (m,) of a prior about 0, which counts in full without each of the folds too.
    """
    gram, moment = grams.sum(0), moments.sum(0)
    known = np.broadcast_to(precision, moment.shape)
    without = []
    for left_out, part in zip(grams, moments, strict=True):
        rest = gram - left_out
        unseen = (np.diag(rest) <= LEAST_OUTSIDE_FOLD**2 * np.diag(gram)) & (known == 0.0)
        without.append(solve_bounded(rest + np.diag(known), moment - part, lower, upper, unseen))
    return solve_bounded(gram + np.diag(known), moment, lower, upper), np.array(without)


def collinear(gram: FloatArray) -> bool:
    """Whether columns, dead ones aside, cannot be told apart: scaled to unit length their condition exceeds 10^4.5."""
    scale = np.sqrt(np.diag(gram))
    live = scale > LEAST_SIZE * scale.max()
    unit = gram[np.ix_(live, live)] / np.outer(scale[live], scale[live])
    return bool(np.linalg.cond(unit) > 1e9)
