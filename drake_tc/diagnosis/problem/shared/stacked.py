"""The torque balances of all joints as one regression: each joint has its own drive and friction, all share delta.

    z_j = X_j beta_j + C_j delta + e_j,   e_j ~ (0, sigma_j^2)                              joints j = 1 ... n

z_j = tau_meas + J qddot and X_j are those of the joint's own regression (`problem.regression`); C_j are the causes'
columns through the same filters. Parameters with a tolerance t_i have the prior delta_i ~ N(0, t_i^2), cut
off at three of them; the others have none. The estimate is the posterior's mode,

    min  sum_j n_j log(|e_j|^2/K_j^-2) + sum_i delta_i^2/t_i^2   with |delta_i| <= 3 t_i

e_j(delta) is what the joint's own least squares leave. K_j^-1(delta) is its first coefficient as a function of those
delta that scale readings (gains, alignments), so that these residuals count in effort, by the drive gain of the fit
itself. In torque, such delta could shrink all torques together, and the drive gains' inverses with them: the residual
would shrink too, which explains nothing. (These columns hold the noise of z itself.) The columns of biases hold none.
Those of a link's mass and centre hold next to none, as their motion is smoothed over windows three times as long as
that of z (`columns_of_runs.column_filter`), and their residuals count in torque too: in effort, the noise of z would
draw such a delta by g_j sigma_j^2/|C~_j|^2, which is a hundredth of a mass.

Where the loads are made of the encoders alone, the efforts hold most of the noise, and all residuals count in effort
(`Cause.in_effort`). In torque, 1/K would be too small by the share lambda of this noise in the effort, and the links
would have to weigh less: a payload p would be too small by lambda (p + p_0), with the payload p_0 that would load the
joints like the arm itself.

It is solved by Gauss-Newton steps: with C~_j what X_j leaves of C_j and g_j = -d log(1/K_j)/d delta,

    H = sum_j w_j (C~_j - e_j g_j')' (C~_j - e_j g_j') + diag(1/t_i^2),   w_j = (n_j/N_j)/sigma_j^2

N_j rows that are correlated in time say as much as n_j independent ones (N_j over their integrated autocorrelation
time: the variance of a mean of N correlated values is sigma^2/n): without n_j/N_j the prior would be overruled by
noise that the rows repeat. sigma_j and n_j follow from the fit itself; the beta_j are eliminated joint by joint, so
that only the few delta are solved for together. Cross-validation: folds of neighbouring half seconds, the same
instants for all joints.

Where links are fitted, n_j/N_j is replaced by sum_j n_j / sum_j N_j (`pooled`). What the joints of such a robot leave
is structure more than noise, and its autocorrelation says which joint lacks an effect, not which one tells the links
better: a joint whose remainder is slow would count a fraction of its neighbours, and its own error would grow. The
prior is still weighed against as many rows as say something of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.problem.normal_equations import FOLDS
from drake_tc.diagnosis.problem.shared.rows import JointRows, kept_gram
from drake_tc.diagnosis.selection.comparison import effective_samples
from drake_tc.types import FloatArray, IntArray

MOST_ROUNDS = 20
"""Of weighting and Gauss-Newton steps: the noise of each joint follows from the fit."""
SETTLED = 0.01
"""RMS that a round changes of each joint's torque, over its noise, below which the rounds end."""
LEAST_STIFFNESS = 0.2
"""Of a joint's own fit: causes that take more of 1/K away have explained the torque itself away."""
LEAST_NOISE = 1e-6
"""Of a joint's own fit's residual, at least: no joint weighs more than this lets it."""
CUT_OFF = 3.0
"""Tolerances that a parameter with a prior reaches at most."""


@dataclass(frozen=True, eq=False)
class StackedFit:
    """One set of causes fitted to all joints.

    Attributes:
        columns: (p,) which columns delta belongs to.
        tolerance: (p,) standard deviations of the prior; infinite where there is none.
        delta: (p,). beta: by joint, (k,).
        sigma: (n,) RMS residual [N m].
        effective: (n,) n_j/N_j, the share of the rows that say something of their own.
        share: (n,) by which the rows of each joint weigh: `effective`, or that of all joints together.
        cv_rms: (n,) the same, every fold predicted from the others, times the drive's gain [effort]: torques that are
            shrunk by a cause, and the drive's stiffness with them, explain nothing by that. Infinite where next to
            nothing of the stiffness is left.
    """

    columns: IntArray
    tolerance: FloatArray
    delta: FloatArray
    beta: tuple[FloatArray, ...]
    sigma: FloatArray
    effective: FloatArray
    share: FloatArray
    cv_rms: FloatArray

    def residual(self, rows: JointRows, number: int) -> FloatArray:
        """(N,) of one joint [N m]."""
        explained = rows.own @ self.beta[number] + rows.shared[:, self.columns] @ self.delta
        return np.asarray(rows.target - explained)


@dataclass(frozen=True, eq=False)
class _Problem:
    """Which causes are fitted, what the rows weigh, and where the next step starts."""

    columns: IntArray
    tolerance: FloatArray
    sigma: FloatArray
    effective: FloatArray
    share: FloatArray
    delta: FloatArray


def fit_stacked(
    rows: Sequence[JointRows],
    columns: IntArray,
    tolerance: FloatArray | None = None,
    sigma: FloatArray | None = None,
    effective: FloatArray | None = None,
    *,
    pooled: bool = False,
) -> StackedFit:
    """Fit the causes of these columns, (p,) places; none gives each joint's own fit.

    Args:
        rows: From `stack`.
        columns: (p,).
        tolerance: (p,) standard deviations of the prior, infinite where there is none; None: none anywhere.
        sigma: (n,) noise to weigh by first [N m]; None takes that of the joints' own fits.
        effective: (n,) n_j/N_j to weigh by; None: from the residuals.
        pooled: Weigh all rows by the share that those of all joints together have.
    """
    nobody = np.zeros(0, dtype=np.int64)
    own = [_own(r, kept_gram(r, nobody)) for r in rows]
    alone = np.array([_rms(r, beta, nobody, np.zeros(0)) for r, beta in zip(rows, own, strict=True)])
    prior = np.full(columns.size, np.inf) if tolerance is None else tolerance
    start = np.ones(len(rows)) if effective is None else effective
    zero = np.zeros(columns.size)
    problem = _Problem(columns, prior, alone if sigma is None else sigma, start, start, zero)
    totals = [kept_gram(r, columns) for r in rows]
    for _ in range(MOST_ROUNDS if columns.size else 0):
        delta = _solve_delta(rows, totals, problem)
        moved = _torque_change(rows, totals, delta - problem.delta) / problem.sigma
        problem = _reweighted(rows, totals, replace(problem, delta=delta), alone, pooled=pooled)
        if effective is not None:
            problem = replace(problem, effective=effective, share=effective)
        if moved.max() < SETTLED:
            break
    result = _fit(rows, problem)
    least = LEAST_STIFFNESS * np.array([r.stiffness(beta) for r, beta in zip(rows, own, strict=True)])
    gone = np.array([r.stiffness(beta) for r, beta in zip(rows, result.beta, strict=True)]) < least
    return replace(result, cv_rms=np.where(gone, np.inf, result.cv_rms))


def _torque_change(rows: Sequence[JointRows], totals: Sequence[FloatArray], change: FloatArray) -> FloatArray:
    """(n,) RMS [N m] of what a change of delta (p,) makes to each joint's torque."""
    inner = slice(-1 - change.size, -1)
    squares = np.array([max(float(change @ g[inner, inner] @ change), 0.0) for g in totals])
    return np.asarray(np.sqrt(squares / _counts(rows)))


def _reweighted(
    rows: Sequence[JointRows], totals: Sequence[FloatArray], problem: _Problem, alone: FloatArray, *, pooled: bool
) -> _Problem:
    """The problem with the noise and the effective rows of the residuals at its delta."""
    columns, delta = problem.columns, problem.delta
    rest = [
        r.target - r.own @ _own(r, g, delta) - r.shared[:, columns] @ delta for r, g in zip(rows, totals, strict=True)
    ]
    sigma = np.array([np.sqrt(np.mean(e**2)) for e in rest])
    count = _counts(rows)
    effective = np.array([effective_samples(e, r.samples) for e, r in zip(rest, rows, strict=True)]) / count
    share = np.full(count.size, float(count @ effective / count.sum())) if pooled else effective
    return replace(problem, sigma=np.maximum(sigma, LEAST_NOISE * alone), effective=effective, share=share)


def _counts(rows: Sequence[JointRows]) -> FloatArray:
    return np.array([r.target.size for r in rows], dtype=np.float64)


def _fit(rows: Sequence[JointRows], problem: _Problem) -> StackedFit:
    columns = problem.columns
    totals = [kept_gram(r, columns) for r in rows]
    delta = _solve_delta(rows, totals, problem)
    beta = tuple(_own(r, g, delta) for r, g in zip(rows, totals, strict=True))
    held = np.zeros(len(rows))
    for f in range(FOLDS):
        parts = [kept_gram(r, columns, f) for r in rows]
        rest = [g - p for g, p in zip(totals, parts, strict=True)]
        without = _solve_delta(rows, rest, replace(problem, delta=delta))
        for j, (r, g, p) in enumerate(zip(rows, rest, parts, strict=True)):
            v = np.concatenate([_own(r, g, without), without, [-1.0]])
            held[j] += max(float(v @ p @ v), 0.0)
    spread = np.array([_rms(r, b, columns, delta) for r, b in zip(rows, beta, strict=True)])
    stiffness = np.array([max(r.stiffness(b), 1e-9) for r, b in zip(rows, beta, strict=True)])
    error = np.sqrt(held / _counts(rows)) / stiffness
    return StackedFit(columns, problem.tolerance, delta, beta, spread, problem.effective, problem.share, error)


def inverse(gram: FloatArray) -> FloatArray:
    """Pseudo-inverse of a Gram matrix, scaled to unit diagonal first: what no row excites stays 0."""
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    scale = np.where(scale > 1e-12 * max(scale.max(initial=0.0), 1e-300), scale, np.inf)
    return np.asarray(
        np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-10, hermitian=True) / np.outer(scale, scale)
    )


def _solve_delta(rows: Sequence[JointRows], grams: Sequence[FloatArray], problem: _Problem) -> FloatArray:
    """(p,) after one Gauss-Newton step from the problem's delta, over all joints and the prior."""
    if problem.columns.size == 0:
        return np.zeros(0)
    left, right = np.diag(1.0 / problem.tolerance**2), np.zeros(problem.columns.size)
    weights = problem.share / problem.sigma**2
    for r, gram, weight in zip(rows, grams, weights, strict=True):
        more, towards = _normal(r, gram, problem.columns, problem.delta)
        left += weight * more
        right += weight * towards
    return _cut_off(left, right, CUT_OFF * problem.tolerance)


def _normal(rows: JointRows, gram: FloatArray, columns: IntArray, delta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """One joint's share (p, p), (p,) of the normal equations of delta, not weighted: see the module's H."""
    k, p = rows.width, columns.size
    seen = np.concatenate([-delta, [1.0]])
    response = inverse(gram[:k, :k]) @ gram[:k, k:]
    rest = gram[k:, k:] - gram[k:, :k] @ response
    moved = rows.stiffness_response(response)
    stiffness = float(moved @ seen) if rows.held is None else rows.held
    if stiffness <= 0.0:
        return np.zeros((p, p)), np.zeros(p)
    change = np.append(rows.scales(columns) * moved[:p] / stiffness, 0.0)[:, None]
    error, size = (rest @ seen)[:, None], float(seen @ rest @ seen)
    effort = rest - error @ change.T - change @ error.T + size * change @ change.T
    step = (error - size * change)[:p, 0]
    return effort[:p, :p], step + effort[:p, :p] @ delta


def from_others(rows: Sequence[JointRows], fitted: StackedFit, number: int) -> tuple[FloatArray, FloatArray]:
    """What all joints but one, and the prior, know of delta: mean (p,) and covariance (p, p)."""
    left, right = np.diag(1.0 / fitted.tolerance**2), np.zeros(fitted.delta.size)
    for j, r in enumerate(rows):
        if j != number:
            more, towards = _normal(r, kept_gram(r, fitted.columns), fitted.columns, fitted.delta)
            weight = fitted.share[j] / fitted.sigma[j] ** 2
            left += weight * more
            right += weight * towards
    covariance = inverse(left)
    return covariance @ right, covariance


def _cut_off(left: FloatArray, right: FloatArray, most: FloatArray) -> FloatArray:
    """Argmin d' L d / 2 - r' d with |d| <= most (p,), by an active set that only grows; what no row excites stays 0."""
    delta = np.asarray(inverse(left) @ right)
    fixed = np.zeros(delta.size, dtype=np.bool_)
    while True:
        outside = ~fixed & (np.abs(delta) > most * (1.0 + 1e-9))
        if not outside.any():
            return delta
        fixed |= outside
        delta[outside] = np.clip(delta[outside], -most[outside], most[outside])
        free = ~fixed
        rest = right[free] - left[np.ix_(free, fixed)] @ delta[fixed]
        delta[free] = inverse(left[np.ix_(free, free)]) @ rest


def _own(rows: JointRows, gram: FloatArray, delta: FloatArray | None = None) -> FloatArray:
    """(k,) beta_j for given delta."""
    k = rows.width
    shift = 0.0 if delta is None or delta.size == 0 else gram[:k, k:-1] @ delta
    return np.asarray(inverse(gram[:k, :k]) @ (gram[:k, -1] - shift))


def _rms(rows: JointRows, beta: FloatArray, columns: IntArray, delta: FloatArray) -> float:
    rest = rows.target - rows.own @ beta - rows.shared[:, columns] @ delta
    return float(np.sqrt(np.mean(rest**2)))


def effective_rows(rows: Sequence[JointRows], fitted: StackedFit) -> FloatArray:
    """(n,) rows that say something of their own, by joint."""
    return np.array([effective_samples(fitted.residual(r, j), r.samples) for j, r in enumerate(rows)])
