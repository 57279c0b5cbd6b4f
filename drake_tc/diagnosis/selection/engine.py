"""Which effects are missing: a beam search over sets of effects by cross-validated error, on training runs alone.

The engine knows nothing of joints or rigid bodies. A `Problem` proposes one-effect-larger models, refines them and says
how well they do; `selection.joint` and `selection.shared` are the two kinds.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Generic, Protocol, TypeVar

import numpy as np

from drake_tc.diagnosis.selection.comparison import Comparison, compared, explained_by
from drake_tc.diagnosis.selection.withdrawal import DidNotHold
from drake_tc.diagnosis.thresholds import SearchThresholds
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]
MOST_IMPOSSIBLE = 18
"""Models with impossible values that are refined at most in one round."""
F = TypeVar("F")
"""A fitted model."""


@dataclass(frozen=True)
class Proposal(Generic[F]):
    """A model with one effect more.

    Attributes:
        key: Proposals of one key are the same model; the first one counts.
        error: Its cross-validated error before its shapes are refined, or an estimate that orders proposals alike.
        refined: Fits it with its shapes refined.
        begin: Starts the refinement beside the caller, where there is who computes it; `refined` then waits for it.
    """

    key: Hashable
    error: float
    refined: Callable[[], F]
    begin: Callable[[], None] = lambda: None


class Problem(Protocol[F]):
    """What a regression tells the engine."""

    @property
    def floor(self) -> FloatArray:
        """(n,) noise floors of the joints [effort]."""

    def proposals(self, parent: F, known: set[Hashable]) -> Iterable[Proposal[F]]:
        """Every model with one effect more than the parent, but those whose key is known."""

    def errors(self, fit: F) -> FloatArray:
        """(n,) cross-validated RMS by joint [effort]."""

    def error(self, fit: F) -> float:
        """One figure by which models are ordered."""

    def effective(self, small: F, large: F) -> FloatArray:
        """(n,) independent samples by which the larger model is compared with the smaller one."""

    def size(self, fit: F) -> int:
        """Number of parameters."""

    def order(self, fit: F) -> tuple[int, ...]:
        """Of models as good as each other the one that comes first is taken."""

    def share(self, small: F, large: F) -> float:
        """Share of block resamples in which the larger model is better."""

    def is_possible(self, fit: F) -> bool:
        """Whether the values of all effects of a model can be believed, whatever they explain."""

    def objections(self, fit: F) -> Sequence[DidNotHold]:
        """What is said of the effects that cannot be believed."""

    def without_each(self, large: F, small: F) -> Iterator[F]:
        """The larger model without one of the effects that it has beyond the smaller one, each in turn."""

    def contains(self, large: F, small: F) -> bool:
        """Whether the models differ in one effect, and that of the smaller one is a special case of the other's."""

    def adopted(self, fit: F) -> F:
        """The model as later rounds build on it."""


@dataclass(frozen=True, eq=False)
class Selection(Generic[F]):
    """What a search found.

    Attributes:
        baseline, chosen: Models without and with the missing effects.
        steps: What each addition brought, in order.
        as_good: By step, the other models that were real and as good as the one taken.
        alternatives: Other models of the chosen size, best first.
        passed_over: Effects that would have been added but for values that cannot be believed.
    """

    baseline: F
    chosen: F
    steps: tuple[Comparison, ...] = ()
    as_good: tuple[tuple[F, ...], ...] = ()
    alternatives: tuple[F, ...] = ()
    passed_over: tuple[DidNotHold, ...] = field(default=())


def compare(problem: Problem[F], small: F, large: F) -> Comparison:
    """What the larger model has over the smaller one."""
    errors = problem.errors(small), problem.errors(large)
    if not np.isfinite(errors[1]).all():
        return compared(*errors, np.ones(errors[0].size), 0, 0.0)
    extra = problem.size(large) - problem.size(small)
    return compared(*errors, problem.effective(small, large), extra, problem.share(small, large))


def _best_first(problem: Problem[F], fits: Sequence[F], among: Sequence[int], same: float) -> list[int]:
    """Indices of the models as good as the best one: that which comes first, then the others."""
    least = min(problem.error(fits[i]) for i in among)
    good = [i for i in among if problem.error(fits[i]) <= (1.0 + same) * least]
    return sorted(good, key=lambda i: problem.order(fits[i]))


def select(
    problem: Problem[F], baseline: F, thresholds: SearchThresholds, progress: Progress = lambda text, share: None
) -> Selection[F]:
    """Add effects as long as one more is a real improvement.

    In each round every model of the beam is grown by each effect; the best proposals are refined. The simplest of the
    best real ones is taken. Where none is real but one is promising, the next round looks for pairs.

    Args:
        problem: The regression.
        baseline: Without effects.
        thresholds: What counts as real, and how far to look.
        progress: Told how far it is.
    """
    beam, chosen = [baseline], baseline
    steps: list[Comparison] = []
    as_good: list[tuple[F, ...]] = []
    alternatives: tuple[F, ...] = ()
    passed_over: dict[str, DidNotHold] = {}
    waited = False  # for a second effect, because the first alone was promising and not real
    for size in range(1, thresholds.most + 1):
        proposals = _proposed(problem, beam, lambda share, size=size: progress(f"sets of {size}", share))  # type: ignore[misc]
        if not proposals:
            break
        if size > 1 and proposals[0].error > (1.0 - thresholds.worth_refining) * problem.error(chosen):
            break
        found = _evaluated(problem, _refined(problem, proposals, thresholds), baseline, chosen, thresholds)
        passed_over |= found.passed_over
        real = found.real
        if waited:
            real = [i for i in real if _each_needed(problem, found.fits[i], chosen, thresholds)]
        if not real:
            if waited or found.largest_gain < thresholds.promising_gain:
                break
            waited, beam = True, [found.fits[i] for i in found.by_error[: thresholds.beam]]
            continue
        waited = False
        best, *others = _best_first(problem, found.fits, real, thresholds.same)
        steps.append(found.comparisons[best])
        as_good.append(tuple(found.fits[i] for i in others))
        alternatives = tuple(found.fits[i] for i in found.by_error if i != best)
        chosen = problem.adopted(found.fits[best])
        beam = [chosen, *alternatives][: thresholds.beam]
    return Selection(baseline, chosen, tuple(steps), tuple(as_good), alternatives, tuple(passed_over.values()))


@dataclass(frozen=True, eq=False)
class _Round(Generic[F]):
    """Refined models of one size against the one chosen so far.

    Attributes:
        fits, comparisons: Each with what it has over the chosen one.
        by_error: Indices of those that are possible, best first. real: of those that are real improvements too.
        passed_over: Effects that would have won but for impossible values.
    """

    fits: Sequence[F]
    comparisons: Sequence[Comparison]
    by_error: Sequence[int]
    real: Sequence[int]
    passed_over: dict[str, DidNotHold]

    @property
    def largest_gain(self) -> float:
        """Of the possible models and all joints; 0 where there is none."""
        return max((float(self.comparisons[i].gain.max()) for i in self.by_error), default=0.0)


def _evaluated(
    problem: Problem[F], refined: tuple[list[F], list[int]], baseline: F, chosen: F, thresholds: SearchThresholds
) -> _Round[F]:
    """Which of the refined models are possible, and which of these are real improvements."""
    fits, possible = refined
    explained = explained_by(problem.errors(baseline), problem.errors(chosen))
    comparisons = [compare(problem, chosen, f) for f in fits]
    wins = [i for i, c in enumerate(comparisons) if c.is_real(problem.floor, explained, thresholds)]
    if thresholds.beam == 1:
        possible = [i for i in wins if problem.is_possible(fits[i])]
    taken = [i for i in wins if i in possible]
    real = [i for i in taken if _exceeds_special_cases(problem, fits[i], [fits[j] for j in taken], chosen, thresholds)]
    by_error = sorted(possible, key=lambda i: problem.error(fits[i]))
    least = problem.error(fits[by_error[0]]) if by_error else np.inf
    better = [fits[i] for i in wins if i not in possible and problem.error(fits[i]) < least]
    passed_over = {each.key: each for f in better for each in problem.objections(f)}
    return _Round(fits, comparisons, by_error, real, passed_over)


def _exceeds_special_cases(
    problem: Problem[F], large: F, real: Sequence[F], chosen: F, thresholds: SearchThresholds
) -> bool:
    """Whether a model is a real improvement over each real one that has a special case of its effect in its place."""
    over_special = replace(thresholds, least_of_first=thresholds.least_of_special)
    for small in real:
        if problem.contains(large, small):
            explained = explained_by(problem.errors(chosen), problem.errors(small))
            if not compare(problem, small, large).is_real(problem.floor, explained, over_special):
                return False
    return True


def _proposed(problem: Problem[F], beam: Sequence[F], progress: Callable[[float], None]) -> list[Proposal[F]]:
    """All proposals of a beam, each model once, by error."""
    known: set[Hashable] = set()
    out = []
    for number, parent in enumerate(beam):
        for proposal in problem.proposals(parent, known):
            known.add(proposal.key)
            out.append(proposal)
        progress((number + 1) / len(beam))
    return sorted(out, key=lambda p: p.error)


def _refined(
    problem: Problem[F], proposals: Sequence[Proposal[F]], thresholds: SearchThresholds
) -> tuple[list[F], list[int]]:
    """The best proposals, refined, and the indices of those whose values are possible.

    Impossible ones do not count: as many others are refined, near to the best possible one. A search that keeps a
    single model looks at values only where an improvement is real, and takes all for possible here. The first few are
    refined however far they are; those that stay far are left out.
    """
    fits: list[F] = []
    possible: list[int] = []
    least = np.inf

    def is_far(number: int, proposal: Proposal[F], best: float) -> bool:
        return proposal.error > thresholds.near * best and number >= thresholds.least_refined

    waiting = iter([p for number, p in enumerate(proposals) if not is_far(number, p, proposals[0].error)])
    for proposal in islice(waiting, thresholds.refined):  # those are refined whatever comes of the others
        proposal.begin()
    for number, proposal in enumerate(proposals):
        if len(possible) == thresholds.refined or is_far(number, proposal, least):
            break
        if len(fits) == MOST_IMPOSSIBLE + thresholds.refined:
            break
        fit = proposal.refined()
        if proposal.error > thresholds.near * least:
            best = min(problem.error(fits[i]) for i in possible)
            if problem.error(fit) > thresholds.near * best:
                continue
        fits.append(fit)
        if thresholds.beam == 1 or problem.is_possible(fit):
            possible.append(len(fits) - 1)
            least = min(least, proposal.error)
        elif (another := next(waiting, None)) is not None:
            another.begin()
    return fits, possible


def _each_needed(problem: Problem[F], large: F, small: F, thresholds: SearchThresholds) -> bool:
    """Whether a model loses a real improvement with any one of the effects that it has beyond the smaller one."""
    none = np.zeros(problem.floor.size)
    return all(
        compare(problem, without, large).is_real(problem.floor, none, thresholds)
        for without in problem.without_each(large, small)
    )
