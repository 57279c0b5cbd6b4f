"""Which effects a robot's joints lack, on which shaft: the arm's regression as a problem of the search engine."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from drake_tc.diagnosis.problem.arm.fit import ArmFit, ShaftEffect, grown, without
from drake_tc.diagnosis.problem.arm.one_more import OneMore
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.selection.comparison import better_share
from drake_tc.diagnosis.selection.engine import Progress, Proposal, Selection, select
from drake_tc.diagnosis.selection.shapes import PERIOD, ShapeScreen, refine_values
from drake_tc.diagnosis.selection.withdrawal import DidNotHold
from drake_tc.diagnosis.thresholds import ARM, SearchThresholds
from drake_tc.effects.base import Effect, Signals
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray

SCREENED = 12
"""Shapes of a long grid that are tried with the filters; the others only on unfiltered columns."""
MOST_PERIODS = 6
"""Periodic effects of one kind on one shaft."""
EVALUATIONS = 25
"""Of each shape parameter's refinement."""


@dataclass(frozen=True, eq=False)
class ArmProblem:
    """An arm's training rows and the effects looked for on every shaft.

    The same effect may be on several shafts, and a periodic one on a shaft with several periods.
    """

    baseline: ArmFit
    effects: Sequence[Effect]
    _cache: dict[object, FloatArray] = field(default_factory=dict)
    _screens: dict[int, ShapeScreen] = field(default_factory=dict)

    @property
    def floor(self) -> FloatArray:
        """(n,) not known: 0 [N m]."""
        return np.zeros(self.baseline.sigma.size)

    def proposals(self, parent: ArmFit, known: set[Hashable]) -> Iterator[Proposal[ArmFit]]:
        """Every effect on every shaft, at the best point of its shape grid."""
        more = OneMore(parent)
        rows = self.baseline.rows
        for axis in range(len(rows.axes)):
            context, signals = rows.context(axis), rows.signals[axis].take(rows.rows)
            screen = self._screen(axis, signals)
            for effect in self.effects:
                if _taken(parent, axis, effect):
                    continue
                grid = screen.best(effect, more.residual_on(axis), effect.shape_grid(context), SCREENED)
                tried = [Term(effect, shape) for shape in grid]
                if tried:
                    errors = [more.error(axis, effect, self._columns(axis, term)) for term in tried]
                    place = ShaftEffect(axis, tried[int(np.argmin(errors))])
                    key = (len(parent.shaft_effects), axis, effect.key)
                    yield Proposal(key, min(errors), lambda place=place: grown(parent, _refined(more, place)))  # type: ignore[misc]

    def _screen(self, axis: int, signals: Signals) -> ShapeScreen:
        if axis not in self._screens:
            self._screens[axis] = ShapeScreen(signals)
        return self._screens[axis]

    def _columns(self, axis: int, term: Term) -> FloatArray:
        key = (axis, term.cache_key)
        if key not in self._cache:
            self._cache[key] = self.baseline.rows.of(axis, term)
        return self._cache[key]

    def errors(self, fitted: ArmFit) -> FloatArray:
        """(n,) cross-validated [N m]."""
        return fitted.cv_rms

    def error(self, fitted: ArmFit) -> float:
        """RMS of all joints, each in units of its sigma."""
        return float(np.sqrt(np.mean((fitted.held / fitted.sigma) ** 2)))

    def effective(self, fitted: ArmFit) -> FloatArray:
        """(n,) independent rows by joint."""
        lengths = [int(n) for n in np.bincount(fitted.rows.run) if n]
        return np.array([max(r.size / correlation_time(r - r.mean(), lengths), 3.0) for r in fitted.held.T])

    def size(self, fitted: ArmFit) -> int:
        """Number of parameters of the effects, shapes included."""
        return sum(p.term.size for p in fitted.shaft_effects)

    def order(self, fitted: ArmFit) -> tuple[int, ...]:
        """By size."""
        return (self.size(fitted),)

    def share(self, small: ArmFit, large: ArmFit) -> float:
        """Share of block resamples in which it helps the joints that the new effect's shaft loads."""
        turns = np.abs(np.array(large.rows.axes[large.shaft_effects[-1].axis].turns))
        return better_share(small.block_sse(turns) - large.block_sse(turns))

    def is_possible(self, fitted: ArmFit) -> bool:
        """Not looked at: coefficients have bounds, and no drive gain is fitted that could make them impossible."""
        return True

    def objections(self, fitted: ArmFit) -> Sequence[DidNotHold]:
        """None."""
        return ()

    def without_each(self, large: ArmFit, small: ArmFit) -> Iterator[ArmFit]:
        """The larger fit without one of its new effects."""
        for place in large.shaft_effects[len(small.shaft_effects) :]:
            yield without(large, place)

    def adopted(self, fitted: ArmFit) -> ArmFit:
        """The fit itself."""
        return fitted


def search_arm(
    baseline: ArmFit,
    effects: Sequence[Effect],
    thresholds: SearchThresholds = ARM,
    progress: Progress = lambda text, share: None,
) -> Selection[ArmFit]:
    """Add the effect that explains most, shaft by shaft and shape by shape, until none is a real improvement.

    Args:
        baseline: Of the declared columns, on the training rows.
        effects: Candidates.
        thresholds: What counts as real.
        progress: Told how far it is.
    """
    return select(ArmProblem(baseline, effects), baseline, thresholds, progress)


def _taken(fit: ArmFit, axis: int, effect: Effect) -> bool:
    same = [p for p in fit.shaft_effects if p.axis == axis and p.term.effect.id == effect.id]
    periodic = any(p.name == PERIOD for p in effect.shapes)
    return len(same) >= (MOST_PERIODS if periodic else 1)


def _refined(more: OneMore, place: ShaftEffect) -> ShaftEffect:
    """The shape that explains most, from where the grid left it."""
    effect, shapes = place.term.effect, place.term.effect.shapes
    if not shapes:
        return place
    best, least = place.term, np.inf

    def cost(values: FloatArray) -> float:
        nonlocal best, least
        term = Term(effect, {p.name: float(v) for p, v in zip(shapes, values, strict=True)})
        error = more.error(place.axis, effect, more.fit.rows.of(place.axis, term))
        if error < least:
            best, least = term, error
        return float(np.log(error))

    refine_values(shapes, np.array([place.term.shape[p.name] for p in shapes]), cost, EVALUATIONS)
    return ShaftEffect(place.axis, best)
