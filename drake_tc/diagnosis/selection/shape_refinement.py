"""Refinement of the shapes of all terms of a fit together, here or in a worker process."""

from collections.abc import Hashable, MutableMapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit, score
from drake_tc.diagnosis.selection.shapes import refine_values
from drake_tc.effects.base import Shape
from drake_tc.types import FloatArray

EVALUATIONS = 60
"""Most evaluations of the error in a refinement, for each shape parameter."""
Known = MutableMapping[Hashable, list[Shape] | None]
"""By `term_keys` of the start: the refined shapes, None where the start has the best ones."""


def refine(columns: Columns, start: Fit, evaluations: int = EVALUATIONS) -> Fit:
    """Refine all shape parameters of a fit together."""
    return _with_shapes(columns, start, refined_shapes(columns, start.terms, start.cv_rms, evaluations))


def refined_shapes(columns: Columns, terms: Sequence[Term], least: float, evaluations: int) -> list[Shape] | None:
    """The shapes of all terms, refined together; None where no other shapes have a smaller error than `least`."""
    free = [(i, p) for i, t in enumerate(terms) for p in t.effect.shapes]
    if not free:
        return None
    best: list[Shape] | None = None

    def cost(values: FloatArray) -> float:
        nonlocal best, least
        shapes = [dict(t.shape) for t in terms]
        for (i, p), value in zip(free, values, strict=True):
            shapes[i][p.name] = float(value)
        error = score(columns, [Term(t.effect, s) for t, s in zip(terms, shapes, strict=True)]).cv_rms
        if error < least:
            best, least = [*shapes], error
        return float(np.log(error))

    values = np.array([terms[i].shape[p.name] for i, p in free])
    refine_values([p for _, p in free], values, cost, evaluations)
    return best


def _with_shapes(columns: Columns, start: Fit, shapes: Sequence[Shape] | None) -> Fit:
    if shapes is None:
        return start
    return fit(columns, [Term(t.effect, shape) for t, shape in zip(start.terms, shapes, strict=True)])


def term_keys(terms: Sequence[Term]) -> tuple[Hashable, ...]:
    """Same keys, same fit."""
    return tuple(t.cache_key for t in terms)


@dataclass(eq=False)
class Refinement:
    """A fit whose shapes are refined when it is called, or in a worker from when it began.

    Attributes:
        columns: Training rows. start: fit to them.
        known: What was refined before on the same rows, and gets what is refined now.
        executor: Of the worker; None refines here.
    """

    columns: Columns
    start: Fit
    known: Known
    executor: Executor | None
    _begun: Future[list[Shape] | None] | None = field(default=None, init=False)

    def begin(self) -> None:
        """Let a worker refine the shapes, where there are workers and shapes, and nobody has done it before."""
        if self.executor is None or term_keys(self.start.terms) in self.known:
            return
        if any(t.effect.shapes for t in self.start.terms):
            arguments = (self.columns, self.start.terms, self.start.cv_rms, EVALUATIONS)
            self._begun = self.executor.submit(refined_shapes, *arguments)

    def __call__(self) -> Fit:
        """The refined fit."""
        key, start = term_keys(self.start.terms), self.start
        if key not in self.known and self._begun is not None:
            self.known[key] = self._begun.result()
        if key not in self.known:
            self.known[key] = refined_shapes(self.columns, start.terms, start.cv_rms, EVALUATIONS)
        return _with_shapes(self.columns, start, self.known[key])
