"""Effects that the data cannot tell apart."""

from collections.abc import Sequence

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.selection.joint_problem import Search, best_shape, shape_screen, share_better
from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.selection.plausible_values import objection_to_values
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.diagnosis.selection.shapes import PERIOD
from drake_tc.diagnosis.selection.withdrawal import ImpossibleValues
from drake_tc.diagnosis.thresholds import CERTAINLY_BETTER, JOINT, SAME_ERROR
from drake_tc.effects.base import Context, Effect
from drake_tc.effects.library import looked_for
from drake_tc.types import FloatArray

TWICE_AS_MUCH = 2.0
"""RMS beyond the noise of a delay over that of a lag, or the other way round, that tells which of two it is not."""


def indistinguishable(
    columns: Columns, found: Search, context: Context, floor: float, effects: Sequence[Effect] | None = None
) -> tuple[tuple[str, str], ...]:
    """Pairs (chosen, other): swapping the one for the other costs next to nothing.

    Next to nothing: the cross-validated error rises by less than 2 % and the chosen effect is the better one in fewer
    than 98 % of the block resamples, or the two predictions are the same up to a hundredth. An effect with more
    parameters is listed only if it fits better in 98 % of the block resamples: otherwise it contains the chosen one or
    imitates it. An effect whose values would be impossible in the other's place is no alternative. A delay and a lag
    are also listed when the better one explains less than half a noise floor more, which would not count as an effect,
    over all rows and in each run: a run that was made to tell them apart shall not be diluted by those that cannot.
    Where the better one itself leaves what would count as an effect, neither is the whole cause, and they are also
    listed if the other one leaves less than twice as much. A wave that was not seen to repeat is not chosen, but is
    listed beside the curve over the position that stands for it.

    Args:
        columns: Training rows.
        found: What the search chose.
        context: What the logs offer.
        floor: Noise floor [effort].
        effects: Which are tried in its place; None for the library.
    """
    known = {t.effect.key for t in found.baseline.terms}
    screen = shape_screen(columns)
    pairs: list[tuple[str, str]] = []
    for term in found.chosen.terms:
        if term.effect.key in known:
            continue
        others = [t for t in found.chosen.terms if t is not term]
        taken = {t.effect.id for t in found.chosen.terms} | set(context.declared)
        without = fit(columns, others)
        for member in looked_for(context, effects):
            if member.id in taken or member.unavailable(context):
                continue
            swapped = best_shape(columns, without, member, context, screen)
            late = LATE.issuperset((term.effect.id, member.id))
            wave = term.effect.free_form and PERIOD in swapped.terms[-1].shape
            if swapped.cv_rms > 1.3 * found.chosen.cv_rms and not (late or wave):
                continue  # the grid is too coarse to say so of a delay or a lag, and of a wave in a curve's place
            larger = swapped.size > found.chosen.size
            if larger and (swapped.cv_rms >= found.chosen.cv_rms or member.special_case == term.effect.id):
                continue
            swapped = refine(columns, swapped, evaluations=30)
            if larger and share_better(found.chosen, swapped) < CERTAINLY_BETTER:
                continue
            same = _same(found.chosen, swapped) or (
                late and _within_resolution(_errors(found.chosen, columns), _errors(swapped, columns), floor)
            )
            if same and not _impossible(swapped, context, columns):
                pairs.append((term.effect.id, member.id))
    return tuple(dict.fromkeys(pairs))


def _impossible(swapped: Fit, context: Context, columns: Columns) -> bool:
    """Whether the effect that was put in another's place, the last term, has values that break a law."""
    return isinstance(objection_to_values(swapped, swapped.terms[-1], context, columns), ImpossibleValues)


def _same(chosen: Fit, other: Fit) -> bool:
    if other.cv_rms > (1.0 + SAME_ERROR) * chosen.cv_rms:
        return False
    apart = float(np.sqrt(np.mean((chosen.residual - other.residual) ** 2)))
    return share_better(other, chosen) < CERTAINLY_BETTER or apart < 0.01 * chosen.rms


def _errors(fitted: Fit, columns: Columns) -> FloatArray:
    """(1 + r, 2) RMS over all rows and over each of r runs, cross-validated with a lag's noise charged, and plain."""
    samples = columns.samples
    rows = np.bincount(samples.run)
    first = np.unique(samples.block, return_index=True)[1]
    charged = np.bincount(samples.run[first], fitted.block_sse[samples.block[first]], rows.size)
    plain = np.bincount(samples.run, fitted.residual**2, rows.size)
    by_run = np.stack([charged, plain], axis=-1)[rows > 0] / rows[rows > 0, None]
    return np.concatenate([[[fitted.cv_rms, fitted.rms]], np.sqrt(by_run)])


def _within_resolution(chosen: FloatArray, other: FloatArray, floor: float) -> bool:
    """Whether the chosen fit nowhere explains enough more than the other to count as an improvement.

    With the noise that a lag takes out of the effort charged to it (`Columns.noise_ratio`) and without: how much of the
    residual is such noise is known roughly, and an order that rests on it tells nothing. Nor does one between two
    models of which neither fits.

    Args:
        chosen: Errors (1 + r, 2) of `_errors`.
        other: The same of the fit with the other effect.
        floor: Noise floor [effort].
    """
    least = (JOINT.least_removed * floor) ** 2
    enough = other**2 - chosen**2 >= least
    if not enough.all(axis=1).any():
        return True
    left, of_other = chosen[0] ** 2 - floor**2, other[0] ** 2 - floor**2
    return bool((left >= least).all() and (of_other < TWICE_AS_MUCH**2 * left).all())
