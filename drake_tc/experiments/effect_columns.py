"""What effects do to the effort in a joint's rows: columns at the shapes and in the directions that they may have.

An effect whose size is a coefficient has columns, and the change of the effort with each of its shapes. One whose size
is a shape (a delay, a dead zone) changes the effort by itself, and is computed at each size of a grid.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from drake_tc.diagnosis.evidence import shape_slopes
from drake_tc.diagnosis.model import Block
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Effect
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.experiments.fitted import FittedJoint
from drake_tc.experiments.sizes import Size, strengths
from drake_tc.types import FloatArray, IntArray

MOST_SHAPES = 14
"""Shapes of an effect that are looked at; a longer grid is thinned evenly."""
THINNED = 3
"""One in so many of the sizes that are shapes is looked at where shapes are given: the effort is smooth in them."""
Shapes: TypeAlias = Mapping[str, Sequence[Mapping[str, float]]]
"""By effect key, values of its shape parameters."""


@dataclass(frozen=True, eq=False)
class Variant:
    """One effect at one shape and in one direction of its coefficients, or at every value of a shape that is its size.

    Attributes:
        term: The effect with its shape.
        prior: Of its coefficients, in units of the effort; of none for an effect without.
        places: (k,) of their columns among all columns.
        unit: (k,) coefficients of size 1 in one of the directions that they may have; none where the size is a shape.
        slopes: (j,) places of the change with each shape, at size 1 or, where the size is a shape, at each size.
        widths: (j,) deviations of the shapes' priors.
        sizes: (g,) sizes that are shapes, weakest first. changes: (g,) places of what they do to the effort.
    """

    term: Term
    prior: Block
    places: IntArray
    unit: FloatArray
    slopes: IntArray
    widths: FloatArray
    sizes: FloatArray
    changes: IntArray

    @property
    def by_shape(self) -> bool:
        """Whether the size is a shape."""
        return self.sizes.size > 0

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return self.places.size + (1 if self.by_shape else self.slopes.size)

    def nearest(self, size: float) -> int:
        """Number of the nearest one of the sizes that are shapes."""
        return int(np.argmin(np.abs(np.log(self.sizes / size))))

    def at(self, size: float) -> tuple[IntArray, FloatArray]:
        """(places (m,), weights (m,)) whose sum is what the effect does at a size."""
        if not self.by_shape:
            return self.places, size * self.unit
        weights, near = np.zeros(self.sizes.size), self.nearest(size)
        falling = self.sizes[0] > self.sizes[-1]
        weights[near] = 1.0 if falling else size / self.sizes[near]
        return self.changes, weights


class EffectColumns:
    """Collects the columns of all variants, in units of the effort."""

    def __init__(self, fitted: FittedJoint, shapes: Shapes) -> None:
        """In the rows of a joint; at given shapes, or at those of a search."""
        self._fitted, self._model, self._shapes = fitted, fitted.evidence.model, shapes
        self._parts: list[FloatArray] = []
        self._size = 0

    def all(self) -> FloatArray:
        """(N, P) all of them."""
        return np.concatenate(self._parts, axis=1)

    def _added(self, values: FloatArray) -> IntArray:
        """Places (k,) of columns (N, k)."""
        self._parts.append(values)
        self._size += values.shape[1]
        return np.arange(self._size - values.shape[1], self._size)

    def variants(self, effect: Effect, size: Size) -> list[Variant]:
        """The effect at the shapes that a search would try."""
        if size.in_shape:
            return [self._by_shape(effect, size)]
        grid = self._shapes.get(effect.key) or effect.shape_grid(self._fitted.context)
        shapes = grid[:: max(1, -(-len(grid) // MOST_SHAPES))]
        return [variant for shape in shapes for variant in self._linear(effect, shape)]

    def _linear(self, effect: Effect, shape: Mapping[str, float]) -> list[Variant]:
        term, model, gain = Term(effect, shape), self._model, self._fitted.gain
        blocks = model.blocks(model.train, [term])
        block = blocks[0] if isinstance(effect, ServoGain) else blocks[1]
        ways = [np.ones(1)] if isinstance(effect, ServoGain) else effect.unit_coefficients(self._fitted.numbers)
        places = self._added(block.values)
        widths = model.shape_prior([term]).deviation
        none: FloatArray = np.zeros(0)
        out = []
        for way in ways:
            slopes = shape_slopes(model.train, [term], np.concatenate([[gain], gain * way]))
            own = self._added(slopes)
            out.append(Variant(term, block, places, gain * way, own, widths, none, np.zeros(0, dtype=np.int64)))
        return out

    def _by_shape(self, effect: Effect, size: Size) -> Variant:
        split, model = self._model.train, self._model
        values = strengths(effect, size, self._fitted.context)
        if effect.key in self._shapes:
            values = values[:: min(THINNED, max(values.size - 1, 1))]
        grid = effect.shape_grid(self._fitted.context)
        terms = [Term(effect, {**grid[len(grid) // 2], size.name: float(value)}) for value in values]
        none = split.target([])
        changes = np.stack([none - split.target([term]) for term in terms], axis=1)
        block = Block(np.zeros((len(changes), 0)), model.blocks(split, [])[0].prior.part(slice(0, 0)))
        unit: FloatArray = np.zeros(0)
        if effect.coefficients:
            block = model.blocks(split, [terms[0]])[1]
            changes = changes + 0.5 * model.gain * self._fitted.numbers.viscous * block.values[:, :1]
        at = [p.name for p in effect.shapes].index(size.name)
        slopes = np.gradient(changes, values, axis=1) if values.size > 1 else changes / values
        return Variant(
            terms[0],
            block,
            self._added(block.values),
            unit,
            self._added(slopes),
            model.shape_prior(terms[:1]).deviation[[at]],
            values,
            self._added(changes),
        )
