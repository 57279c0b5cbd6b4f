"""Physical parameters of a fit with 95 % intervals, shape parameters and drive gain included."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term, prior_coefficients
from drake_tc.diagnosis.problem.parameters import physical_parameters, shape_places, with_shapes
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.effects.link_load import LinkLoad
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.identification.autocorrelation import critical_value_95
from drake_tc.identification.regression import least_squares
from drake_tc.types import BoolArray, FloatArray

COLLINEAR = 1e-12
"""Least eigenvalue of the scaled columns' Gram matrix, below which it is asked what a shape adds to the others."""
UNSEEN = 1e-9
"""What a scaled column, a difference quotient, must add to the others to be told from them: more than rounding."""


@dataclass(frozen=True)
class Estimate:
    """One parameter: value, unit, 95 % interval that accounts for autocorrelation, and whether it rests on a bound.

    The interval has an infinite end where the parameter acts as the others together do (`is_identified`).
    """

    value: float
    unit: str
    ci95: tuple[float, float]
    at_bound: bool

    @property
    def is_identified(self) -> bool:
        """Whether the interval is finite."""
        return bool(np.isfinite(self.ci95).all())


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlation (p, p) of parameters, named "effect.parameter"; the drive gain is "drive.gain"."""

    names: tuple[str, ...]
    matrix: FloatArray


def block_lengths(columns: Columns) -> list[int]:
    """Rows in each contiguous stretch: autocorrelation is not counted across gaps."""
    rows = columns.samples.rows
    typical = int(np.median(np.diff(rows)))
    ends = np.array([s.stop for s in columns.samples.segments])
    segment = np.searchsorted(ends, rows, side="right")
    cuts = np.flatnonzero((np.diff(rows) > 50 * typical) | (np.diff(segment) != 0)) + 1
    return [int(n) for n in np.diff(np.concatenate([[0], cuts, [rows.size]]))]


def shape_slopes(columns: Columns, terms: Sequence[Term], beta: FloatArray) -> FloatArray:
    """(N, s) by how much the prediction [y*, -phi ...] beta grows with each shape parameter of the terms.

    Args:
        columns: Of the rows.
        terms: Of a fit.
        beta: (1 + sum k,) its coefficients.
    """
    where, values = shape_places(terms)
    prediction, slopes = columns.design(terms) @ beta, np.zeros((columns.target.size, values.size))
    for j, value in enumerate(values):
        step = 1e-3 * abs(value) + 1e-9
        moved = values.copy()
        moved[j] = value + step
        slopes[:, j] = (columns.design(with_shapes(terms, where, moved)) @ beta - prediction) / step
    return slopes


def estimates(columns: Columns, fitted: Fit, drive: str) -> Mapping[str, Mapping[str, Estimate]]:
    """Every parameter with its 95 % interval.

    Gauss-Newton: the Jacobian of the prediction by coefficients and shapes, its HAC sandwich covariance
    (identification.regression), and the delta method for parameters that are functions of several estimates.
    """
    values = shape_places(fitted.terms)[1]
    design = columns.design(fitted.terms)
    prediction = design @ fitted.beta
    jacobian = np.column_stack([design, shape_slopes(columns, fitted.terms, fitted.beta)])
    point = np.concatenate([fitted.beta, values])
    dead = np.sqrt(np.mean(jacobian**2, axis=0)) * np.maximum(np.abs(point), 1e-12) < 1e-12
    if columns.declared_gain is not None and "servo_gain" not in {t.effect.id for t in fitted.terms}:
        dead[0] = True  # the drive is held at its declared gain
    dead[: fitted.beta.size] |= prior_coefficients(fitted.terms)  # `widening` adds what is not known of them
    undetermined = _undetermined(jacobian, dead, fitted.beta.size)
    dead |= undetermined
    linear = least_squares(
        jacobian[:, ~dead], columns.target - prediction, lengths=block_lengths(columns), max_condition=1e15
    )
    covariance = np.zeros((point.size, point.size))
    covariance[np.ix_(~dead, ~dead)] = linear.hac_covariance
    critical = critical_value_95(linear.bandwidth, columns.target.size)
    named = physical_parameters(fitted, fitted.beta, values)
    told = columns.samples.units.on(drive)
    units = {"drive": {"gain": told.gain}}
    bounds: dict[str, dict[str, tuple[float, float]]] = {"drive": {"gain": (0.0, np.inf)}}
    for term in fitted.terms:
        ps = term.effect.parameters
        units[term.effect.key] = {p.name: told.of(p.unit) for p in ps}
        bounds[term.effect.key] = {p.name: (p.lower, p.upper) for p in ps}
    out: dict[str, dict[str, Estimate]] = {}
    for key, group in named.items():
        if key in (LinkLoad.id, WithinTolerance.id):
            continue
        out[key] = {}
        for name, value in group.items():
            gradient = np.zeros(point.size)
            for j in range(point.size):
                step = 1e-6 * abs(point[j]) + 1e-12
                moved = point.copy()
                moved[j] += step
                n = fitted.beta.size
                gradient[j] = (physical_parameters(fitted, moved[:n], moved[n:])[key][name] - value) / step
            half = critical * float(np.sqrt(max(float(gradient @ covariance @ gradient), 0.0)))
            if gradient[undetermined].any():
                half = np.inf
            low, high = bounds[key].get(name, (-np.inf, np.inf))
            ci95 = max(value - half, low), min(value + half, high)
            unit, at_bound = units[key].get(name, "-"), rests_on_bound(value, low, high)
            out[key][name] = Estimate(float(value), unit, (float(ci95[0]), float(ci95[1])), at_bound)
    return out


def rests_on_bound(value: float, low: float, high: float) -> bool:
    """Whether a value is one of its bounds, up to rounding."""
    return bool(min(abs(value - low), abs(value - high)) <= 1e-9 * max(1.0, abs(value)))


def _undetermined(jacobian: FloatArray, dead: BoolArray, coefficients: int) -> BoolArray:
    """(p,) shape parameters that change the prediction as the other parameters together do, up to rounding.

    Args:
        jacobian: (N, p) of the prediction; the coefficients come first.
        dead: (p,) what is left out.
        coefficients: How many of them there are.
    """
    out = np.zeros_like(dead)
    length = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / np.where(length > 0.0, length, 1.0)
    gram = scaled.T @ scaled
    for j in range(coefficients, dead.size):
        others = np.flatnonzero(~(dead | out) & (np.arange(dead.size) != j))
        if dead[j] or np.linalg.eigvalsh(gram[np.ix_([*others, j], [*others, j])])[0] > COLLINEAR:
            continue
        explained = scaled[:, others] @ np.linalg.lstsq(scaled[:, others], scaled[:, j], rcond=None)[0]
        out[j] = np.linalg.norm(scaled[:, j] - explained) < UNSEEN
    return out
