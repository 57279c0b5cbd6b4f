"""The rows of all joints' torque balances: each joint's own columns, those of the shared causes, and the target.

    z_j = X_j beta_j + C_j delta + e_j

Blocks are half seconds, numbered alike for all joints; folds of the cross-validation are pairs of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.data.sensor_prior import SensorPrior
from drake_tc.diagnosis.data.sliding import BLOCK_SECONDS
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.normal_equations import FOLDS
from drake_tc.diagnosis.problem.shared.causes import CauseColumns
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class JointRows:
    """One joint's rows.

    Attributes:
        joint: Name.
        samples: Where the rows come from.
        own: (N, k) X, the effort first unless the drive's gain is held. shared: (N, P) C of all causes.
        target: (N,) z, less y*/K where the gain is held.
        block: (N,) half seconds, numbered alike for all joints.
        grams: (FOLDS, m, m) of [X, C, z] by fold, m = k + P + 1.
        scaling: (P,) columns that hold the noise of z; None: all.
        held: 1/K where the drive's gain is declared [N m/effort]; None: fitted, the first coefficient.
        opposite: (P,) `scaling` under the opposite assumption, where it is not certain; None: none.
        precision: (k,) of the prior of the own coefficients, around 0 and in units in which a row's squared residual
            counts 1: of errors of the joint's sensors within tolerance (`data.sensor_prior`); None: there is none.
    """

    joint: str
    samples: Samples
    own: FloatArray
    shared: FloatArray
    target: FloatArray
    block: IntArray
    grams: FloatArray
    scaling: BoolArray | None = None
    held: float | None = None
    opposite: BoolArray | None = None
    precision: FloatArray | None = None

    def stiffness(self, beta: FloatArray) -> float:
        """1/K, with its own coefficients beta (k,)."""
        return float(beta[0]) if self.held is None else self.held

    def stiffness_response(self, response: FloatArray) -> FloatArray:
        """(...,) by how much 1/K moves, of how much the own coefficients (k, ...) do."""
        return np.asarray(response[0] if self.held is None else np.zeros(response.shape[1:]))

    def scales(self, columns: IntArray) -> FloatArray:
        """(p,) 1.0 where these columns hold the noise of z, else 0.0."""
        return np.ones(columns.size) if self.scaling is None else self.scaling[columns].astype(np.float64)

    @property
    def width(self) -> int:
        """Number of own columns k."""
        return int(self.own.shape[1])


def _block_keys(samples: Samples) -> IntArray:
    time = samples.signals.time[samples.rows]
    return np.asarray(samples.run.astype(np.int64) * 10**7 + np.floor(time / BLOCK_SECONDS).astype(np.int64))


def stack(
    columns: Mapping[str, Columns],
    terms: Mapping[str, Sequence[Term]],
    causes: CauseColumns,
    designs: Mapping[str, FloatArray] | None = None,
) -> tuple[JointRows, ...]:
    """The rows of all joints.

    Args:
        columns: By joint, the training rows.
        terms: By joint, what its own model holds.
        causes: Columns over the same runs.
        designs: By joint, the columns (N, 1 + k) of its terms at loads of an earlier estimate, for effects that depend
            on the load; not used where a soft gear has changed the rows.
    """
    keys = {joint: _block_keys(c.samples) for joint, c in columns.items()}
    known = np.unique(np.concatenate(list(keys.values())))
    scaling = np.concatenate([np.full(c.size, c.scales) for c in causes.causes])
    opposite = np.concatenate([np.full(c.size, c.may_scale and not c.scales) for c in causes.causes])
    stacked = []
    for joint, each in columns.items():
        shared = each.samples.reduce(over_samples(each.samples, joint, causes), fresh=True)
        given = None if designs is None else designs[joint]
        design = given if given is not None and len(given) == each.target.size else each.design(terms[joint])
        own, target, held = _drive_held(design, each, terms[joint])
        block = np.searchsorted(known, keys[joint])
        precision = _precision(each, terms[joint], own.shape[1])
        grams = fold_grams(own, shared, target, block, precision)
        made = JointRows(joint, each.samples, own, shared, target, block, grams, scaling, held, opposite, precision)
        stacked.append(made)
    return tuple(stacked)


def fold_grams(
    own: FloatArray, shared: FloatArray, target: FloatArray, block: IntArray, precision: FloatArray | None = None
) -> FloatArray:
    """(FOLDS, m, m) Gram matrices of [X, C, z] by fold; each has its share of the prior of the own coefficients."""
    fold = (block // 2) % FOLDS
    every = np.column_stack([own, shared, target])
    grams = np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)])
    if precision is not None:
        first = np.arange(precision.size)
        grams[:, first, first] += precision / FOLDS
    return grams


def with_terms(rows: JointRows, columns: Columns, terms: Sequence[Term]) -> JointRows:
    """The rows with other terms of the joint's own.

    Args:
        rows: From `stack`.
        columns: Those that `stack` was given for the joint.
        terms: What its own model holds now.
    """
    own, target, held = _drive_held(columns.design(terms), columns, terms)
    precision = _precision(columns, terms, own.shape[1])
    grams = fold_grams(own, rows.shared, target, rows.block, precision)
    return replace(rows, own=own, target=target, grams=grams, held=held, precision=precision)


def prior_weighed(rows: JointRows, sigma: float, share: float) -> JointRows:
    """The rows with the prior of the joint's sensor errors weighed by what a fit of all joints leaves.

    `stack` takes the weight from the joint's own fit to the loads that the runs hold. Where the links' parameters of
    these loads are wrong, that fit leaves their error too, and its prior would press real sensor errors to 0.

    Args:
        rows: From `stack`.
        sigma: RMS of the residual [N m].
        share: n/N of the rows that say something of their own.
    """
    before = rows.samples.sensor_prior
    if rows.precision is None or before is None:
        return rows
    prior = SensorPrior(variance=sigma**2, share=share)
    precision = rows.precision * prior.weight / before.weight
    grams = rows.grams.copy()
    first = np.arange(precision.size)
    grams[:, first, first] += (precision - rows.precision) / FOLDS
    return replace(rows, samples=replace(rows.samples, sensor_prior=prior), grams=grams, precision=precision)


def _precision(columns: Columns, terms: Sequence[Term], width: int) -> FloatArray | None:
    """(width,) of the own coefficients' prior, 0 where there is none: of slopes by shapes, and of the drive's gain."""
    if not any(isinstance(t.effect, WithinTolerance) for t in terms):
        return None
    known = columns.prior(terms).precision
    first = 0 if _held_stiffness(columns, terms) is None else 1
    out = np.zeros(width)
    out[: known.size - first] = known[first:]
    return out


def _held_stiffness(columns: Columns, terms: Sequence[Term]) -> float | None:
    """1/K where the drive's gain is declared and no effect says that it is wrong [N m/effort]; else None."""
    if columns.declared_gain is None or any(isinstance(t.effect, ServoGain) for t in terms):
        return None
    return 1.0 / columns.declared_gain


def _drive_held(
    own: FloatArray, columns: Columns, terms: Sequence[Term]
) -> tuple[FloatArray, FloatArray, float | None]:
    """Own columns, target and held 1/K of one joint: see `JointRows`."""
    held = _held_stiffness(columns, terms)
    if held is None:
        return own, columns.target, None
    return own[:, 1:], columns.target - held * own[:, 0], held


def over_samples(samples: Samples, joint: str, causes: CauseColumns) -> FloatArray:
    """(T, P) of one joint on the samples' own clock."""
    time, run = samples.signals.time, samples.run_of_sample
    out = np.zeros((time.size, causes.causes[-1].columns.stop))
    for number, name in enumerate(samples.runs):
        inside = run == number
        out[inside] = causes.of(name, joint, time[inside])
    return out


def kept_gram(rows: JointRows, columns: IntArray, fold: int | None = None) -> FloatArray:
    """Gram of [X, C of these columns, z]."""
    gram = rows.grams.sum(axis=0) if fold is None else rows.grams[fold]
    k = rows.width
    index = np.concatenate([np.arange(k), k + columns, [gram.shape[0] - 1]])
    return np.asarray(gram[np.ix_(index, index)])
