"""A rotor inertia against effects that stand in for it without the noise of an acceleration.

A torque sensor on a link of inertia J_l with a load f(q) records tau = J_l qddot + f(q). A rotor J adds

    J qddot = (J/J_l) (tau - f(q)),

so that a smaller 1/K and a function of the position explain as much as the rotor does, and less of the acceleration's
noise is left. Errors of a fitted inertia are therefore compared with the noise floor that this inertia brings.
"""

from collections.abc import Set

from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.selection.withdrawal import ReplacesInertia
from drake_tc.diagnosis.thresholds import JOINT
from drake_tc.effects.rotor_inertia import RotorInertia

LEFT_OF_INERTIA = 0.1
"""Share of the declared model's inertia, at or below which an effect beside it leaves nothing of the inertia."""


def replaces_inertia(
    columns: Columns, fitted: Fit, term: Term, known: Set[str], noise: float
) -> ReplacesInertia | None:
    """That an effect leaves nothing of a declared inertia with which the declared model fits; None elsewhere.

    Args:
        columns: Training rows.
        fitted: To them.
        term: An effect of the fit that the declared model does not have.
        known: Keys of the declared effects.
        noise: Noise floor of the declared model, its own inertia's included [effort].
    """
    with_it = _inertia(fitted)
    if with_it is None or with_it[0].effect.key not in known:
        return None
    declared = fit(columns, [t for t in fitted.terms if t.effect.key in known])
    before, floors = _inertia(declared), declared.rms / max(noise, 1e-300)
    if before is None or with_it[1] > LEFT_OF_INERTIA * before[1] or floors > JOINT.own_floors:
        return None
    alone = _inertia(fit(columns, [t for t in fitted.terms if t is not term]))
    if alone is None or alone[1] <= LEFT_OF_INERTIA * before[1]:
        return None
    return ReplacesInertia(before[1], floors)


def leaves_noise_of_its_inertia(columns: Columns, fitted: Fit, known: Set[str]) -> bool:
    """Whether a rotor inertia was added and little more is left than the noise of the fit with it.

    Args:
        columns: Training rows.
        fitted: To them.
        known: Keys of the declared effects.
    """
    found = _inertia(fitted)
    if found is None or found[0].effect.key in known:
        return False
    return fitted.rms <= JOINT.own_floors * noise_floor(columns, fitted)


def _inertia(fitted: Fit) -> tuple[Term, float] | None:
    for term, theta in coefficients_by_term(fitted.terms, fitted.beta):
        if isinstance(term.effect, RotorInertia):
            return term, float(theta[0])
    return None
