"""The parameters that reports and model files have: values with intervals, and the ranges that are possible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.problem.columns import Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.effects.base import Context
from drake_tc.effects.check import ROUNDING, plausible_range
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.types import FloatArray


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

    def of(self, one: str, other: str) -> float:
        """Correlation of two parameters."""
        return float(self.matrix[self.names.index(one), self.names.index(other)])


def rests_on_bound(value: float, low: float, high: float) -> bool:
    """Whether a value is one of its bounds, up to rounding."""
    return bool(min(abs(value - low), abs(value - high)) <= 1e-9 * max(1.0, abs(value)))


def shape_places(terms: Sequence[Term]) -> tuple[list[tuple[int, str]], FloatArray]:
    """Where the terms' shape parameters are (number of the term, name), and their values (s,)."""
    where = [(i, p.name) for i, t in enumerate(terms) for p in t.effect.shapes]
    return where, np.array([terms[i].shape[name] for i, name in where], dtype=float)


def with_shapes(terms: Sequence[Term], where: Sequence[tuple[int, str]], values: FloatArray) -> list[Term]:
    """The terms with other values (s,) of their shape parameters."""
    shapes = [dict(t.shape) for t in terms]
    for (i, name), value in zip(where, values, strict=True):
        shapes[i][name] = float(value)
    return [Term(t.effect, s) for t, s in zip(terms, shapes, strict=True)]


def physical_parameters(
    fitted: Fit, beta: FloatArray | None = None, shapes: FloatArray | None = None
) -> dict[str, dict[str, float]]:
    """Reported parameters by term key ("drive" holds the gain).

    Args:
        fitted: A fit.
        beta: (1 + k,) in place of the fit's own.
        shapes: (s,) values of the shape parameters in place of the fit's own.
    """
    where, own = shape_places(fitted.terms)
    beta = fitted.beta if beta is None else beta
    shapes = own if shapes is None else shapes
    terms = with_shapes(fitted.terms, where, shapes)
    gain = 1.0 / beta[0]
    out: dict[str, dict[str, float]] = {"drive": {"gain": float(gain)}}
    scale = 1.0
    for term, theta in coefficients_by_term(terms, beta):
        out["drive"]["gain"] = term.effect.drive_gain(out["drive"]["gain"], term.shape)
        out[term.effect.key] = term.effect.physical(theta, term.shape, gain)
        scale *= term.effect.torque_scale(theta, term.shape)
    if scale != 1.0:
        _to_true_torque(out, terms, scale)
    return out


def _to_true_torque(out: dict[str, dict[str, float]], terms: Sequence[Term], scale: float) -> None:
    """One N m of the fit is 1/scale N m of true torque (a sensor's gain error, a servo's wind-up).

    The fitted gain K is K scale in true torque. Where `servo_gain` holds it against the declared K_0, the drive keeps
    K_0 and the effect takes the scale: 1 + e = K_0/(K scale).
    """
    if ServoGain.id in out:
        out[ServoGain.id]["gain_error"] = (out[ServoGain.id]["gain_error"] + 1.0) / scale - 1.0
    else:
        out["drive"]["gain"] *= scale
    for term in terms:
        for p in term.effect.parameters:
            if p.unit.startswith(("N*m", "kg")):
                out[term.effect.key][p.name] /= scale


@dataclass(frozen=True)
class PlausibleRange:
    """The values of a parameter that are possible: lower <= value <= upper, in its own unit; infinite where unlimited.

    `source` says why: a law, a definition, a data sheet or a publication.
    """

    lower: float
    upper: float
    source: str

    def holds(self, value: float) -> bool:
        """Whether a value lies in the range, up to rounding."""
        low, high = self.lower, self.upper
        return low - ROUNDING * abs(low) <= value <= high + ROUNDING * abs(high)


def plausible_ranges(fitted: Fit, context: Context) -> Mapping[str, Mapping[str, PlausibleRange]]:
    """Ranges by effect key and name of parameter; parameters without one, and those of links, are left out."""
    named = physical_parameters(fitted)
    own = {"gain": named["drive"]["gain"]}
    own |= {name: named[name][name] for name in ("viscous", "coulomb") if name in named}
    known = replace(context, fitted=own)
    out: dict[str, dict[str, PlausibleRange]] = {}
    for term in fitted.terms:
        for p in term.effect.parameters:
            if p.plausible is not None:
                low, high = plausible_range(p, known)
                source = context.units.text(p.plausible.on(context.joint_type).source)
                out.setdefault(term.effect.key, {})[p.name] = PlausibleRange(low, high, source)
    return out


Parameters = Mapping[str, Mapping[str, Estimate]]


def widened(parameters: Parameters, fitted: Fit, spread: FloatArray) -> Parameters:
    """The parameters with wider intervals, which end at the bounds of the parameters.

    Args:
        parameters: Of the fit, by effect and name.
        fitted: One joint's fit.
        spread: (k, k) covariance of its beta that its own intervals do not know of.
    """
    named, steps = physical_parameters(fitted), 1e-6 * np.abs(fitted.beta) + 1e-12
    changed = [physical_parameters(fitted, fitted.beta + step) for step in np.diag(steps)]
    bounds = {(t.effect.key, p.name): (p.lower, p.upper) for t in fitted.terms for p in t.effect.parameters}
    bounds["drive", "gain"] = (0.0, np.inf)

    def wider(key: str, name: str, estimate: Estimate) -> Estimate:
        slope = np.array([each[key][name] - named[key][name] for each in changed]) / steps
        more = float(norm.ppf(0.975)) * np.sqrt(max(float(slope @ spread @ slope), 0.0))
        below, above = (float(np.hypot(estimate.value - end, more)) for end in estimate.ci95)
        low, high = bounds.get((key, name), (-np.inf, np.inf))
        return replace(estimate, ci95=(max(estimate.value - below, low), min(estimate.value + above, high)))

    return {key: {name: wider(key, name, e) for name, e in group.items()} for key, group in parameters.items()}
