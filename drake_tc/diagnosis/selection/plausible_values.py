"""Can the fitted values of an effect be believed at all, whatever the effect explains?"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import BalanceCoefficients, Columns, Term, coefficients_by_term
from drake_tc.diagnosis.problem.estimates import estimates, rests_on_bound
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.selection.shapes import PERIOD
from drake_tc.diagnosis.selection.withdrawal import (
    BelowEncoderStep,
    BelowLeastAmplitude,
    CorrectsCurve,
    FormOfKnownLoad,
    ImpossibleValues,
    NotSeenToRepeat,
    Objection,
    SizeMayBeZero,
)
from drake_tc.diagnosis.thresholds import JOINT, MOST_OF_KNOWN_LOAD, OWN_FORM, RESOLVED
from drake_tc.effects.base import Context
from drake_tc.effects.encoder_eccentricity import EncoderEccentricity
from drake_tc.effects.plausibility import implausible
from drake_tc.effects.position_dependent_load import SIZE as CURVE_SIZE
from drake_tc.effects.position_dependent_load import PositionDependentLoad
from drake_tc.effects.torque_ripple import TorqueRipple

REPEATS = 2.0
"""Periods of a ripple that the positions span, from which on it was seen to repeat."""
NORMAL_95 = 1.96
"""Standard deviations in half a 95 % interval."""
CORRECTIONS: Mapping[str, tuple[str, ...]] = {
    "encoder_offset": ("offset",),
    "encoder_eccentricity": ("eccentricity_sine", "eccentricity_cosine"),
    "encoder_ripple": ("ripple_sine", "ripple_cosine"),
}
"""Effects that correct the encoder, and the parameters [rad] whose root sum of squares the logs must resolve."""


def objection_to_values(fitted: Fit, term: Term, context: Context, columns: Columns) -> Objection | None:
    """Why the values of one effect of a fit cannot be believed, whatever they explain.

    Args:
        fitted: To the rows of `columns`.
        term: One of its effects.
        context: What the logs offer.
        columns: Training rows.
    """
    named = physical_parameters(fitted)
    values = named[term.effect.key]
    own = {
        "gain": named["drive"]["gain"],
        "viscous": named["viscous"]["viscous"],
        "coulomb": named["coulomb"]["coulomb"],
    }
    impossible = implausible(term.effect, values, replace(context, fitted=own))
    if impossible:
        return ImpossibleValues(impossible)
    if found := _within_curve(fitted, term, context) or _not_repeated(fitted, term, context, columns):
        return found
    if found_size := _size_may_be_zero(fitted, term, context, columns):
        return found_size
    names = CORRECTIONS.get(term.effect.id)
    if names is None or not math.isfinite(fitted.cv_rms):
        return None
    size, resolution = math.hypot(*(values[name] for name in names)), columns.samples.resolution
    step = max(resolution.position_step, resolution.position_noise)
    if size >= step:
        return None
    if not _is_whole_wave(term, context):
        what = names[0] if len(names) == 1 else "amplitude"
        return BelowEncoderStep(what, size, step)
    least = least_amplitude(fitted, term, context, columns)
    return None if size >= least else BelowLeastAmplitude(size, least)


def _size_may_be_zero(fitted: Fit, term: Term, context: Context, columns: Columns) -> SizeMayBeZero | None:
    """That a shape at its bound makes an effect which need not be there; None where the effect has a size.

    At the bound the search has found the end of a family of curves, not a curve: noise that acts just after reversals
    is presliding over the shortest travel that the rows can show. A true effect there has a size none the less.
    """
    ends = [p.name for p in term.effect.shapes if rests_on_bound(term.shape[p.name], p.lower, p.upper)]
    if not ends:
        return None
    found = estimates(columns, fitted, context.drive)[term.effect.key]
    sizes = [p.name for p in term.effect.coefficients if p.name in found]
    if not (sizes and all(found[name].ci95[0] <= 0.0 <= found[name].ci95[1] for name in sizes)):
        return None
    size = max(sizes, key=lambda name: abs(found[name].value))
    return SizeMayBeZero(ends[0], size, found[size].value, *found[size].ci95, found[size].unit)


def _within_curve(fitted: Fit, term: Term, context: Context) -> CorrectsCurve | None:
    """That a ripple beside a curve over the position corrects that curve's form; None where it does not.

    A curve of k coefficients takes the form of waves of which the positions span up to k/2 periods (Nyquist). What it
    leaves of a longer wave than that is the error of its form, not a second wave.
    """
    if not (
        isinstance(term.effect, TorqueRipple) and any(isinstance(t.effect, PositionDependentLoad) for t in fitted.terms)
    ):
        return None
    periods = term.shape[PERIOD] * context.turns
    return None if periods >= CURVE_SIZE / 2 else CorrectsCurve(periods, CURVE_SIZE)


def _not_repeated(fitted: Fit, term: Term, context: Context, columns: Columns) -> NotSeenToRepeat | None:
    """That a ripple is a curve over the position; None where it was seen to repeat.

    A wave repeats from its second period on. One that was seen for less counts where a curve of free form in its place
    leaves twice as much, and it leaves next to nothing but noise: three numbers then say more than seven.
    """
    if not isinstance(term.effect, TorqueRipple) or term.shape[PERIOD] * context.turns >= REPEATS:
        return None
    curve = PositionDependentLoad()
    if not curve.unavailable(context):
        others = [t for t in fitted.terms if t is not term and not isinstance(t.effect, PositionDependentLoad)]
        instead = fit(columns, [*others, Term(curve, curve.shape_grid(context)[0])])
        known = BalanceCoefficients.of(fitted.terms, fitted.beta, columns.samples.signals.rotor_inertia)
        floor = fitted.gain * columns.samples.floor.torque(known.stiffness, known.viscous, known.inertia)
        if fitted.cv_rms <= min((1.0 - JOINT.own_gain) * instead.cv_rms, JOINT.own_floors * floor):
            return None
    return NotSeenToRepeat(term.shape[PERIOD] * context.turns, REPEATS, term.shape[PERIOD])


def looks_like_known_load(fitted: Fit, term: Term, columns: Columns) -> FormOfKnownLoad | None:
    """That a curve over the position is no cause of its own; None where it is.

    A wave of one cycle a turn is gravity's own form where its phase is that of gravity.

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
    zero = term.effect.free_form and bool(np.ptp(columns.samples.signals.load_slope) > 0.0)
    return FormOfKnownLoad(share, zero)


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


def _is_whole_wave(term: Term, context: Context) -> bool:
    """Whether the correction is a wave over the angle of which the motion covers at least one period.

    A constant, or a part of a wave that looks like one, is no error of the encoder below one step: an encoder that cuts
    off instead of rounding reads half a step less.
    """
    if term.effect.id == "encoder_offset":
        return False
    turns = (context.position_span[1] - context.position_span[0]) / (2.0 * math.pi)
    return term.shape.get(PERIOD, 1.0) * turns >= 1.0


def least_amplitude(fitted: Fit, term: Term, context: Context, columns: Columns) -> float:
    """Smallest amplitude [rad] that the logs resolve of a wave of the encoder's error: 4 sigma.

    sigma^2 = (s_sine^2 + s_cosine^2)/2 + (step^2/12) (2/n)

    with s the estimates' standard deviations and n the steps that the training rows cross. Rounding errs anew with
    every step, and (step^2/12)(2/n) is the variance that it leaves of a wave fitted to n readings, so that the average
    over many steps resolves far less than one.
    """
    found = estimates(columns, fitted, context.drive)[term.effect.key]
    widths = [found[name].ci95[1] - found[name].ci95[0] for name in CORRECTIONS[term.effect.id]]
    spread = math.hypot(*widths) / math.sqrt(2.0) / (2.0 * NORMAL_95)
    rounding = columns.samples.resolution.position_step * math.sqrt(2.0 / (12.0 * crossed_steps(columns.samples)))
    return RESOLVED * math.hypot(spread, rounding)


def crossed_steps(samples: Samples) -> float:
    """Steps of the encoder that the rows cross, at least 1 and at most as many as there are rows."""
    step = samples.resolution.position_step
    travel = float(np.abs(samples.signals.velocity[samples.rows]).sum()) * samples.row_period
    return max(min(travel / step, float(samples.rows.size)), 1.0) if step > 0.0 else float(samples.rows.size)
