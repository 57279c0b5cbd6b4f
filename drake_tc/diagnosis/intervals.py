"""Physical parameters of a set of terms with 95 % intervals from the posterior, every nuisance included."""

from collections.abc import Mapping

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.problem.estimates import Estimate, rests_on_bound
from drake_tc.diagnosis.problem.parameters import physical_parameters, shape_places
from drake_tc.diagnosis.search import as_fit
from drake_tc.effects.link_load import LinkLoad
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import FloatArray

CRITICAL = float(norm.ppf(0.975))


def parameters_of(evidence: Evidence, scored: Scored) -> Mapping[str, Mapping[str, Estimate]]:
    """Every parameter of the set by effect key and name ("drive" holds the gain), by the delta method."""
    fit, size = as_fit(scored), scored.coefficients
    at = size + scored.shapes
    point = np.concatenate([scored.b, shape_places(scored.terms)[1]])
    covariance = scored.posterior.covariance[:at, :at]
    if not scored.shapes and point.size > size:
        point = point[:size]

    def named(values: FloatArray) -> dict[str, dict[str, float]]:
        gain = max(float(values[0]), 1e-300)
        beta = np.concatenate([[1.0 / gain], values[1:size] / gain])
        return physical_parameters(fit, beta, values[size:] if scored.shapes else None)

    first = named(point)
    slopes = {(key, name): np.zeros(point.size) for key in first for name in first[key]}
    for j in range(point.size):
        step = 1e-6 * abs(point[j]) + 1e-12
        moved = point.copy()
        moved[j] += step
        changed = named(moved)
        for (key, name), slope in slopes.items():
            slope[j] = (changed[key][name] - first[key][name]) / step
    units, bounds = _units_and_bounds(evidence, scored)
    out: dict[str, dict[str, Estimate]] = {}
    for (key, name), slope in slopes.items():
        if key in (LinkLoad.id, WithinTolerance.id):
            continue
        value, half = first[key][name], CRITICAL * float(np.sqrt(max(float(slope @ covariance @ slope), 0.0)))
        low, high = bounds.get((key, name), (-np.inf, np.inf))
        ci95 = (float(max(value - half, low)), float(min(value + half, high)))
        unit = units.get((key, name), "-")
        out.setdefault(key, {})[name] = Estimate(float(value), unit, ci95, rests_on_bound(value, low, high))
    return out


def _units_and_bounds(
    evidence: Evidence, scored: Scored
) -> tuple[dict[tuple[str, str], str], dict[tuple[str, str], tuple[float, float]]]:
    told = evidence.model.train.samples.units.on(evidence.model.context.drive)
    units = {("drive", "gain"): told.gain}
    bounds = {("drive", "gain"): (0.0, np.inf)}
    for term in scored.terms:
        for p in term.effect.parameters:
            units[term.effect.key, p.name] = told.of(p.unit)
            bounds[term.effect.key, p.name] = (p.lower, p.upper)
    return units, bounds
