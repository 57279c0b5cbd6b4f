"""An effort that is recorded after it acted: y*(t) = y(t + d), d > 0.

A current that passes the drive's low-pass before it is logged, a command that is logged one cycle after it was sent,
and columns with the time stamp of their arrival run behind the motion. No effect can say so, because no drive acts
before its command. Friction is then wrong, and other effects imitate the lead, together well enough on the runs that
they are fitted to. Where the declared model leaves more than the noise, leads up to 50 ms are therefore tried on it
alone. One is taken if the declared model leaves at most half of its error with it, and less than all that was found
without it.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.thresholds import LEAD_FLOORS, LEAD_LEAVES, LEADS, LONGEST_LEAD
from drake_tc.errors import IdentificationError

REFINEMENTS = 8


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
    left = fit(plain.train, plain.terms).cv_rms
    if plain.context.load in ("robot", "links") or left <= LEAD_FLOORS * plain.floor:
        return None
    period = plain.train.samples.signals.period

    def error(lead: float) -> float:
        """Cross-validated error [effort] of the declared model, the effort taken `lead` [s] earlier."""
        try:
            tried = prepare(sampled_late=-lead / period)
        except IdentificationError:
            return np.inf
        return float(fit(tried.train, tried.terms).cv_rms)

    shortest = 0.5 * min(period, LONGEST_LEAD)
    leads, errors = [0.0, shortest], [left, error(shortest)]
    if errors[1] >= left:
        return None
    leads += [float(lead) for lead in np.geomspace(shortest, LONGEST_LEAD, LEADS)[1:]]
    errors += [error(lead) for lead in leads[2:]]
    best = int(np.argmin(errors))
    if best == len(leads) - 1:
        return None
    refined = minimize_scalar(error, bounds=(leads[best - 1], leads[best + 1]), options={"maxiter": REFINEMENTS})
    least, lead = min((float(refined.fun), float(refined.x)), (errors[best], leads[best]))
    taken = least <= LEAD_LEAVES * left and least < fit(plain.train, chosen).cv_rms
    return prepare(sampled_late=-lead / period) if taken else None
