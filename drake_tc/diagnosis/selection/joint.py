"""Which effects one joint lacks: its regression as a problem of the search engine."""

from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.drive_gain import at_reverse_regression
from drake_tc.diagnosis.problem.regression import Fit, fit, score
from drake_tc.diagnosis.problem.sensor_errors import expected_errors
from drake_tc.diagnosis.selection.comparison import better_share, effective_samples, effective_samples_for
from drake_tc.diagnosis.selection.engine import Progress, Proposal, Selection, compare, select
from drake_tc.diagnosis.selection.known_load import looks_like_known_load
from drake_tc.diagnosis.selection.lag_or_noise import LATE, is_noise
from drake_tc.diagnosis.selection.plausible_values import objection_to_values
from drake_tc.diagnosis.selection.rotor_inertia import leaves_noise_of_its_inertia, replaces_inertia
from drake_tc.diagnosis.selection.shape_refinement import Known, Refinement, refine, term_keys
from drake_tc.diagnosis.selection.shapes import ShapeScreen
from drake_tc.diagnosis.selection.withdrawal import DidNotHold, NoiseOfEffort
from drake_tc.diagnosis.thresholds import SearchThresholds
from drake_tc.effects.base import Context, DriveEffect, Effect
from drake_tc.effects.library import place
from drake_tc.effects.obstacle import Obstacle
from drake_tc.types import FloatArray

Search = Selection[Fit]
SCREENED = 4
"""Shapes of a long grid that are tried with the filters."""


def candidates(
    library: Sequence[Effect], context: Context, declared: Sequence[str]
) -> tuple[list[Effect], list[tuple[str, Obstacle]]]:
    """Effects that can be looked for, and of the others the key and what stands in the way."""
    usable, obstacles = [], []
    for effect in library:
        if effect.id in declared:
            continue
        obstacle = effect.unavailable(context)
        if obstacle is None:
            usable.append(effect)
        else:
            obstacles.append((effect.key, obstacle))
    return usable, obstacles


def shape_screen(columns: Columns) -> ShapeScreen:
    """A screen of long shape grids over the rows of these columns."""
    return ShapeScreen(columns.samples.signals.take(columns.samples.rows))


def best_shape(
    columns: Columns, parent: Fit, effect: Effect, context: Context, screen: ShapeScreen | None = None
) -> Fit:
    """The best fit of a parent's terms plus one effect over its shape grid.

    Args:
        columns: Training rows.
        parent: Fit to them; its residual shortens long grids.
        effect: Which is added.
        context: What the logs offer.
        screen: Over these columns, from `shape_screen`; None makes one.
    """
    shapes = effect.shape_grid(context)
    if not isinstance(effect, DriveEffect):
        shapes = (screen or shape_screen(columns)).best(effect, parent.residual, shapes, SCREENED)
    tried = [score(columns, [*parent.terms, Term(effect, shape)]) for shape in shapes]
    return fit(columns, min(tried, key=lambda s: s.cv_rms).terms)


def share_better(small: Fit, large: Fit, seed: int = 0) -> float:
    """Share of block resamples in which `large` has the smaller squared error."""
    return better_share(small.block_sse - large.block_sse, seed)


@dataclass(frozen=True, eq=False)
class JointProblem:
    """One joint's training rows, and what can be looked for on them.

    Attributes:
        columns: Training rows. effects: candidates. context: what the logs offer.
        known: Keys of the declared effects, whose values are not questioned. noise: noise floor [effort].
        executor: Refines proposals beside each other; None refines them here.
        best, refined: What was found so far: terms of the best shape of an effect beside a parent's, and refined
            shapes. Searches of the same rows with other effects (`replace`) share them.
    """

    columns: Columns
    effects: Sequence[Effect]
    context: Context
    known: frozenset[str]
    noise: float
    executor: Executor | None = None
    best: dict[Hashable, tuple[Term, ...]] = field(default_factory=dict)
    refined: Known = field(default_factory=dict)

    @cached_property
    def screen(self) -> ShapeScreen:
        """Shortens long shape grids."""
        return shape_screen(self.columns)

    @property
    def floor(self) -> FloatArray:
        """(1,) noise floor [effort]."""
        return np.array([self.noise])

    def proposals(self, parent: Fit, known: set[Hashable]) -> Iterator[Proposal[Fit]]:
        """Each candidate at the best point of its shape grid."""
        present = {t.effect.id for t in parent.terms}
        barred = present.union(*(t.effect.excludes for t in parent.terms))
        for effect in self.effects:
            key = frozenset({t.effect.key for t in parent.terms} | {effect.key})
            if effect.id not in barred and not effect.excludes & present and key not in known:
                best = self._best(parent, effect)
                refinement = Refinement(self.columns, best, self.refined, self.executor)
                yield Proposal(key, best.cv_rms, refinement, refinement.begin)

    def _best(self, parent: Fit, effect: Effect) -> Fit:
        """A parent's terms and an effect at the best point of its shape grid."""
        key = (*term_keys(parent.terms), effect.key)
        if key in self.best:
            return fit(self.columns, self.best[key])
        found = best_shape(self.columns, parent, effect, self.context, self.screen)
        self.best[key] = tuple(found.terms)
        return found

    def errors(self, fitted: Fit) -> FloatArray:
        """(1,) cross-validated RMS [effort]."""
        return np.array([fitted.cv_rms])

    def error(self, fitted: Fit) -> float:
        """The same as a number."""
        return fitted.cv_rms

    def effective(self, small: Fit, large: Fit) -> FloatArray:
        """(1,) independent samples in the residual; where the links are fitted, those that tell what is added.

        What the residual of fitted links has beside noise is slow: links and effects not yet found. It hides a constant
        or a spring, but no ripple.
        """
        samples = self.columns.samples
        if samples.link_prior is None:
            return np.array([effective_samples(large.residual, samples)])
        return np.array([effective_samples_for(small.residual - large.residual, large.residual, samples)])

    def size(self, fitted: Fit) -> int:
        """Number of parameters, shapes included."""
        return fitted.size

    def order(self, fitted: Fit) -> tuple[int, ...]:
        """By size, then as the effects stand in the library."""
        return fitted.size, sum(place(t.effect.key) for t in fitted.terms)

    def share(self, small: Fit, large: Fit) -> float:
        """Share of block resamples in which the larger fit is better."""
        return share_better(small, large)

    def is_possible(self, fitted: Fit) -> bool:
        """Whether the added effects have values that can be believed, and that no sensor's tolerance explains."""
        return not self.objections(fitted) and not expected_errors(self.columns, fitted, self.known, self.context)

    def objections(self, fitted: Fit) -> list[DidNotHold]:
        """What is said of those that cannot."""
        out = []
        for term in fitted.terms:
            effect = term.effect
            if effect.key not in self.known:
                found = objection_to_values(fitted, term, self.context, self.columns)
                if found is None and is_noise(self.columns, fitted, term):
                    found = NoiseOfEffort()
                if found is None:
                    found = replaces_inertia(self.columns, fitted, term, self.known, self.noise)
                if found is not None:
                    out.append(DidNotHold(effect.key, effect.id, effect.title, found))
        return out

    def without_each(self, large: Fit, small: Fit) -> Iterator[Fit]:
        """The larger fit without one of its new effects, shapes refined anew."""
        known = {t.effect.key for t in small.terms}
        for term in large.terms:
            if term.effect.key not in known:
                rest = fit(self.columns, [t for t in large.terms if t is not term])
                yield refine(self.columns, rest, evaluations=20)

    def contains(self, large: Fit, small: Fit) -> bool:
        """Whether the fits differ in one effect, and that of the smaller one is a special case of the other's."""
        general = [t.effect for t in large.terms if t.effect.key not in {s.effect.key for s in small.terms}]
        special = [t.effect for t in small.terms if t.effect.key not in {s.effect.key for s in large.terms}]
        return len(general) == len(special) == 1 and general[0].special_case == special[0].id

    def adopted(self, fitted: Fit) -> Fit:
        """The fit itself."""
        return fitted


def search(
    columns: Columns,
    declared: Sequence[Term],
    effects: Sequence[Effect],
    context: Context,
    floor: float,
    thresholds: SearchThresholds,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
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
    """
    known = frozenset(t.effect.key for t in declared)
    problem = JointProblem(columns, effects, context, known, floor, executor)
    baseline = at_reverse_regression(columns, refine(columns, fit(columns, declared)))
    found = select(problem, baseline, thresholds, progress)
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
    taken before a curve where it leaves next to nothing but the noise that it brings.
    """
    added = [t for t in found.chosen.terms if t.effect.key not in problem.known]
    imitates = any(looks_like_known_load(found.chosen, t, problem.columns) for t in added)
    if not (imitates or any(t.effect.free_form for t in added)):
        return found
    tried = [] if imitates else [found]
    for kind in ("free_form", "depends_on_position"):
        rest = [effect for effect in problem.effects if not getattr(effect, kind)]
        tried.append(select(replace(problem, effects=rest), found.baseline, thresholds, progress))
    most = (1.0 + thresholds.same) * found.chosen.cv_rms
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
