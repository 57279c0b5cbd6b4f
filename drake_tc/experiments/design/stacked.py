"""Rows of several experiments with one model, as a diagnosis fits several logs together."""

from collections.abc import Hashable, Sequence

import numpy as np

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.experiments.design.joint import BalanceColumns
from drake_tc.types import FloatArray


def _key(terms: Sequence[Term]) -> Hashable:
    return tuple((t.effect.key, tuple(sorted(t.shape.items()))) for t in terms)


class RememberedColumns:
    """Columns that are computed once: parts of an experiment that stay while another part is changed."""

    def __init__(self, columns: BalanceColumns) -> None:
        """Of a motion."""
        self.joint, self.weight, self.seconds = columns.joint, columns.weight, columns.seconds
        self._columns = columns
        self._known: dict[Hashable, FloatArray] = {}

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (T,)."""
        key = ("effort", _key(terms))
        if key not in self._known:
            self._known[key] = self._columns.effort(terms)
        return self._known[key]

    def changes(self, terms: Sequence[Term]) -> FloatArray:
        """(T, g)."""
        key = ("changes", _key(terms))
        if key not in self._known:
            self._known[key] = self._columns.changes(terms)
        return self._known[key]

    def of(self, term: Term) -> FloatArray:
        """Phi (T, k)."""
        key = ("of", _key([term]))
        if key not in self._known:
            self._known[key] = self._columns.of(term)
        return self._known[key]

    def of_each(self, terms: Sequence[Term]) -> list[FloatArray]:
        """Phi (T, k) of each; those that are not known yet are computed together."""
        keys: list[Hashable] = [("of", _key([term])) for term in terms]
        missing = {key: term for key, term in zip(keys, terms, strict=True) if key not in self._known}
        if missing:
            self._known |= zip(missing, self._columns.of_each(list(missing.values())), strict=True)
        return [self._known[key] for key in keys]

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (T, 1 + sum k)."""
        blocks = [self.effort(terms)[:, None]] + [-self.of(t) for t in terms if t.effect.coefficients]
        return np.concatenate(blocks, axis=1)


class StackedColumns:
    """Rows of several parts, each with its share of the time of the whole experiment."""

    def __init__(self, parts: Sequence[BalanceColumns], shares: Sequence[float]) -> None:
        """Parts with the same noise and filters; shares of the time, which add up to 1."""
        self.parts, self.shares = tuple(parts), tuple(shares)
        self.joint = parts[0].joint
        rows = sum(part.weight.size for part in parts)
        self.weight = np.concatenate(
            [part.weight * (share * rows / part.weight.size) for part, share in zip(parts, shares, strict=True)]
        )
        self.seconds = sum(part.seconds for part in parts)

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (T,) after the drive effects among the terms."""
        return np.concatenate([part.effort(terms) for part in self.parts])

    def changes(self, terms: Sequence[Term]) -> FloatArray:
        """(T, g) change of y* by each of several drive effects alone."""
        return np.concatenate([part.changes(terms) for part in self.parts])

    def of(self, term: Term) -> FloatArray:
        """Phi (T, k) of one term."""
        return np.concatenate([part.of(term) for part in self.parts])

    def of_each(self, terms: Sequence[Term]) -> list[FloatArray]:
        """Phi (T, k) of each."""
        each = zip(*(part.of_each(terms) for part in self.parts), strict=True)
        return [np.concatenate(blocks) for blocks in each]

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (T, 1 + sum k)."""
        return np.concatenate([part.design(terms) for part in self.parts])
