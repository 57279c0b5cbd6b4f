"""One joint's regression as a problem of the search engine."""

from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit, score
from drake_tc.diagnosis.problem.sensor_errors import expected_errors
from drake_tc.diagnosis.selection.comparison import better_share, effective_samples, effective_samples_for
from drake_tc.diagnosis.selection.engine import Proposal, Selection
from drake_tc.diagnosis.selection.lag_or_noise import is_noise
from drake_tc.diagnosis.selection.plausible_values import objection_to_values
from drake_tc.diagnosis.selection.rotor_inertia import replaces_inertia
from drake_tc.diagnosis.selection.shape_refinement import Known, Refinement, refine, term_keys
from drake_tc.diagnosis.selection.shapes import ShapeScreen
from drake_tc.diagnosis.selection.withdrawal import DidNotHold, NoiseOfEffort
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
                best = self.at_best_shape(parent, effect)
                refinement = Refinement(self.columns, best, self.refined, self.executor)
                yield Proposal(key, best.cv_rms, refinement, refinement.begin)

    def at_best_shape(self, parent: Fit, effect: Effect) -> Fit:
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
