"""Whether a set of effects holds: the pooled predictive density of the held-out runs must not fall."""

from drake_tc.diagnosis.evidence import Evidence, Scored
from drake_tc.diagnosis.model import is_filter
from drake_tc.diagnosis.priors import FALLS
from drake_tc.diagnosis.problem.columns import Term


def held_gain(evidence: Evidence, scored: Scored, term: Term) -> float:
    """Log p(held-out | training) with a term less that without it, under the noise of the set with it."""
    rest = [t for t in scored.terms if t is not term]
    variance = scored.posterior.variance
    return evidence.predictive(scored.terms, variance) - evidence.predictive(rest, variance)


def timing_holds(evidence: Evidence, scored: Scored) -> tuple[Scored, tuple[Term, ...]]:
    """The set without filters of the effort that only the noise of one channel asks for, and these.

    A filter of the recorded effort can explain noise of the effort, and one of the effort that the model needs can
    explain noise of the load. What acts in the drive is seen by both.
    """
    dropped: list[Term] = []
    for share in (0.0, 1.0):
        for term in [t for t in scored.terms if is_filter(t) and not evidence.model.is_declared(t.effect)]:
            other = Evidence(evidence.model.with_share(share), evidence.noise, evidence.spread)
            rest = [t for t in scored.terms if t is not term]
            if other.refined(other.score(scored.terms)).log_odds < other.refined(other.score(rest)).log_odds:
                dropped.append(term)
                scored = evidence.refined(evidence.score(rest))
    return scored, tuple(dropped)


def confirmed(evidence: Evidence, scored: Scored) -> tuple[Scored, tuple[Term, ...]]:
    """The set without the effects whose absence predicts the held-out runs better, the worst one first, and these.

    All held-out runs count together: no run has a veto.
    """
    dropped: list[Term] = []
    while True:
        asked = [t for t in scored.terms if not evidence.model.is_declared(t.effect)]
        gains = [(held_gain(evidence, scored, t), i) for i, t in enumerate(asked)]
        if not gains or min(gains)[0] >= -FALLS:
            return scored, tuple(dropped)
        worst = asked[min(gains)[1]]
        dropped.append(worst)
        scored = evidence.refined(evidence.score([t for t in scored.terms if t is not worst]))
