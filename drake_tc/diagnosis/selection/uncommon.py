"""Effects that a search looks for only where the common ones leave much that one of them explains.

Each resembles a more common effect and would be named in its place now and then if both were always tried. Where the
model of common effects is wrong, however, these imitate the cause: a torque constant that falls with the current looks
like gear friction that depends on the direction of power, and two thirds of the error remain.

A wave of any period, amplitude and phase fits much that it is not, for example viscous friction that varies with the
position. It must therefore leave next to nothing but noise. Noise of the recorded effort is such noise, and so is
what a torque sensor leaves that wanders (`without_wander`). The wave must then explain as much without what wanders:
an effect that is as slow as the wander is followed by that line, with or without the wave.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.data.noise_colour import left_by_effort_noise
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.root_mean_square import rms
from drake_tc.diagnosis.selection.engine import Progress, select
from drake_tc.diagnosis.selection.joint_problem import JointProblem, Search
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.diagnosis.selection.shapes import PERIOD
from drake_tc.diagnosis.selection.wander import without_wander
from drake_tc.diagnosis.thresholds import LEAST_UNCOMMON, SearchThresholds
from drake_tc.effects.base import Effect


def with_uncommon_effects(
    problem: JointProblem, found: Search, uncommon: Sequence[Effect], thresholds: SearchThresholds, progress: Progress
) -> tuple[JointProblem, Search]:
    """The problem and its search with those uncommon effects that explain a quarter of what is left, else as they are.

    The new search is taken where it chose one of them and leaves a quarter less than the old one, and with a wave
    (`cycles_per_turn`) next to nothing but noise.

    Args:
        problem: One joint's, with common effects.
        found: What the search of these chose.
        uncommon: Effects that can be looked for.
        thresholds: What counts as real.
        progress: Told how far it is.
    """
    most = (1.0 - LEAST_UNCOMMON) * found.chosen.cv_rms
    if most < problem.noise:
        return problem, found
    telling = [effect for effect in uncommon if _least_error(problem, found, effect) <= most]
    if not telling:
        return problem, found
    wider = replace(problem, effects=[*problem.effects, *telling])
    other = select(wider, found.baseline, thresholds, progress)
    keys = {effect.key for effect in telling}
    named = [term.effect for term in other.chosen.terms if term.effect.key in keys]
    taken = bool(named) and other.chosen.cv_rms <= most
    if any(parameter.name == PERIOD for effect in named for parameter in effect.shapes):
        taken = taken and _leaves_noise(problem, found.chosen, other.chosen, thresholds)
    return (wider, other) if taken else (problem, found)


def _leaves_noise(problem: JointProblem, before: Fit, after: Fit, thresholds: SearchThresholds) -> bool:
    """Whether a fit with a wave leaves at most `own_floors` noise floors, beside what a torque sensor wanders."""
    samples = problem.columns.samples
    floor = np.hypot(problem.noise, left_by_effort_noise(samples, after.residual, problem.noise))
    if after.cv_rms <= thresholds.own_floors * floor:
        return True
    if problem.context.load != "torque":
        return False
    time = samples.signals.time[samples.rows]
    fast, fast_before = (rms(without_wander(each.residual, time, samples.run)) for each in (after, before))
    return bool(fast <= min(thresholds.own_floors * floor, (1.0 - LEAST_UNCOMMON) * fast_before))


def _least_error(problem: JointProblem, found: Search, effect: Effect) -> float:
    """Cross-validated RMS [effort] with the effect beside the model found, or beside the declared one.

    The model found may hold an imitation of the effect.
    """
    tried = [problem.at_best_shape(parent, effect) for parent in (found.chosen, found.baseline)]
    return refine(problem.columns, min(tried, key=lambda each: each.cv_rms), evaluations=30).cv_rms
