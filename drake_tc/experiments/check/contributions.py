"""What effects would do to the torque balance of a joint at recorded motions, beyond what its declared model explains.

With the declared model's columns X (N, m) and an effect's contribution c (N,) [N m] at the rows of the regression,

    r = c - X X^+ c                                                                     (remainder)

is the part of c that no change of the declared parameters imitates: |r|^2/sigma^2 is the Fisher information about the
effect's size after the declared parameters are estimated along.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.effects.base import DriveEffect, Effect
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.experiments.sizes import JointNumbers, Size, acts_through_shape, directions, strengths
from drake_tc.types import FloatArray

MOST_SHAPES = 14
"""Shapes of an effect that are looked at; a longer grid is thinned evenly."""
NUMERICAL = 1e-7
"""Share of a contribution that the declared model must leave: less of it is the rounding error of an exact identity."""
MOST_ROWS = 12_000
"""Rows that take part; more are thinned evenly."""


@dataclass(frozen=True, eq=False)
class Contribution:
    """One effect at one value of its shape.

    Attributes:
        effect: The effect.
        shape: Values of its shape parameters.
        sizes: (g,) sizes of the rows of `remainders`: (1,) with 1 for an effect in which the balance is linear.
        remainders: (g, p, N) what the declared model leaves of the contribution [N m], for each of p phases.
        whole: (g,) RMS of the contribution itself [N m], over phases.
        change: (N,) the contribution at one size and phase [N m].
        span: (N, k) what a fit with this effect can explain beside the declared model.
    """

    effect: Effect
    shape: dict[str, float]
    sizes: FloatArray
    remainders: FloatArray
    whole: FloatArray
    change: FloatArray
    span: FloatArray

    @property
    def linear(self) -> bool:
        """Whether the contribution grows in proportion to the size."""
        return self.sizes.size == 1

    def rms(self) -> FloatArray:
        """(g,) RMS of the remainder over rows and phases [N m]."""
        return np.asarray(np.sqrt(np.mean(self.remainders**2, axis=(1, 2))))

    def at(self, size: float) -> FloatArray:
        """(p, N) remainder at a size: in proportion, or that of the nearest size of the grid, scaled."""
        if self.linear:
            return np.asarray(size * self.remainders[0])
        return np.asarray(self.remainders[int(np.argmin(np.abs(np.log(self.sizes / size))))])


def thinned(shapes: Sequence[dict[str, float]]) -> Sequence[dict[str, float]]:
    """At most `MOST_SHAPES` of the shapes that a search would try."""
    return shapes[:: max(1, -(-len(shapes) // MOST_SHAPES))]


class ContributionBuilder:
    """Contributions of effects to one joint's rows."""

    def __init__(self, prepared: Prepared, numbers: JointNumbers) -> None:
        """Over the training rows of `prepared`; `numbers` of its declared model.

        A declared drive gain is kept fixed, so that no refitted gain imitates an error of the declared value.
        """
        self._columns: Columns = prepared.train
        self._context = prepared.context
        self._numbers = numbers
        self._step = max(1, -(-prepared.train.target.size // MOST_ROWS))
        self.declared: Fit = fit(prepared.train, prepared.terms)
        design = prepared.train.design(prepared.terms)[:: self._step]
        if prepared.train.declared_gain is not None:
            design = design[:, 1:]
        norms = np.linalg.norm(design, axis=0)
        self.design = design / np.where(norms > 0.0, norms, 1.0)
        self._basis = np.linalg.qr(self.design)[0]
        self.rows = design.shape[0]

    def remainder(self, values: FloatArray) -> FloatArray:
        """What the declared model leaves of columns (N, k)."""
        return np.asarray(values - self._basis @ (self._basis.T @ values))

    def residual(self) -> FloatArray:
        """(N,) of the declared model [N m]."""
        return np.asarray(self.declared.residual[:: self._step] / (self._columns.gain or self.declared.gain))

    def of(self, effect: Effect, size: Size) -> list[Contribution]:
        """The effect at the shapes that a search would try."""
        if acts_through_shape(effect) or effect.key == "current_lag.winding":
            return [self._through_effort(effect, size)]
        return [self._by_columns(effect, shape) for shape in thinned(effect.shape_grid(self._context))]

    def _by_columns(self, effect: Effect, shape: dict[str, float]) -> Contribution:
        if isinstance(effect, ServoGain):
            effort = self._columns.effort(())[:: self._step, None] / self._numbers.gain
            phi, thetas = effort, [np.ones(1)]
        else:
            phi = self._columns.of(Term(effect, shape))[:: self._step]
            thetas = list(directions(effect, self._numbers))
        left = self.remainder(phi)
        remainders = np.stack([left @ theta for theta in thetas])[None]
        whole = np.sqrt(np.mean([np.mean((phi @ theta) ** 2) for theta in thetas]))
        return Contribution(effect, shape, np.ones(1), remainders, np.array([whole]), phi @ thetas[0], left)

    def _through_effort(self, effect: Effect, size: Size) -> Contribution:
        """A drive effect whose size is its shape: (T(y) - y)/K at every size of its grid."""
        values = strengths(effect, size, self._context)
        before, k = self._columns.effort(())[:: self._step], self._numbers.gain
        changes = []
        for value in values:
            term = Term(effect, {size.name: float(value)})
            changed = (self._columns.effort([term])[:: self._step] - before) / k
            if effect.coefficients:
                changed = changed + 0.5 * self._numbers.viscous * self._columns.of(term)[:: self._step, 0]
            changes.append(changed)
        stack = np.stack(changes, axis=-1)
        left = self.remainder(stack)
        whole = np.sqrt(np.mean(stack**2, axis=0))
        return Contribution(effect, {}, values, left.T[:, None, :], whole, stack[:, -1], left)


def imitators(declared: Fit, design: FloatArray, change: FloatArray) -> list[str]:
    """Titles of the declared terms that imitate a contribution (N,) most, the most important first.

    Args:
        declared: The declared model.
        design: (N, m) its columns with unit length; without the column of the effort where the drive gain is declared.
        change: (N,) [N m].
    """
    solution = np.linalg.lstsq(design, change, rcond=None)[0]
    titles = [term.effect.title for term in declared.terms for _ in term.effect.coefficients]
    if design.shape[1] > len(titles):
        titles = ["the drive gain", *titles]
    weights = np.abs(solution)
    order = [int(i) for i in np.argsort(-weights) if weights[i] > 0.2 * weights.max()]
    return list(dict.fromkeys(titles[i] for i in order))[:2]


def explained_by(target: FloatArray, other: Contribution, lower: Sequence[float]) -> float:
    """Smallest RMS that another effect leaves of a remainder (N,) [N m].

    A single coefficient keeps its sign bound; a drive effect may take any size of its grid at its own strength.

    Args:
        target: Remainder of the first effect.
        other: The second effect.
        lower: Lower bounds of its coefficients.
    """
    if other.linear and other.span.shape[1] > 1:
        beta = np.linalg.lstsq(other.span, target, rcond=None)[0]
        return float(np.sqrt(np.mean((target - other.span @ beta) ** 2)))
    squares = np.sum(other.span**2, axis=0)
    beta = other.span.T @ target / np.where(squares > 0.0, squares, 1.0)
    # between neighbouring sizes of the grid the change is nearly in proportion
    low, high = (lower[0] if len(lower) else -np.inf, np.inf) if other.linear else (0.5, 2.0)
    beta = np.clip(beta, low, high)
    left = target[:, None] - other.span * beta
    return float(np.sqrt(np.min(np.mean(left**2, axis=0))))


def is_late(effect: Effect) -> bool:
    """Whether the effect is a delay or a lag of the drive."""
    return isinstance(effect, DriveEffect) and effect.id in ("delay", "current_lag")
