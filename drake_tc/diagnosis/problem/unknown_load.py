"""A joint whose load is unknown: what the load may be, whether the motion tells it, and what follows from the fit.

Nothing is known of the load, so the balance reads

    0 = y*/K - J qddot - tau(q, qddot) - sum_k theta_k phi_k,      tau: `effects.unknown_load`

with tau among the declared terms and K held (`load_scale`): the effort is then the target of the regression. Once tau
is fitted, its torque stands in the signals for the effects that depend on the load.
"""

from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.data.preparation import load_scale, slower
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.priors import CLEARLY_WORSE, LEAST_UNEXPLAINED, MAX_CONDITION
from drake_tc.diagnosis.problem.columns import Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.regression import Fit, bounds_of, solve_bounded
from drake_tc.effects.base import Context
from drake_tc.effects.unknown_load import CURVE_LOADS, PENDULUM, SLIDER, SMOOTH_LOADS, UnknownLoadEffect
from drake_tc.errors import IdentificationError
from drake_tc.identification.regression import least_squares
from drake_tc.logs.loads import unknown_form
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

STEP = 1e-4
"""Of the position [rad], for the slope of the load."""


def possible_loads(rig: Rig, joint: str) -> tuple[UnknownLoadEffect, ...]:
    """What the joint's unknown load may be, the simplest first; () where the load is known."""
    form = unknown_form(rig.load[joint])
    if form is None:
        return ()
    if form == "pendulum":
        return (SLIDER,) if rig.units_of(joint).slides else (PENDULUM,)
    return SMOOTH_LOADS if load_scale(rig, joint).fitted_inertia else CURVE_LOADS


def load_of(fitted: Fit) -> tuple[Term, FloatArray] | None:
    """The term of the unknown load and its coefficients (k,); None where the fit has none."""
    found = coefficients_by_term(fitted.terms, fitted.beta)
    return next(((term, theta) for term, theta in found if isinstance(term.effect, UnknownLoadEffect)), None)


def with_fitted_load(columns: Columns, fitted: Fit) -> Columns:
    """The columns once the load is fitted: its torque in the signals, its inertia and slope in the noise floor.

    The columns themselves where the load is known.
    """
    found = load_of(fitted)
    if found is None:
        return columns
    (term, theta), samples = found, columns.samples
    s = samples.signals
    load = term.effect.columns(s, term.shape) @ theta
    moved = (replace(s, position=s.position + step) for step in (-STEP, STEP))
    ends = [term.effect.columns(each, term.shape) @ theta for each in moved]
    slope = (ends[1] - ends[0]) / (2.0 * STEP)
    inertial = isinstance(term.effect, UnknownLoadEffect) and term.effect.inertial
    inertia = float(theta[-1]) if inertial else 0.0
    slow = slower(samples.light).smooth(load)
    signals = replace(
        s, load_torque=load, expected_torque=load, slow_torque=slow, load_slope=slope, link_inertia=inertia
    )
    rms = float(np.sqrt(np.mean(slope[samples.rows] ** 2)))
    floor = replace(samples.floor, inertia=s.rotor_inertia + inertia, load_slope=rms)
    samples = replace(samples, signals=signals, floor=floor)
    return columns.changed(samples=samples)


def with_torque_span(context: Context, samples: Samples) -> Context:
    """The context with the torques that a fitted load spans; the context itself where the load is known."""
    if context.load != "unknown":
        return context
    torque = samples.signals.load_torque[samples.rows]
    return replace(context, torque_span=(float(torque.min()), float(torque.max())))


def require_identified_load(columns: Columns, declared: Fit, joint: str, context: Context) -> None:
    """Refuse rows whose motion cannot tell the parts of the unknown load apart, or whose effort has the wrong sign.

    Raises:
        IdentificationError: One line that says what to record or to declare instead.
    """
    held, samples = columns.effort_is_target, columns.samples
    if np.unique(np.sign(samples.signals.direction[samples.rows])).size < 2:
        raise IdentificationError(
            f"joint {joint}: the unknown load cannot be fitted: the joint moves in one direction only, in which a "
            "constant load is the same as Coulomb friction; record a motion in both directions"
        )
    names = ["drive gain", *(p.name for t in declared.terms for p in t.effect.coefficients)]
    design = columns.design(declared.terms)
    live = np.sqrt(np.mean(design**2, axis=0)) > 0.0
    live[0] &= not held
    try:
        least_squares(
            design[:, live],
            columns.target - declared.beta[0] * design[:, 0] if held else columns.target,
            names=[n for n, use in zip(names, live, strict=True) if use],
            max_condition=MAX_CONDITION,
        )
    except IdentificationError as error:
        span = context.position_span[1] - context.position_span[0]
        why, found = str(error).partition("; record richer")[0], load_of(declared)
        smaller = ", or set load: {unknown: smooth}" if found is not None and found[0].effect is PENDULUM else ""
        raise IdentificationError(
            f"joint {joint}: the unknown load cannot be fitted to a motion over {span:.2g} rad: {why}; record a motion "
            f"over a larger range and with changing speeds{smaller}"
        ) from None
    if held:
        _require_sign(columns, declared, joint)


def _require_sign(columns: Columns, declared: Fit, joint: str) -> None:
    """An effort that, turned, the declared model explains clearly better."""
    design, (low, high) = columns.design(declared.terms), bounds_of(declared.terms, columns.declared_gain)
    effort, rest = design[:, 0] * declared.beta[0], design[:, 1:]
    gram = rest.T @ rest
    errors = []
    for sign in (1.0, -1.0):
        target = columns.target - sign * effort
        beta = solve_bounded(gram, rest.T @ target, low[1:], high[1:])
        errors.append(float(np.sqrt(np.mean((target - rest @ beta) ** 2))))
    if errors[0] > max(CLEARLY_WORSE * errors[1], LEAST_UNEXPLAINED * float(np.std(effort))):
        raise IdentificationError(
            f"joint {joint}: the effort has the wrong sign: turned, the unknown load, inertia and friction leave "
            f"{errors[1] / errors[0]:.0%} of what they leave of it as it is; turn the command or the position column "
            "with units: {...: -...} in the rig file"
        )
