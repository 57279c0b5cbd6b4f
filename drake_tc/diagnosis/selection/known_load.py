"""Whether a curve over the position is a cause of its own, or only corrects the known load.

A wrong scale of the load torque tau, a wrong inertia and a constant together make the error

    curve = a tau + b qddot + c                                                                  (scale)

and gravity is a sine of the angle. A curve of free form that is mostly (scale) is not a cause of its own. The error of
an eccentric encoder is a sine of the angle too, and its phase may happen to be near that of gravity. An eccentricity is
kept if it leaves little but noise, and at most half of the error that (scale) leaves in its place: its two parameters
then explain more than the three of (scale).
"""

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit, noise_floor, score
from drake_tc.diagnosis.selection.withdrawal import FormOfKnownLoad
from drake_tc.diagnosis.thresholds import JOINT, MOST_OF_KNOWN_LOAD, OWN_FORM
from drake_tc.effects.base import Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.encoder_eccentricity import EncoderEccentricity
from drake_tc.effects.position_dependent_load import PositionDependentLoad
from drake_tc.types import FloatArray


class ScaleOfKnownLoad(TorqueEffect):
    """a tau + b qddot + c [N m], the error of a wrong known load; for comparison only."""

    id = "scale of the known load"
    title = "scale of the known load"
    kind = "load"
    coefficients = (Parameter("load", "-"), Parameter("inertia", "kg*m^2"), Parameter("level", "N*m"))
    signature = Signature(x="load_torque", split="", look_for="")

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 3)."""
        return np.column_stack([signals.load_torque, signals.acceleration, np.ones(len(signals))])


def looks_like_known_load(fitted: Fit, term: Term, columns: Columns) -> FormOfKnownLoad | None:
    """The objection that a curve over the position only corrects the known load; None if it is a cause of its own.

    Args:
        fitted: To the rows of `columns`.
        term: One of its effects.
        columns: Training rows.
    """
    if not isinstance(term.effect, PositionDependentLoad | EncoderEccentricity):
        return None
    share, own = share_of_known_load(fitted, term, columns)
    if share <= MOST_OF_KNOWN_LOAD or own > OWN_FORM * fitted.rms / fitted.gain:
        return None
    if not term.effect.free_form and _says_more(fitted, term, columns):
        return None
    zero = term.effect.free_form and bool(np.ptp(columns.samples.signals.load_slope) > 0.0)
    return FormOfKnownLoad(share, zero)


def _says_more(fitted: Fit, term: Term, columns: Columns) -> bool:
    """Whether a term leaves little but noise, and at most half of what `ScaleOfKnownLoad` leaves in its place."""
    others = [t for t in fitted.terms if t is not term]
    instead = score(columns, [*others, Term(ScaleOfKnownLoad(), {})])
    floor = noise_floor(columns, fitted)
    return fitted.cv_rms <= min((1.0 - JOINT.own_gain) * instead.cv_rms, JOINT.own_floors * floor)


def share_of_known_load(fitted: Fit, term: Term, columns: Columns) -> tuple[float, float]:
    """Share of a curve's variance that the known load explains, R^2 of  curve = a tau + b qddot + c + d s, and the RMS
    of the remainder [N m].

    Without its inertial part, the load of a pendulum is gravity. A wrong zero of the pendulum adds a multiple of the
    slope s = d tau/dq to a curve of free form. For an eccentricity d = 0, because its phase is compared with that of
    gravity. The share is 0 where no load is known.

    Args:
        fitted: To the rows of `columns`.
        term: The curve.
        columns: Training rows.
    """
    signals = columns.samples.signals
    slope_of = signals.load_slope if term.effect.free_form else np.zeros(len(signals))
    forms = (signals.load_torque, signals.acceleration, slope_of)
    load, acceleration, slope = (columns.samples.reduce(x) for x in forms)
    theta = next(theta for t, theta in coefficients_by_term(fitted.terms, fitted.beta) if t is term)
    curve = columns.of(term) @ theta
    known = np.column_stack([np.ones(load.size), load, acceleration, slope])
    if not (np.ptp(load) > 0.0 and np.ptp(curve) > 0.0):
        return 0.0, float(np.std(curve))
    left = curve - known @ np.linalg.lstsq(known, curve, rcond=None)[0]
    return 1.0 - float(np.var(left) / np.var(curve)), float(np.std(left))
