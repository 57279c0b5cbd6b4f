"""A column that is recorded with a delay d > 0: the true value at t is  x*(t) = x(t + d).

*The effort.* A current that passes the drive's low-pass before it is logged, a command that is logged one cycle after
it was sent, and columns with the time stamp of their arrival run behind the motion. No effect can express this, because
no drive acts before its command. Friction is then wrong, and several effects together imitate the lead well on the runs
that they are fitted to.

*The position of a servo with a torque sensor.* With the servo's stiffness K, a position that is late by d adds K d to
the viscous friction, which is always fitted, and K d^2/2 to the inertia, which looks like a payload.

*The torque sensor.* Behind a low-pass or a slow bus it comes late against motion and effort. The effect
`delay.torque_sensor` tells a short delay to first order, d times the rate of the torque. A torque that changes within d
is beyond that order, as at the reversals of a joint with friction.

Where the declared model leaves more than the noise, leads d of up to 50 ms are therefore tried on the declared model. A
lead is taken if with it the declared model leaves at most half of its error, and less than the model that was found
without a lead.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.thresholds import LEAD_FLOORS, LEAD_LEAVES, LEADS, LONGEST_LEAD
from drake_tc.errors import IdentificationError

REFINEMENTS = 8
LEAD_PARAMETERS = 3
"""Number of parameters from which on a lead, which is one parameter, may replace effects although it leaves more."""


def recorded_late(prepare: Callable[..., Prepared], plain: Prepared, chosen: Sequence[Term]) -> Prepared | None:
    """The joint with an effort that acts before it is recorded, where its declared model then fits much better.

    Args:
        prepare: The joint whose effort is `sampled_late` sampling periods older than recorded; negative: younger.
        plain: The joint with the effort as recorded.
        chosen: Terms of the model that was found for it.

    Returns:
        None where the declared model leaves at most `LEAD_FLOORS` noise floors, where a robot's model gives the load,
        or where no lead leaves at most `LEAD_LEAVES` of its error and less than the model that was found.
    """
    period = plain.train.samples.signals.period
    return _earlier(lambda lead: prepare(sampled_late=-lead / period), plain, chosen)


def position_recorded_late(
    prepare: Callable[..., Prepared], plain: Prepared, chosen: Sequence[Term]
) -> Prepared | None:
    """The joint with a position that is recorded late, where its declared model then fits much better.

    Only for a position servo with a torque sensor. The rule is that of `recorded_late`, with two differences. A lead
    that leaves at most `LEAD_FLOORS` noise floors is also taken in place of effects that leave less, if these have at
    least `LEAD_PARAMETERS` parameters: together they imitate the lead to second order. A delay or lag with fewer
    parameters is not replaced, because a late command differs from a late position only in the rates of load and
    friction.

    Args:
        prepare: Called as `prepare(position_late=d)`; the joint whose position is recorded d [s] late.
        plain: The joint with the position as recorded.
        chosen: Terms of the model that was found for it.
    """
    if plain.context.drive != "position_servo" or plain.context.load != "torque":
        return None
    if not _are_several(plain, chosen) and any(term.effect.id in LATE for term in chosen):
        return None
    return _earlier(lambda lead: prepare(position_late=lead), plain, chosen, _enough(plain, chosen))


def torque_recorded_late(prepare: Callable[..., Prepared], plain: Prepared, chosen: Sequence[Term]) -> Prepared | None:
    """The joint with a measured torque that is recorded late, where its declared model then fits much better.

    The rule is that of `position_recorded_late`, but a delay or lag with fewer parameters is replaced where it leaves
    more than `LEAD_FLOORS` noise floors: a delay that the effect `delay.torque_sensor` explains is named.

    Args:
        prepare: Called as `prepare(torque_late=d)`; the joint whose torque is recorded d [s] late.
        plain: The joint with the torque as recorded.
        chosen: Terms of the model that was found for it.
    """
    if plain.context.load != "torque":
        return None
    explained = fit(plain.train, chosen).cv_rms <= LEAD_FLOORS * plain.floor
    if explained and not _are_several(plain, chosen):
        return None
    return _earlier(lambda lead: prepare(torque_late=lead), plain, chosen, _enough(plain, chosen))


def _are_several(plain: Prepared, chosen: Sequence[Term]) -> bool:
    """Whether a lead, which is one parameter, may replace what was found although it leaves more."""
    return sum(t.size for t in chosen) - sum(t.size for t in plain.terms) >= LEAD_PARAMETERS


def _enough(plain: Prepared, chosen: Sequence[Term]) -> float:
    """Error [effort] that a lead may leave in place of what was found; 0 where it must leave less."""
    return LEAD_FLOORS * plain.floor if _are_several(plain, chosen) else 0.0


def _earlier(
    way: Callable[[float], Prepared], plain: Prepared, chosen: Sequence[Term], enough: float = 0.0
) -> Prepared | None:
    left = fit(plain.train, plain.terms).cv_rms
    if plain.context.load in ("robot", "links") or left <= LEAD_FLOORS * plain.floor:
        return None
    least, lead = _best_lead(way, left, plain.train.samples.signals.period)
    taken = least <= LEAD_LEAVES * left and least < max(fit(plain.train, chosen).cv_rms, enough)
    return way(lead) if taken else None


def _best_lead(way: Callable[[float], Prepared], left: float, period: float) -> tuple[float, float]:
    """Least error [effort] of the declared model, and the lead [s] that leaves it; `left` and 0 without a lead."""

    def error(lead: float) -> float:
        """Cross-validated error [effort] of the declared model with this lead [s]."""
        try:
            tried = way(lead)
        except IdentificationError:
            return np.inf
        return float(fit(tried.train, tried.terms).cv_rms)

    shortest = 0.5 * min(period, LONGEST_LEAD)
    leads, errors = [0.0, shortest], [left, error(shortest)]
    if errors[1] >= left:
        return left, 0.0
    leads += [float(lead) for lead in np.geomspace(shortest, LONGEST_LEAD, LEADS)[1:]]
    errors += [error(lead) for lead in leads[2:]]
    best = int(np.argmin(errors))
    if best == len(leads) - 1:
        return left, 0.0
    refined = minimize_scalar(error, bounds=(leads[best - 1], leads[best + 1]), options={"maxiter": REFINEMENTS})
    return min((float(refined.fun), float(refined.x)), (errors[best], leads[best]))
