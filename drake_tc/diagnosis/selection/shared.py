"""Which causes that no single joint owns are missing: all joints' balances as a problem of the search engine.

Errors of sensors that have a tolerance are in every fit, with that prior (`problem.shared.stacked`). A candidate among
them loses its prior, and counts only if its estimate lies beyond what tolerance and noise together explain.
"""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.shared.causes import TITLES, Cause
from drake_tc.diagnosis.problem.shared.covariance import covariance
from drake_tc.diagnosis.problem.shared.robot_causes import FARTHEST
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import StackedFit, effective_rows, fit_stacked
from drake_tc.diagnosis.selection.engine import Proposal, Selection, select
from drake_tc.diagnosis.selection.withdrawal import DidNotHold
from drake_tc.diagnosis.thresholds import BEYOND_TOLERANCE, SHARED, SearchThresholds
from drake_tc.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class CauseFit:
    """All joints with some causes: in the order found, and their fit."""

    causes: tuple[Cause, ...]
    fit: StackedFit


@dataclass(frozen=True, eq=False)
class SharedSearch:
    """What was found.

    Attributes:
        chosen: Causes, in the order found. fit: with all of them. baseline: with none.
        alternatives: By chosen cause, others that do as well in its place.
    """

    chosen: tuple[Cause, ...]
    fit: StackedFit
    baseline: StackedFit
    alternatives: tuple[tuple[Cause, ...], ...]


def active(causes: Sequence[Cause], chosen: Sequence[Cause]) -> tuple[IntArray, FloatArray]:
    """Columns (p,) of the chosen causes and of all that have a tolerance, and the prior of each (p,): see `StackedFit`.

    The chosen causes come first, without the prior of their tolerance. A tolerance of 0 leaves its parameter out.
    """
    columns = [k for c in chosen for k in range(c.columns.start, c.columns.stop)]
    tolerance = [size for c in chosen for size in c.prior or [np.inf] * c.size]
    for cause in causes:
        for place, size in enumerate(cause.tolerance if cause not in chosen else ()):
            if size > 0.0:
                columns.append(cause.columns.start + place)
                tolerance.append(size)
    return np.array(columns, dtype=np.int64), np.array(tolerance, dtype=np.float64)


def substituted(chosen: Sequence[Cause], alternatives: Sequence[Sequence[Cause]]) -> list[tuple[Cause, ...]]:
    """Sets of causes that do as well as the chosen ones: each with one alternative in the place of one of them.

    Args:
        chosen: Causes.
        alternatives: By chosen cause, those that do as well in its place.
    """
    return [
        (*chosen[:number], other, *chosen[number + 1 :])
        for number, others in enumerate(alternatives)
        for other in others
        if other not in chosen
    ]


@dataclass(frozen=True, eq=False)
class SharedProblem:
    """The training rows of all joints, and the causes looked for.

    Attributes:
        rows: Of all joints. causes: all of them. candidates: those looked for. floor: (n,) noise floors [effort].
    """

    rows: Sequence[JointRows]
    causes: Sequence[Cause]
    candidates: Sequence[Cause]
    floor: FloatArray

    def with_causes(self, chosen: Sequence[Cause], effective: FloatArray | None = None) -> CauseFit:
        """Fit these causes; with `effective` (n,) the rows weigh as given."""
        return CauseFit(tuple(chosen), fit_stacked(self.rows, *active(self.causes, chosen), effective=effective))

    def proposals(self, parent: CauseFit, known: set[Hashable]) -> Iterator[Proposal[CauseFit]]:
        """One more cause each, the rows weighed as in the parent."""
        for cause in self.candidates:
            if cause not in parent.causes:
                tried = self.with_causes([*parent.causes, cause], parent.fit.effective)
                yield Proposal(cause.key, self.error(tried), lambda tried=tried: tried)  # type: ignore[misc]

    def errors(self, fitted: CauseFit) -> FloatArray:
        """(n,) cross-validated RMS by joint [effort]."""
        return fitted.fit.cv_rms

    def error(self, fitted: CauseFit) -> float:
        """Geometric mean of the errors, joints weighted by their rows."""
        weight = np.array([r.target.size for r in self.rows], dtype=np.float64)
        return float(np.exp(weight @ np.log(fitted.fit.cv_rms) / weight.sum()))

    def effective(self, small: CauseFit, large: CauseFit) -> FloatArray:
        """(n,) independent rows by joint."""
        return effective_rows(self.rows, large.fit)

    def size(self, fitted: CauseFit) -> int:
        """Number of parameters of the causes."""
        return sum(c.size for c in fitted.causes)

    def order(self, fitted: CauseFit) -> tuple[int, ...]:
        """By size, then as the causes are listed."""
        return self.size(fitted), *(self.causes.index(c) for c in fitted.causes)

    def share(self, small: CauseFit, large: CauseFit) -> float:
        """Not counted: enough joints must support a cause instead."""
        return 1.0

    def is_possible(self, fitted: CauseFit) -> bool:
        """Whether the last cause's estimate can be true, and lies where an error within its tolerance does not.

        |delta_i| > 3 sqrt(t_i^2 + s_i^2) for one of its parameters; a cause without a tolerance always does. The rows
        weigh by what this model leaves. By what the parent leaves, the joints that show the cause would weigh least:
        the cause itself is in their residuals, which are slow and so hold few independent samples. Of a payload, mass
        and centre must make sense (`_is_a_body`); a link must not weigh less than nothing.
        """
        fitted = self.adopted(fitted)
        cause = fitted.causes[-1]
        place = np.isin(fitted.fit.columns, np.arange(cause.columns.start, cause.columns.stop))
        delta, noise = fitted.fit.delta[place], np.diag(covariance(self.rows, fitted.fit)[0])[place]
        if cause.id == "payload":
            return _is_a_body(delta, np.sqrt(noise))
        value, doubt = cause.physical(delta), BEYOND_TOLERANCE * np.sqrt(noise)
        if (value + doubt < cause.possible[0]).any() or (value - doubt > cause.possible[1]).any():
            return False
        if not cause.tolerance:
            return True
        expected = np.sqrt(np.array(cause.tolerance) ** 2 + noise)
        return bool((np.abs(delta) > BEYOND_TOLERANCE * expected).any())

    def objections(self, fitted: CauseFit) -> Sequence[DidNotHold]:
        """None: errors within their tolerance are not named."""
        return ()

    def without_each(self, large: CauseFit, small: CauseFit) -> Iterator[CauseFit]:
        """The larger fit without one of its new causes."""
        for cause in large.causes:
            if cause not in small.causes:
                yield self.with_causes([c for c in large.causes if c is not cause])

    def contains(self, large: CauseFit, small: CauseFit) -> bool:
        """Whether a payload is in the place of a wrong mass or centre of the link that carries it."""
        more, fewer = ([c for c in a.causes if c not in b.causes] for a, b in ((large, small), (small, large)))
        return len(more) == len(fewer) == 1 and fewer[0].key in more[0].special

    def adopted(self, fitted: CauseFit) -> CauseFit:
        """Fitted anew, the rows weighed by what is left."""
        return self.with_causes(fitted.causes)


def _is_a_body(delta: FloatArray, spread: FloatArray) -> bool:
    """Whether a mass that is certainly not 0 has its centre within `FARTHEST` of the link's origin.

    Args:
        delta: (10,) of a payload; negative where the model has too much.
        spread: (10,) standard deviations.
    """
    mass, moment = abs(float(delta[0])), float(np.linalg.norm(delta[1:4]))
    return mass > BEYOND_TOLERANCE * float(spread[0]) and moment <= FARTHEST * mass


def search_shared(
    rows: Sequence[JointRows],
    causes: Sequence[Cause],
    floor: FloatArray,
    thresholds: SearchThresholds = SHARED,
    among: Sequence[Cause] | None = None,
    beside: Sequence[Cause] = (),
) -> SharedSearch:
    """Look for causes on all joints together.

    Args:
        rows: Training rows of all joints.
        causes: All of them; those in `TITLES` are candidates.
        floor: (n,) noise floors [effort].
        thresholds: What counts as real.
        among: Candidates, where not all of them are.
        beside: Causes found before, which `baseline` and all others have.
    """
    candidates = [c for c in causes if c.id in TITLES] if among is None else among
    problem = SharedProblem(rows, causes, candidates, floor)
    found: Selection[CauseFit] = select(problem, problem.with_causes(beside), thresholds)
    return SharedSearch(
        found.chosen.causes,
        found.chosen.fit,
        found.baseline.fit,
        tuple(tuple(f.causes[-1] for f in fits) for fits in found.as_good),
    )
