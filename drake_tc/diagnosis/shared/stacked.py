"""The torque balances of all joints as one regression: each joint has its own drive and friction, all share delta.

    z_j = X_j beta_j + C_j delta + e_j,   e_j ~ (0, sigma_j^2)                              joints j = 1 ... n

z_j = tau_meas + J qddot and X_j are those of the joint's own regression (`drake_tc.diagnosis.design`); C_j are the
causes' columns through the same filters. Least squares weighted by 1/sigma_j^2, sigma_j from the fit itself; the
beta_j are eliminated joint by joint, so that only the few delta are solved for together. Cross-validation: folds of
neighbouring half seconds, the same instants for all joints.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from drake_tc.diagnosis.design import FOLDS, Columns, Term
from drake_tc.diagnosis.evidence import effective_samples
from drake_tc.diagnosis.samples import Samples
from drake_tc.diagnosis.shared.causes import CauseColumns
from drake_tc.diagnosis.sliding import BLOCK_SECONDS
from drake_tc.types import FloatArray, IntArray

ROUNDS = 3
"""Of weighting: the noise of each joint follows from the fit."""
LEAST_STIFFNESS = 0.2
"""Of a joint's own fit: causes that take more of 1/K away have explained the torque itself away."""
LEAST_NOISE = 1e-6
"""Of a joint's own fit's residual, at least: no joint weighs more than this lets it."""


@dataclass(frozen=True, eq=False)
class JointRows:
    """One joint's rows.

    Attributes:
        joint: Name.
        samples: Where the rows come from.
        own: (N, k) X. shared: (N, P) C of all causes. target: (N,) z.
        block: (N,) half seconds, numbered alike for all joints.
        grams: (FOLDS, m, m) of [X, C, z] by fold, m = k + P + 1.
    """

    joint: str
    samples: Samples
    own: FloatArray
    shared: FloatArray
    target: FloatArray
    block: IntArray
    grams: FloatArray

    @property
    def width(self) -> int:
        """Number of own columns k."""
        return int(self.own.shape[1])


@dataclass(frozen=True, eq=False)
class StackedFit:
    """One set of causes fitted to all joints.

    Attributes:
        columns: (p,) which columns delta belongs to.
        delta: (p,). beta: by joint, (k,).
        sigma: (n,) RMS residual [N m].
        cv_rms: (n,) the same, every fold predicted from the others, times the drive's gain [effort]: torques that are
            shrunk by a cause, and the drive's stiffness with them, explain nothing by that. Infinite where next to
            nothing of the stiffness is left.
    """

    columns: IntArray
    delta: FloatArray
    beta: tuple[FloatArray, ...]
    sigma: FloatArray
    cv_rms: FloatArray

    def residual(self, rows: JointRows, number: int) -> FloatArray:
        """(N,) of one joint [N m]."""
        explained = rows.own @ self.beta[number] + rows.shared[:, self.columns] @ self.delta
        return np.asarray(rows.target - explained)


def _block_keys(samples: Samples) -> IntArray:
    time = samples.signals.time[samples.rows]
    return np.asarray(samples.run.astype(np.int64) * 10**7 + np.floor(time / BLOCK_SECONDS).astype(np.int64))


def stack(
    columns: Mapping[str, Columns], terms: Mapping[str, Sequence[Term]], causes: CauseColumns
) -> tuple[JointRows, ...]:
    """The rows of all joints.

    Args:
        columns: By joint, the training rows.
        terms: By joint, what its own model holds.
        causes: Columns over the same runs.
    """
    keys = {joint: _block_keys(c.samples) for joint, c in columns.items()}
    known = np.unique(np.concatenate(list(keys.values())))
    stacked = []
    for joint, each in columns.items():
        shared = each.samples.reduce(_over_samples(each.samples, joint, causes), fresh=True)
        own = each.design(terms[joint])
        block = np.searchsorted(known, keys[joint])
        fold = (block // 2) % FOLDS
        every = np.column_stack([own, shared, each.target])
        grams = np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)])
        stacked.append(JointRows(joint, each.samples, own, shared, each.target, block, grams))
    return tuple(stacked)


def _over_samples(samples: Samples, joint: str, causes: CauseColumns) -> FloatArray:
    """(T, P) of one joint on the samples' own clock."""
    time, run = samples.signals.time, samples.run_of_sample
    out = np.zeros((time.size, causes.causes[-1].columns.stop))
    for number, name in enumerate(samples.runs):
        inside = run == number
        out[inside] = causes.of(name, joint, time[inside])
    return out


def fit_stacked(rows: Sequence[JointRows], columns: IntArray, sigma: FloatArray | None = None) -> StackedFit:
    """Fit the causes of these columns, (p,) places; none gives each joint's own fit.

    Args:
        rows: From `stack`.
        columns: (p,).
        sigma: (n,) noise to weigh by first [N m]; None takes that of the joints' own fits.
    """
    nobody = np.zeros(0, dtype=np.int64)
    own = [_own(r, _kept(r, nobody)) for r in rows]
    alone = np.array([_rms(r, beta, nobody, np.zeros(0)) for r, beta in zip(rows, own, strict=True)])
    result = _fit(rows, columns, alone if sigma is None else sigma)
    for _ in range(ROUNDS - 1 if columns.size else 0):
        result = _fit(rows, columns, np.maximum(result.sigma, LEAST_NOISE * alone))
    least = LEAST_STIFFNESS * np.array([beta[0] for beta in own])
    gone = np.array([beta[0] for beta in result.beta]) < least
    return replace(result, cv_rms=np.where(gone, np.inf, result.cv_rms))


def _fit(rows: Sequence[JointRows], columns: IntArray, sigma: FloatArray) -> StackedFit:
    totals = [_kept(r, columns) for r in rows]
    delta = _solve_delta(totals, [r.width for r in rows], sigma)
    beta = tuple(_own(r, g, delta) for r, g in zip(rows, totals, strict=True))
    held = np.zeros(len(rows))
    for f in range(FOLDS):
        parts = [_kept(r, columns, f) for r in rows]
        rest = [g - p for g, p in zip(totals, parts, strict=True)]
        without = _solve_delta(rest, [r.width for r in rows], sigma)
        for j, (r, g, p) in enumerate(zip(rows, rest, parts, strict=True)):
            v = np.concatenate([_own(r, g, without), without, [-1.0]])
            held[j] += max(float(v @ p @ v), 0.0)
    spread = np.array([_rms(r, b, columns, delta) for r, b in zip(rows, beta, strict=True)])
    stiffness = np.array([max(float(b[0]), 1e-9) for b in beta])
    return StackedFit(columns, delta, beta, spread, np.sqrt(held / [r.target.size for r in rows]) / stiffness)


def _kept(rows: JointRows, columns: IntArray, fold: int | None = None) -> FloatArray:
    """Gram of [X, C of these columns, z]."""
    gram = rows.grams.sum(axis=0) if fold is None else rows.grams[fold]
    k = rows.width
    index = np.concatenate([np.arange(k), k + columns, [gram.shape[0] - 1]])
    return np.asarray(gram[np.ix_(index, index)])


def _inverse(gram: FloatArray) -> FloatArray:
    """Pseudo-inverse of a Gram matrix, scaled to unit diagonal first: what no row excites stays 0."""
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    scale = np.where(scale > 1e-12 * max(scale.max(initial=0.0), 1e-300), scale, np.inf)
    return np.asarray(
        np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-10, hermitian=True) / np.outer(scale, scale)
    )


def _solve_delta(grams: Sequence[FloatArray], widths: Sequence[int], sigma: FloatArray) -> FloatArray:
    """(p,) from the sum over the joints of what their own columns leave."""
    p = grams[0].shape[0] - widths[0] - 1
    if p == 0:
        return np.zeros(0)
    left, right = np.zeros((p, p)), np.zeros(p)
    for gram, k, s in zip(grams, widths, sigma, strict=True):
        project = gram[k:, :k] @ _inverse(gram[:k, :k]) @ gram[:k, k:]
        rest = (gram[k:, k:] - project) / s**2
        left += rest[:p, :p]
        right += rest[:p, p]
    return np.asarray(_inverse(left) @ right)


def _own(rows: JointRows, gram: FloatArray, delta: FloatArray | None = None) -> FloatArray:
    """(k,) beta_j for given delta."""
    k = rows.width
    shift = 0.0 if delta is None or delta.size == 0 else gram[:k, k:-1] @ delta
    return np.asarray(_inverse(gram[:k, :k]) @ (gram[:k, -1] - shift))


def _rms(rows: JointRows, beta: FloatArray, columns: IntArray, delta: FloatArray) -> float:
    rest = rows.target - rows.own @ beta - rows.shared[:, columns] @ delta
    return float(np.sqrt(np.mean(rest**2)))


def effective_rows(rows: Sequence[JointRows], fitted: StackedFit) -> FloatArray:
    """(n,) rows that say something of their own, by joint."""
    return np.array([effective_samples(fitted.residual(r, j), r.samples) for j, r in enumerate(rows)])


def intervals(rows: Sequence[JointRows], fitted: StackedFit) -> FloatArray:
    """(p,) half widths of 95 % intervals of delta: a sandwich clustered by half seconds, over all joints together.

    Joints share the sensors' noise, and neighbouring rows theirs: what happens within one half second, on whichever
    joints, counts as one observation.
    """
    p = fitted.delta.size
    bread = np.zeros((p, p))
    count = int(max(int(r.block.max()) for r in rows)) + 1
    scores = np.zeros((count, p))
    for j, r in enumerate(rows):
        shared = r.shared[:, fitted.columns]
        rest = shared - r.own @ (_inverse(r.own.T @ r.own) @ (r.own.T @ shared))
        weight = 1.0 / fitted.sigma[j] ** 2
        bread += weight * rest.T @ rest
        each = weight * rest * fitted.residual(r, j)[:, None]
        np.add.at(scores, r.block, each)
    inverse = _inverse(bread)
    used = int(np.any(scores != 0.0, axis=1).sum())
    freedom = max(used - p, 1)
    covariance = inverse @ (scores.T @ scores) @ inverse * used / freedom
    return np.asarray(student.ppf(0.975, freedom) * np.sqrt(np.maximum(np.diag(covariance), 0.0)))
