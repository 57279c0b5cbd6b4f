"""Does each parameter have one value? Refitted by run, by gain of the loop, by load and by direction of motion.

A coefficient theta_k of the final model gets one value in each part of the rows, all other coefficients one value
everywhere:

    z = (1/K) y* - sum_{j != k} theta_j phi_j - sum_g theta_kg phi_k 1_g                    parts g

A parameter that moves by more than its intervals says what the model lacks: a gain that grows with the load, friction
that differs from run to run. Intervals are those of `identification.regression` (autocorrelation included); the test of
equal values is the chi-squared of the differences from the first part.

Where one parameter moves, one value for it in all parts puts some of its change on parameters with similar columns. So
of those that move, the one whose separate values leave the least error is named first, and keeps separate values. The
others are then fitted by part beside it, and named only if they still move.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, norm

from drake_tc.diagnosis.problem.columns import Columns, prior_coefficients
from drake_tc.diagnosis.problem.estimates import block_lengths
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.result.joint_result import ParameterByCondition
from drake_tc.effects.base import DriveKind
from drake_tc.effects.unknown_load import UnknownLoadEffect
from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import critical_value_95
from drake_tc.identification.regression import LinearFit, least_squares
from drake_tc.types import FloatArray, IntArray

FEWEST_ROWS = 200
SIGNIFICANT = 1e-3
"""Probability of the differences under one common value, below which a parameter is said to move."""
LEAST_CHANGE = 0.10
"""Smallest spread of the values, as a share of their mean size, that is worth saying."""
LEAST_OF_NOISE = 3.0
"""Acceleration of a part over the encoder's noise in it, from which on its inertia is compared: noise of variance s^2
makes an inertia smaller by s^2/(s^2 + a^2), here by a tenth."""
LEAST_OWN = 0.1
"""Share of a part's column, by RMS, that no combination of the other columns may explain; with less, the values of the
parts are those of the few rows in which the columns differ. Coulomb friction and its asymmetry have this in each
direction of motion."""
ROUNDING = 1e-12
"""Of a Gram matrix of columns at unit length."""
MOST_RUNS = 24
MOST_NAMED = 3
"""Parameters that one split names at most; each of them costs another fit of all others."""


@dataclass(frozen=True, eq=False)
class Split:
    """One way of parting the rows: what by, the parts' names, and the part of each row (N,)."""

    by: str
    names: tuple[str, ...]
    part: IntArray


def splits(columns: Columns, drive: DriveKind) -> Iterator[Split]:
    """By run, by the gain of the position loop, by the size of the load, and by direction of motion."""
    samples = columns.samples
    runs = np.unique(samples.run)
    if 2 <= runs.size <= MOST_RUNS:
        part = np.searchsorted(runs, samples.run)
        yield Split("run", tuple(samples.runs[int(r)] for r in runs), part)
    gains = np.array(samples.loop_gains)[samples.run]
    if np.isfinite(gains).all() and 2 <= (known := np.unique(gains)).size < runs.size:
        unit = samples.units.on(drive).of("effort/rad")
        yield Split("gain", tuple(f"{gain:.4g} {unit}" for gain in known), np.searchsorted(known, gains))
    s = samples.signals.take(samples.rows)
    load = np.abs(s.expected_torque)
    yield Split("load", ("small load", "large load"), (load > np.median(load)).astype(int))
    yield Split("direction", ("backward", "forward"), (s.velocity > 0.0).astype(int))


def consistency(columns: Columns, final: Fit, drive: DriveKind) -> tuple[ParameterByCondition, ...]:
    """Every coefficient of the final model by every split in which the rows identify it.

    Args:
        columns: Training rows.
        final: The final model; its shapes stay as they are.
        drive: Gives the unit of the effort.
    """
    terms = [(t.effect.key, p.name, p.unit) for t in final.terms for p in t.effect.coefficients]
    units = ("", *(unit for _, _, unit in terms))
    told = columns.samples.units.on(drive)
    names = (("drive", "gain", told.gain), *((key, name, told.of(unit)) for key, name, unit in terms))
    design, target = columns.design(final.terms), columns.target
    held = prior_coefficients(final.terms)
    held[0] = columns.effort_is_target  # nothing in the rows tells the gain then
    target = target - design[:, held] @ final.beta[held]
    design, names = design[:, ~held], tuple(n for n, fixed in zip(names, held, strict=True) if not fixed)
    acceleration = float(np.sqrt(columns.samples.floor.motion_gram[0, 0]))
    noise = np.array([acceleration if unit == "kg*m^2" else 0.0 for unit in units])[~held]
    rows = _Rows(design, target, names, block_lengths(columns), noise)
    out: list[ParameterByCondition] = []
    for split in splits(columns, drive):
        if np.bincount(split.part, minlength=len(split.names)).min() >= FEWEST_ROWS:
            out += _parameters(rows, split)
    return tuple(out)


def loads_differ(parameters: Sequence[ParameterByCondition]) -> bool:
    """Whether a parameter of an unknown load differs significantly from run to run."""
    return any(p.moves and p.by == "run" and p.effect.partition(".")[0] == UnknownLoadEffect.id for p in parameters)


def friction_differs(parameters: Sequence[ParameterByCondition]) -> bool:
    """Whether viscous or Coulomb friction differs significantly from run to run."""
    return any(p.moves and p.by == "run" and p.effect in ("viscous", "coulomb") for p in parameters)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Design (N, m), target (N,), effect, name and unit of the m coefficients, and lengths of the contiguous stretches.

    `noise` (m,) is the RMS of the encoder's noise in the columns of inertias, 0 for the others.
    """

    design: FloatArray
    target: FloatArray
    names: tuple[tuple[str, str, str], ...]
    lengths: Sequence[int]
    noise: FloatArray


def _parameters(rows: _Rows, split: Split) -> list[ParameterByCondition]:
    """Every coefficient that the rows identify by part, in the model's order; those that move chosen one by one."""
    named: list[int] = []
    entries: dict[int, ParameterByCondition] = {}
    while True:
        fits = {k: _by_part(rows, split, (k, *named)) for k in range(len(rows.names)) if k not in named}
        known = {k: found for k, found in fits.items() if found is not None}
        entries |= {k: _entry(split, *rows.names[k], found) for k, found in known.items()}
        moving = [k for k in known if entries[k].moves]
        if not moving or len(named) == MOST_NAMED:
            break
        named.append(min(moving, key=lambda k: known[k].rms))
    for k in named[:-1]:  # the last one was fitted beside all others
        if (found := _by_part(rows, split, (k, *(j for j in named if j != k)))) is not None:
            entries[k] = _entry(split, *rows.names[k], found)
    return [replace(entries[k], moves=entries[k].moves and k in named) for k in sorted(entries)]


def _by_part(rows: _Rows, split: Split, parted: Sequence[int]) -> LinearFit | None:
    """The fit with the coefficients `parted` by part, those of the first one first; None if the rows do not tell them.

    The columns are the G parts of each parted coefficient, then the other coefficients.
    """
    masks = [split.part == g for g in range(len(split.names))]
    parts = [np.stack([np.where(mask, rows.design[:, k], 0.0) for mask in masks], axis=-1) for k in parted]
    for each in parts:
        size = np.sqrt(np.mean(each**2, axis=0))
        if size.min() <= 1e-3 * size.max():
            return None
    least = min(np.sqrt(np.mean(rows.design[mask, parted[0]] ** 2)) for mask in masks)
    if least <= LEAST_OF_NOISE * rows.noise[parted[0]]:
        return None
    others = np.delete(rows.design, parted, axis=1)
    alive = np.sqrt(np.mean(others**2, axis=0)) > 1e-12
    design = np.hstack([*parts, others[:, alive]])
    if _least_own(design)[: len(masks)].min() < LEAST_OWN:
        return None
    try:
        return least_squares(design, rows.target, lengths=rows.lengths, max_condition=1e4)
    except IdentificationError:
        return None


def _least_own(design: FloatArray) -> FloatArray:
    """(m,) RMS of what all other columns leave of each column of (N, m), over its own RMS: 1/sqrt([G^-1]_kk).

    G is the Gram matrix of the columns at unit length, and [G^-1]_kk the variance inflation factor of column k.
    """
    unit = design / np.linalg.norm(design, axis=0)
    gram = unit.T @ unit + ROUNDING * np.eye(unit.shape[1])
    return np.asarray(1.0 / np.sqrt(np.diag(np.linalg.inv(gram))))


def _entry(split: Split, effect: str, name: str, unit: str, found: LinearFit) -> ParameterByCondition:
    count = len(split.names)
    values, interval = found.coefficients[:count], found.ci95[:count]
    wider = critical_value_95(found.bandwidth, found.residual.size) / float(norm.ppf(0.975))
    turn = np.hstack([-np.ones((count - 1, 1)), np.eye(count - 1)])
    spread = turn @ found.hac_covariance[:count, :count] @ turn.T * wider**2
    difference = values[1:] - values[0]
    probability = float(chi2.sf(float(difference @ np.linalg.pinv(spread) @ difference), difference.size))
    ends = np.column_stack([values, interval])
    if effect == "drive":  # the regression has 1/K
        ends = np.array([_inverse(*each) for each in ends])
    intervals = {part: (float(v), float(a), float(b)) for part, (v, a, b) in zip(split.names, ends, strict=True)}
    change = float(np.ptp(ends[:, 0]) / max(float(np.mean(np.abs(ends[:, 0]))), 1e-300))
    moves = probability < SIGNIFICANT and change > LEAST_CHANGE
    return ParameterByCondition(effect, name, unit, split.by, intervals, change, probability, moves)


def _inverse(value: float, low: float, high: float) -> tuple[float, float, float]:
    """1/x and its interval from those of x; without an upper end, or any, where the interval of x reaches 0."""
    value = value if abs(value) > 1e-300 else 1e-300
    if low > 0.0 or high < 0.0:
        return 1.0 / value, 1.0 / high, 1.0 / low
    return 1.0 / value, 1.0 / high if value > 0.0 else -np.inf, np.inf
