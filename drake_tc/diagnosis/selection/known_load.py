"""Is a curve over the position a cause of its own, or does it correct the known load?

A wrong scale of the load, a wrong inertia and a level make an error

    c = a tau + b qddot + d                                                                      (scale)

and gravity is one wave over the angle. A curve of free form that is mostly (scale) is no cause of its own. An encoder's
eccentricity is a wave too, whose phase may happen to be near that of gravity; it is kept where (scale) in its place
leaves twice as much, and the eccentricity itself leaves next to nothing but noise: then its two numbers say more than
the three of (scale).
"""

import numpy as np

from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit, score
from drake_tc.diagnosis.selection.withdrawal import FormOfKnownLoad
from drake_tc.diagnosis.thresholds import JOINT, MOST_OF_KNOWN_LOAD, OWN_FORM
from drake_tc.effects.base import Parameter, Shape, Signals, Signature, TorqueEffect
from drake_tc.effects.encoder_eccentricity import EncoderEccentricity
from drake_tc.effects.position_dependent_load import PositionDependentLoad
from drake_tc.types import FloatArray


class ScaleOfKnownLoad(TorqueEffect):
    """a tau + b qddot + d [N m]: what an error of the known load explains; for comparison only."""

    id = "scale of the known load"
    title = "scale of the known load"
    kind = "load"
    coefficients = (Parameter("load", "-"), Parameter("inertia", "kg*m^2"), Parameter("level", "N*m"))
    signature = Signature(x="load_torque", split="", look_for="")

    def columns(self, signals: Signals, shape: Shape) -> FloatArray:
        """Phi (T, 3)."""
        return np.column_stack([signals.load_torque, signals.acceleration, np.ones(len(signals))])


def looks_like_known_load(fitted: Fit, term: Term, columns: Columns) -> FormOfKnownLoad | None:
    """That a curve over the position is no cause of its own; None where it is.

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
    """Whether a term leaves half of what the known load's scale in its place leaves, and little but noise."""
    others = [t for t in fitted.terms if t is not term]
    instead = score(columns, [*others, Term(ScaleOfKnownLoad(), {})])
    return fitted.cv_rms <= min((1.0 - JOINT.own_gain) * instead.cv_rms, JOINT.own_floors * noise_of(fitted, columns))


def noise_of(fitted: Fit, columns: Columns) -> float:
    """Noise floor of the rows under a fit's coefficients [effort]."""
    known = BalanceCoefficients.of(fitted.terms, fitted.beta, columns.samples.signals.rotor_inertia)
    return float(fitted.gain * columns.samples.floor.torque(known.stiffness, known.viscous, known.inertia))


def share_of_known_load(fitted: Fit, term: Term, columns: Columns) -> tuple[float, float]:
    """Share of a curve's variance that the known load explains, R^2 of  curve = a tau + b qddot + c + d s, and the RMS
    of what it leaves [N m].

    Without its inertial part the load of a pendulum is gravity, and its slope s = d tau/dq is what a wrong zero adds to
    a curve of free form (d = 0 for a wave, whose phase is held against gravity's). 0 where no load is known.

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
