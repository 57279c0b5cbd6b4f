"""A servo whose integral is not zero when a log begins: it holds a load there, or it moved before.

    y + K_i (I_0 + int_0^t y dt') = K (tau + J qddot + ...)

The charge I_0 of each stretch of log is not known. It adds a constant, and constants of several runs differ, so that
`ServoIntegrator`, whose integral begins at zero, leaves most of the error. All channels less their means over the rows
of each stretch (`Samples.centred`) obey the same balance without I_0. Effects that act as a constant then cannot be
found, so this is tried only where what was found leaves more than the noise. It is taken if integral action then leaves
at most half of the error of the declared model on the same rows, and less than what was found; at most half of it, if
that has integral action whose integral begins at zero.
"""

from collections.abc import Callable, Sequence

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.thresholds import LEAD_FLOORS, LEAD_LEAVES
from drake_tc.effects.servo_integrator import ServoIntegrator


def charged_integrator(prepare: Callable[..., Prepared], plain: Prepared, chosen: Sequence[Term]) -> Prepared | None:
    """The joint with channels less their means, where integral action then explains much more.

    Args:
        prepare: Called as `prepare(centred=True)`.
        plain: The joint with the channels as recorded.
        chosen: Terms of the model that was found for it.

    Returns:
        None for other drives, for the load of a robot's model, and where the charge of an integral is not the cause.
    """
    if plain.context.drive != "position_servo" or plain.context.load not in ("torque", "pendulum", "unknown"):
        return None
    found = fit(plain.train, chosen).cv_rms
    if found <= LEAD_FLOORS * plain.floor:
        return None
    centred = prepare(centred=True)
    declared = [t for t in centred.terms if not isinstance(t.effect, ServoIntegrator)]
    left = fit(centred.train, [*declared, Term(ServoIntegrator())]).cv_rms
    others = [t for t in chosen if not isinstance(t.effect, ServoIntegrator)]
    if len(others) < len(chosen):  # without the means every error is smaller
        found *= LEAD_LEAVES
    worse = min(found, fit(centred.train, others).cv_rms)
    taken = left <= LEAD_LEAVES * fit(centred.train, declared).cv_rms and left < worse
    return centred if taken else None
