"""Whether a set of effects holds: the pooled predictive density of the held-out runs must not fall."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.priors import ALTERNATIVE, FALLS
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.search import more_probable, settled
from drake_tc.diagnosis.split import is_filter
from drake_tc.types import FloatArray


def timing_holds(evidence: Evidence, scored: Scored) -> tuple[Scored, tuple[Term, ...]]:
    """The set without lags of the effort that only the noise of one channel asks for, and these.

    A lag of the recorded effort can explain noise of the effort, and one of the effort that the model needs can explain
    noise of the load. What acts in the drive is seen by both. A delay passes all noise and explains none. Either way
    the logs must tell the lag from none under the noise that is left without it; the set with the lag, whose noise it
    colours, may have either. Noise that distorts the fit without it is no explanation (`Evidence.rank`).
    """
    dropped: list[Term] = []
    for share in (0.0, 1.0):
        lags = [t for t in scored.terms if is_filter(t) and not t.effect.ages_of]
        for term in [t for t in lags if not evidence.model.is_declared(t.effect)]:
            rest = [t for t in scored.terms if t is not term]
            shared = Evidence(evidence.model.with_share(share), evidence.noise, evidence.spread)
            noises = [shared.heard(terms) for terms in (scored.terms, rest)]
            with_lag = max(own.rank(own.refined(own.score(scored.terms))) for own in noises)
            without = noises[1].rank(noises[1].refined(noises[1].score(rest)))
            if with_lag < (without[0], without[1] + ALTERNATIVE):
                dropped.append(term)
                scored = evidence.refined(evidence.score(rest))
    return scored, tuple(dropped)


def confirmed(evidence: Evidence, scored: Scored) -> tuple[Scored, tuple[Term, ...]]:
    """The part of a set that predicts the held-out runs best where the whole set predicts them worse, and the rest.

    All held-out runs count together: no run has a veto. What the training runs hardly ask for must not be less
    probable by training and held-out runs together. Effects that take each other's place hide each other's fault,
    so that every part of the set is tried, not only what is left when one effect goes. The held-out runs are judged
    under the noise of the set, and with rows that count alike, because a whitened error can fall while the error itself
    grows.
    """
    dropped: list[Term] = []
    while True:
        asked = [t for t in scored.terms if not evidence.model.is_declared(t.effect)]
        parts = [gone for count in range(len(asked) + 1) for gone in combinations(asked, count)]
        gains, of_fit = np.zeros(len(parts)), evidence.score(scored.terms).posterior.variance
        for noise in (evidence, evidence.tempered(scored.terms)):
            variance = noise.score(scored.terms).posterior.variance
            left = [[t for t in scored.terms if t not in gone] for gone in parts]
            density = np.array([noise.predictive(rest, variance, evidence, of_fit) for rest in left])
            gains = np.maximum(gains, density - density[0] - _improbable(noise, scored, parts))
        gains -= [_asked(evidence, scored, gone) for gone in parts]
        worst = parts[int(np.argmax(gains))]
        if gains.max() <= 0.0:
            return scored, tuple(dropped)
        dropped += worst
        scored = evidence.refined(evidence.score([t for t in scored.terms if t not in worst]))


def _asked(evidence: Evidence, scored: Scored, gone: Sequence[Term]) -> float:
    """Log density of the held-out runs that a part of a set must cost: `FALLS`, or less where the training runs by
    themselves name it by less than that.
    """
    if len(gone) != 1:
        return FALLS
    rest = settled(evidence, evidence.score([t for t in scored.terms if t is not gone[0]]))
    return float(np.clip(more_probable((evidence, scored), rest) - ALTERNATIVE, 0.0, FALLS))


def _improbable(noise: Evidence, scored: Scored, parts: Sequence[tuple[Term, ...]]) -> FloatArray:
    """(P,) log prior density of the ages that parts of a set need less than that of those which the whole set needs.

    Without an effect, ages that the channels do not have can predict as well.
    """
    each = [noise.score([t for t in scored.terms if t not in gone]) for gone in parts]
    cost = np.array([noise.age_cost(part) for part in each])
    return np.asarray(np.maximum(cost - noise.age_cost(noise.score(scored.terms)), 0.0))
