"""What the ages of channels leave open of the coefficients, late channels and those for which a delay stands included.

The priors of the ages hold for channels that one loop reads and writes. Now and then one comes by another way, through
a bus or a buffer, and is some milliseconds older. With a hypothesis for each channel, and that no channel is late, the
prior of the ages is a mixture of Gaussians, and so is the posterior. A named delay is such a channel, and is the only
one. Of one age a with the posterior N(u, v) under the prior N(m, d^2), the rows alone say N(u_c, v_c) with
1/v_c = 1/v - 1/d^2, and another prior N(m', d'^2) is more probable by N(u_c; m', v_c + d'^2)/N(u_c; m, v_c + d^2).
An age that would need friction below 0 is impossible: posteriors end there.

A delay is looked for under the priors without late channels: it is an age that they cannot explain. The fit holds the
ages for which a named delay stands, because the rows tell the sum of both. Here they have their priors.
"""

from dataclasses import replace

import numpy as np
from scipy.special import log_ndtr, logsumexp
from scipy.stats import norm, truncnorm

from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.priors import HELD_GAIN, LATE, LATE_S
from drake_tc.diagnosis.problem.parameters import shape_places, with_shapes
from drake_tc.diagnosis.split import LATE_RECORD
from drake_tc.types import FloatArray


def with_uncertain_ages(evidence: Evidence, scored: Scored, told: Scored) -> Scored:
    """What is told of a set, with mean and covariance of the mixture over late channels.

    Args:
        evidence: Of the set.
        scored: The set as the rows and the priors have it, whose covariance is that of both.
        told: The set without what noise takes off its coefficients.
    """
    late_by = {"position": LATE_S} | {channel: way * LATE_S for channel, way in LATE_RECORD.items()}
    places, delayed = evidence.places_of_ages(scored), any(t.effect.ages_of for t in scored.terms)
    beta, covariance = told.posterior.beta, _with_held_ages(evidence, scored)
    bounded = np.flatnonzero(evidence.design(evidence.model.train, scored.terms)[1].positive[: scored.coefficients])
    widened = told.posterior.covariance + covariance - scored.posterior.covariance
    told = replace(told, posterior=told.posterior.with_covariance(widened))
    odds, moves, widths = [0.0], [np.zeros(beta.size)], [np.zeros(beta.size)]
    for number, (channel, (mean, deviation)) in enumerate(evidence.model.ages.items()):
        if delayed or channel not in late_by:
            continue
        own, variance = beta[places.start + number], covariance[places.start + number, places.start + number]
        by_rows = 1.0 / variance - 1.0 / deviation**2
        if by_rows <= 0.0:  # the rows say nothing of this age
            continue
        alone = (own / variance - mean / deviation**2) / by_rows
        late, wide = mean + late_by[channel], float(np.hypot(deviation, LATE_S))
        prior = [norm.logpdf(alone, m, np.sqrt(1.0 / by_rows + d**2)) for m, d in ((late, wide), (mean, deviation))]
        after = 1.0 / (by_rows + 1.0 / wide**2)
        direction = covariance[:, places.start + number] / variance
        least, most = _steps(told.posterior.beta[bounded], direction[bounded])
        if not least < most:
            continue
        step = after * (alone * by_rows + late / wide**2) - own
        possible = [truncated(least, most, *each) for each in ((step, np.sqrt(after)), (0.0, np.sqrt(variance)))]
        odds.append(LATE + float(prior[0] - prior[1]) + possible[0][0] - possible[1][0])
        moves.append(direction * possible[0][1])
        widths.append(direction * np.sqrt(max(possible[0][2] - variance, 0.0)))
    return _mixed(evidence, told, np.array(odds), np.array(moves), np.array(widths))


def _steps(beta: FloatArray, direction: FloatArray) -> tuple[float, float]:
    """The least and the largest step x for which no b + x d of coefficients b, d (k,) is negative."""
    falls, grows = direction < 0.0, direction > 0.0
    return (
        float(np.max(-beta[grows] / direction[grows], initial=-np.inf)),
        float(np.min(-beta[falls] / direction[falls], initial=np.inf)),
    )


def truncated(least: float, most: float, mean: float, deviation: float) -> tuple[float, float, float]:
    """Log probability, mean and variance of a normal variable between two bounds."""
    low, high = (least - mean) / deviation, (most - mean) / deviation
    inside = truncnorm(low, high, mean, deviation)
    below, above = (low, high) if low < 0.0 else (-high, -low)  # the tail in which differences keep their digits
    chance = log_ndtr(above) + np.log1p(-np.exp(log_ndtr(below) - log_ndtr(above)))
    return float(chance), float(inside.mean()), float(inside.var())


def _mixed(evidence: Evidence, scored: Scored, odds: FloatArray, moves: FloatArray, widths: FloatArray) -> Scored:
    """The set with the moments of a mixture of posteriors (h, k), each moved, and wider along one direction."""
    weights = np.exp(odds - logsumexp(odds))
    mean = weights @ moves
    covariance = scored.posterior.covariance + (weights * widths.T) @ widths
    covariance += (weights * (moves - mean).T) @ (moves - mean)
    beta, size, terms = scored.posterior.beta + mean, scored.coefficients, scored.terms
    if scored.shapes:
        where, values = shape_places(terms)
        terms = tuple(with_shapes(terms, where, evidence.bounded(terms, where, values, mean[size : size + len(where)])))
        beta[size : size + len(where)] = 0.0
    return replace(scored, terms=terms, posterior=replace(scored.posterior, beta=beta).with_covariance(covariance))


def _with_held_ages(evidence: Evidence, scored: Scored) -> FloatArray:
    """(k, k) covariance if the ages that the fit holds have their priors."""
    hessian, at = scored.posterior.hessian.copy(), evidence.places_of_ages(scored).start
    deviations = [deviation for _, deviation in evidence.model.ages.values()]
    for number in evidence.model.held_ages(scored.terms):
        free = 1.0 / deviations[number] ** 2
        hessian[at + number, at + number] += free - free / HELD_GAIN**2
    return replace(scored.posterior, hessian=hessian).covariance
