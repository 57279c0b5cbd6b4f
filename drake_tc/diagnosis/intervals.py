"""Physical parameters of a set of terms with 95 % intervals from the posterior, every nuisance included."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.linear import Prior, Products, mode
from drake_tc.diagnosis.model import RunSpread
from drake_tc.diagnosis.priors import PARTS, RUN_SPREADS, TAKEN_OVER
from drake_tc.diagnosis.problem.parameters import (
    Correlation,
    Estimate,
    physical_parameters,
    rests_on_bound,
    shape_places,
)
from drake_tc.diagnosis.search import as_fit
from drake_tc.diagnosis.split import Split
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.types import FloatArray

LEVEL = 0.95
CRITICAL = float(norm.ppf(0.5 + 0.5 * LEVEL))
BISECTIONS = 20


def parameters_of(evidence: Evidence, scored: Scored) -> Mapping[str, Mapping[str, Estimate]]:
    """Every parameter of the set by effect key and name ("drive" holds the gain), by the delta method."""
    return correlated_parameters(evidence, scored)[0]


def correlated_parameters(
    evidence: Evidence, scored: Scored
) -> tuple[Mapping[str, Mapping[str, Estimate]], Correlation]:
    """The parameters with their correlation, 0 for one without a deviation."""
    fit, size = as_fit(scored), scored.coefficients
    at = size + scored.shapes
    point = np.concatenate([scored.b, shape_places(scored.terms)[1]])
    wider = _by_run_spread(evidence, scored)
    covariance = scored.posterior.covariance[:at, :at] * np.outer(wider, wider)
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
    told = [place for place in slopes if place[0] != WithinTolerance.id]
    turn = np.stack([slopes[place] for place in told])
    spread = turn @ covariance @ turn.T
    deviation = np.sqrt(np.maximum(np.diag(spread), 0.0) + _between_parts(evidence, scored, turn))
    units, bounds = _units_and_bounds(evidence, scored)
    out: dict[str, dict[str, Estimate]] = {}
    for (key, name), half in zip(told, CRITICAL * deviation, strict=True):
        value, (low, high) = first[key][name], bounds.get((key, name), (-np.inf, np.inf))
        ci95 = (float(max(value - half, low)), float(min(value + half, high)))
        unit = units.get((key, name), "-")
        out.setdefault(key, {})[name] = Estimate(float(value), unit, ci95, rests_on_bound(value, low, high))
    own = np.sqrt(np.maximum(np.diag(spread), 0.0))
    scale = np.where(own > 0.0, 1.0 / np.maximum(own, 1e-300), 0.0)
    matrix = spread * np.outer(scale, scale)
    np.fill_diagonal(matrix, 1.0)
    return out, Correlation(tuple(".".join(place) for place in told), matrix)


def _between_parts(evidence: Evidence, scored: Scored, turn: FloatArray) -> FloatArray:
    """(p,) variance by which parts of the log disagree about the parameters beyond what noise explains.

        max(0, diag(T C (G - c s^2 X^T X) C T^T)/s^4),   G = P/(P - 1) sum_p (g_p - mean g)(g_p - mean g)^T

    with P parts of equal length, g_p = X_p^T r_p of their whitened columns and residuals, the noise's variance s^2, the
    posterior's covariance C, and the slopes T, `turn` (p, k), of the parameters. c = 1 + 1.96 (2/(P - 1))^(1/2) is what
    noise shows by chance, but in one of forty cases. It holds where the noise is not what the model says (Huber 1967,
    White 1980; by parts: Liang and Zeger 1986).
    """
    train = evidence.model.train
    columns = evidence.columns_with_shapes(scored) if scored.shapes else evidence.design(train, scored.terms)[0]
    residual = evidence.target(train, scored.terms) - columns @ scored.posterior.beta
    share, variance = evidence.noise.share, scored.posterior.variance
    parts = np.array_split(np.arange(residual.size), PARTS)
    scores = share * np.array([columns[own].T @ residual[own] for own in parts])
    scores -= scores.mean(axis=0)
    by_noise = (1.0 + CRITICAL * np.sqrt(2.0 / (PARTS - 1.0))) * share * variance * columns.T @ columns
    middle = PARTS / (PARTS - 1.0) * scores.T @ scores - by_noise
    reach = scored.posterior.covariance[:, : turn.shape[1]] @ turn.T / variance
    return np.asarray(np.maximum(np.sum(reach * (middle @ reach), axis=0), 0.0))


def _by_run_spread(evidence: Evidence, scored: Scored) -> FloatArray:
    """(k,) by how much few runs, which tell little of how much runs differ, widen each coefficient and shape.

    The coefficients are a mixture over the tried spreads s, weighed by their evidence, of Gaussians N(b_s, C_s). The
    factor is that by which its central interval of 95 % around the taken b is wider than that of the taken spread.
    """
    at = scored.coefficients + scored.shapes
    if evidence.spread.known or len(evidence.model.train.samples.runs) < 2:
        return np.ones(at)
    spreads = [RunSpread(*pair) for pair in product(RUN_SPREADS, RUN_SPREADS)]
    owns = [replace(evidence, spread=spread) for spread in spreads]
    found = [own.with_shapes(own.score(scored.terms, scored.posterior.variance)) for own in owns]
    odds = np.array([each.log_odds for each in found])
    weights = np.exp(odds - odds.max())[:, None] / np.exp(odds - odds.max()).sum()
    middle = np.array([each.posterior.beta[:at] for each in found])
    deviation = np.sqrt([np.diag(each.posterior.covariance)[:at] for each in found])
    taken = spreads.index(evidence.spread)
    off = middle - middle[taken]
    low, high = CRITICAL * deviation[taken], CRITICAL * (deviation + np.abs(off)).max(axis=0)
    for _ in range(BISECTIONS):
        half = 0.5 * (low + high)
        inside = np.sum(weights * (norm.cdf((half - off) / deviation) - norm.cdf((-half - off) / deviation)), axis=0)
        low, high = np.where(inside < LEVEL, half, low), np.where(inside < LEVEL, high, half)
    return np.asarray(high / (CRITICAL * deviation[taken]))


def friction_spread(evidence: Evidence, scored: Scored) -> float:
    """Standard deviation of friction from run to run over its mean, by the posterior over the tried ones.

    0 for a single training run, which tells nothing of it.
    """
    if len(evidence.model.train.samples.runs) < 2:
        return 0.0
    spreads = [RunSpread(*pair) for pair in product(RUN_SPREADS, RUN_SPREADS)]
    plain = Evidence(replace(evidence.model, common_zero=True), evidence.noise)
    odds = np.array([plain.score(scored.terms, spread=spread).log_odds for spread in spreads])
    weights = np.exp(odds - odds.max()) / np.exp(odds - odds.max()).sum()
    return float(np.sqrt(weights @ np.array([s.friction**2 for s in spreads])))


def of_runs(evidence: Evidence, split: Split, scored: Scored, residual: FloatArray, spread: float) -> FloatArray:
    """(N,) the part of a residual (N,) that is friction which differs from run to run by a `friction_spread`.

    What a run shows beyond `TAKEN_OVER` of it is something else, and stays.
    """
    blocks = evidence.model.of_runs(split, RunSpread(spread))
    if not blocks:
        return np.zeros(residual.size)
    prior = Prior.stacked([block.prior for block in blocks])
    columns = np.concatenate([block.values for block in blocks], axis=1)
    white, target = (split.rows.whitened(each, evidence.noise)[0] for each in (columns, residual[:, None]))
    own = mode(Products.of(white, target[:, 0], evidence.noise.share), prior, scored.posterior.variance)
    most = TAKEN_OVER * prior.deviation
    return np.asarray(columns @ np.clip(own, -most, most))


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
