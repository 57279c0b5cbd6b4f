"""Does each parameter have one value? Refitted by run, by load and by direction of motion.

A coefficient theta_k of the final model gets one value in each part of the rows, all other coefficients one value
everywhere:

    z = (1/K) y* - sum_{j != k} theta_j phi_j - sum_g theta_kg phi_k 1_g                    parts g

A parameter that moves by more than its intervals says what the model lacks: a gain that grows with the load, friction
that differs from run to run. Intervals are those of `identification.regression` (autocorrelation included); the test of
equal values is the chi-squared of the differences from the first part.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.estimates import block_lengths
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.result.joint_result import ParameterByCondition
from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import critical_value_95
from drake_tc.identification.linear_fit import LinearFit
from drake_tc.identification.regression import least_squares
from drake_tc.types import BoolArray, FloatArray, IntArray

FEWEST_ROWS = 200
SIGNIFICANT = 1e-3
"""Probability of the differences under one common value, below which a parameter is said to move."""
LEAST_CHANGE = 0.10
"""Smallest spread of the values, as a share of their mean size, that is worth saying."""
MOST_RUNS = 24


@dataclass(frozen=True, eq=False)
class Split:
    """One way of parting the rows: what by, the parts' names, and the part of each row (N,)."""

    by: str
    names: tuple[str, ...]
    part: IntArray


def splits(columns: Columns) -> Iterator[Split]:
    """By run, by the size of the load, and by direction of motion."""
    samples = columns.samples
    runs = np.unique(samples.run)
    if 2 <= runs.size <= MOST_RUNS:
        part = np.searchsorted(runs, samples.run)
        yield Split("run", tuple(samples.runs[int(r)] for r in runs), part)
    s = samples.signals.take(samples.rows)
    load = np.abs(s.expected_torque)
    yield Split("load", ("small load", "large load"), (load > np.median(load)).astype(int))
    yield Split("direction", ("backward", "forward"), (s.velocity > 0.0).astype(int))


def consistency(columns: Columns, final: Fit) -> tuple[ParameterByCondition, ...]:
    """Every coefficient of the final model by every split in which the rows identify it.

    Args:
        columns: Training rows.
        final: The final model; its shapes stay as they are.
    """
    design = columns.design(final.terms)
    names = [("drive", "gain"), *((t.effect.key, p.name) for t in final.terms for p in t.effect.coefficients)]
    lengths = block_lengths(columns)
    out = []
    for split in splits(columns):
        if np.bincount(split.part, minlength=len(split.names)).min() < FEWEST_ROWS:
            continue
        masks = [split.part == g for g in range(len(split.names))]
        for k, (effect, name) in enumerate(names):
            found = _by_part(design, columns.target, k, masks, lengths)
            if found is not None:
                out.append(_entry(split, effect, name, found, len(masks)))
    return tuple(out)


def _by_part(
    design: FloatArray, target: FloatArray, k: int, masks: Sequence[BoolArray], lengths: Sequence[int]
) -> LinearFit | None:
    """The fit whose first G coefficients are coefficient k in each part; None where the rows do not tell them."""
    parts = np.stack([np.where(mask, design[:, k], 0.0) for mask in masks], axis=-1)
    size = np.sqrt(np.mean(parts**2, axis=0))
    if size.min() <= 1e-3 * size.max():
        return None
    others = np.delete(design, k, axis=1)
    alive = np.sqrt(np.mean(others**2, axis=0)) > 1e-12
    try:
        return least_squares(np.hstack([parts, others[:, alive]]), target, lengths=lengths, max_condition=1e4)
    except IdentificationError:
        return None


def _entry(split: Split, effect: str, name: str, found: LinearFit, count: int) -> ParameterByCondition:
    values, interval = found.coefficients[:count], found.ci95[:count]
    wider = critical_value_95(found.bandwidth, found.residual.size) / float(norm.ppf(0.975))
    turn = np.hstack([-np.ones((count - 1, 1)), np.eye(count - 1)])
    spread = turn @ found.hac_covariance[:count, :count] @ turn.T * wider**2
    difference = values[1:] - values[0]
    probability = float(chi2.sf(float(difference @ np.linalg.pinv(spread) @ difference), difference.size))
    change = float(np.ptp(values) / max(float(np.mean(np.abs(values))), 1e-300))
    ends = np.column_stack([values, interval])
    if effect == "drive":  # the regression has 1/K
        ends = np.array([_inverse(*each) for each in ends])
    intervals = {part: (float(v), float(a), float(b)) for part, (v, a, b) in zip(split.names, ends, strict=True)}
    moves = probability < SIGNIFICANT and change > LEAST_CHANGE
    return ParameterByCondition(effect, name, split.by, intervals, change, probability, moves)


def _inverse(value: float, low: float, high: float) -> tuple[float, float, float]:
    """1/x and its interval from those of x; without an upper end, or any, where the interval of x reaches 0."""
    if low > 0.0 or high < 0.0:
        return 1.0 / value, 1.0 / high, 1.0 / low
    return 1.0 / value, 1.0 / high if value > 0.0 else -np.inf, np.inf
