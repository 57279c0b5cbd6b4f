"""Which effects one joint lacks: the search of its regression, and further searches where its answer may imitate."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.drive_gain import at_reverse_regression
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection.engine import Progress, compare, select
from drake_tc.diagnosis.selection.joint_problem import JointProblem, Search
from drake_tc.diagnosis.selection.known_load import looks_like_known_load
from drake_tc.diagnosis.selection.lag_or_noise import LATE
from drake_tc.diagnosis.selection.rotor_inertia import leaves_noise_of_its_inertia
from drake_tc.diagnosis.selection.shape_refinement import refine
from drake_tc.diagnosis.selection.uncommon import with_uncommon_effects
from drake_tc.diagnosis.thresholds import SearchThresholds
from drake_tc.effects.base import Context, Effect


def search(
    columns: Columns,
    declared: Sequence[Term],
    effects: Sequence[Effect],
    context: Context,
    floor: float,
    thresholds: SearchThresholds,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
    uncommon: Sequence[Effect] = (),
) -> Search:
    """Look for the effects that a joint's declared model lacks.

    Args:
        columns: Training rows.
        declared: What the owner models.
        effects: Candidates.
        context: What the logs offer.
        floor: Noise floor [effort].
        thresholds: What counts as real.
        progress: Told how far it is.
        executor: Refines shapes beside each other; None refines them here.
        uncommon: Candidates where the others leave much that one of these explains.
    """
    known = frozenset(t.effect.key for t in declared)
    problem = JointProblem(columns, effects, context, known, floor, executor)
    baseline = at_reverse_regression(columns, refine(columns, fit(columns, declared)), context.drive)
    found = select(problem, baseline, thresholds, progress)
    problem, found = with_uncommon_effects(problem, found, uncommon, thresholds, progress)
    found = _of_simplest_causes(problem, found, thresholds, progress)
    found = _of_another_delay(problem, found, thresholds, progress)
    taken = {t.effect.id for t in found.chosen.terms}
    return replace(found, passed_over=tuple(each for each in found.passed_over if each.id not in taken))


def _of_simplest_causes(
    problem: JointProblem, found: Search, thresholds: SearchThresholds, progress: Progress
) -> Search:
    """The same search without curves of free form, where that explains as much with no more parameters.

    A curve over the position can explain most of two simpler effects at once, and neither of these enters the beam
    after it; without it an encoder's eccentricity may do the same. So where a curve was chosen, the search is repeated
    without curves, and without all effects that depend on the position. A curve in the form of the known load is no
    cause of its own; in its place fewer parameters that leave next to nothing but noise are taken. A rotor inertia is
    taken before a curve where it leaves next to nothing but the noise that it brings, and beside a torque sensor before
    any function of the position (`rotor_inertia`).
    """
    added = [t.effect for t in found.chosen.terms if t.effect.key not in problem.known]
    imitates = any(
        looks_like_known_load(found.chosen, t, problem.columns)
        for t in found.chosen.terms
        if t.effect.key not in problem.known
    )
    of_position = problem.context.load == "torque" and any(effect.depends_on_position for effect in added)
    curved = any(effect.free_form for effect in added)
    if not (imitates or of_position or curved):
        return found
    tried = [] if imitates else [found]
    for kind in ("free_form", "depends_on_position") if imitates or curved else ("depends_on_position",):
        rest = [effect for effect in problem.effects if not getattr(effect, kind)]
        tried.append(select(replace(problem, effects=rest), found.baseline, thresholds, progress))
    most = (1.0 + thresholds.same) * found.chosen.cv_rms if imitates or curved else 0.0
    if imitates:
        most = max(most, thresholds.own_floors * problem.noise)
    as_good = [
        each
        for each in tried
        if each.chosen.size <= found.chosen.size
        and (each.chosen.cv_rms <= most or leaves_noise_of_its_inertia(problem.columns, each.chosen, problem.known))
    ]
    return min(as_good, key=lambda each: problem.order(each.chosen), default=found)


def _of_another_delay(problem: JointProblem, found: Search, thresholds: SearchThresholds, progress: Progress) -> Search:
    """The same search without the lag or delay that was chosen for a position servo, where that explains more.

    A command that is late by d and a rotor of inertia J at a stiffness K make the error e = q_d - q larger by
    d dq_d/dt + (J/K) d^2q/dt^2 to first order; a lag T of the effort makes it larger by T de/dt. A loaded servo trails
    in proportion to its speed, so de/dt is nearly a multiple of d^2q/dt^2, and viscous friction takes up d dq/dt. The
    lag alone can therefore fit so well that neither of the two causes enters the beam. Two causes in place of one do
    not correct its form, so the second one need not explain a tenth of what the first explains. A set with a curve in
    the form of the known load is not taken: such a curve is no cause of its own and would be withdrawn.
    """
    late = {t.effect.key for t in found.chosen.terms if t.effect.id in LATE} - problem.known
    if problem.context.drive != "position_servo" or not late:
        return found
    rest = [effect for effect in problem.effects if effect.key not in late]
    of_any_share = replace(thresholds, least_of_first=0.0)
    other = select(replace(problem, effects=rest), found.baseline, of_any_share, progress)
    if any(looks_like_known_load(other.chosen, t, problem.columns) for t in other.chosen.terms):
        return found
    better = compare(problem, found.chosen, other.chosen)
    return other if better.is_real(problem.floor, np.zeros(1), of_any_share) else found
