"""Can the fitted values of an effect be believed at all, whatever the effect explains?"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.estimates import estimates, rests_on_bound
from drake_tc.diagnosis.problem.parameters import physical_parameters
from drake_tc.diagnosis.problem.regression import Fit, fit, noise_floor
from drake_tc.diagnosis.selection.shapes import PERIOD
from drake_tc.diagnosis.selection.withdrawal import (
    BelowEncoderStep,
    BelowLeastAmplitude,
    CorrectsCurve,
    ImpossibleValues,
    NotSeenToRepeat,
    Objection,
    SizeMayBeZero,
)
from drake_tc.diagnosis.thresholds import JOINT, RESOLVED
from drake_tc.effects.base import Context
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
    """That the effect need not be there, by a shape or by a column that is not its size; None where it has a size.

    At the bound of a shape the search has found the end of a family of curves, not a curve: noise that acts just after
    reversals is presliding over the shortest travel that the rows can show. A true effect there has a size none the
    less. An effect with more columns than sizes may explain by the other columns alone: elasticity has rates of the
    torque, and the sum of a noisy torque and its second derivative is a low-pass of it.
    """
    effect = term.effect
    ends = [p.name for p in effect.shapes if rests_on_bound(term.shape[p.name], p.lower, p.upper)]
    shapes = {p.name for p in (*effect.shapes, *effect.given_shapes)}
    sizes = [p.name for p in effect.parameters if p.name not in shapes]
    if not (sizes and (ends or len(sizes) < len(effect.coefficients))):
        return None
    found = estimates(columns, fitted, context.drive)[term.effect.key]
    if not all(found[name].ci95[0] <= 0.0 <= found[name].ci95[1] for name in sizes):
        return None
    size = max(sizes, key=lambda name: abs(found[name].value))
    at_bound = ends[0] if ends else None
    return SizeMayBeZero(at_bound, size, found[size].value, *found[size].ci95, found[size].unit)


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
        most = min((1.0 - JOINT.own_gain) * instead.cv_rms, JOINT.own_floors * noise_floor(columns, fitted))
        if fitted.cv_rms <= most:
            return None
    return NotSeenToRepeat(term.shape[PERIOD] * context.turns, REPEATS, term.shape[PERIOD])


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
