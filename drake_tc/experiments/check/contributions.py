"""What effects would do to the torque balance of a joint at recorded motions, beyond what its declared model explains.

With the declared model's columns X (N, m) and an effect's contribution c (N,) [N m] at the rows of the regression,

    r = c - X X^+ c                                                                     (remainder)

is the part of c that no change of the declared parameters imitates: |r|^2/sigma^2 is the Fisher information about the
effect's size after the declared parameters are estimated along.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns, Term, prior_coefficients
from drake_tc.diagnosis.problem.prepared import Prepared
from drake_tc.diagnosis.problem.regression import Fit, bounds_of, fit
from drake_tc.effects.base import DriveEffect, Effect
from drake_tc.effects.servo_gain import ServoGain
from drake_tc.effects.within_tolerance import WithinTolerance
from drake_tc.experiments.check.tolerable import SIZES, TolerableErrors
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
        tolerated: Size up to which errors of the joint's sensors within their tolerances may imitate it; 0 where none.
    """

    effect: Effect
    shape: dict[str, float]
    sizes: FloatArray
    remainders: FloatArray
    whole: FloatArray
    change: FloatArray
    span: FloatArray
    tolerated: float = 0.0
    _left: dict[tuple["Contribution", int], FloatArray] = field(default_factory=dict, init=False, repr=False)

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
        return np.asarray(self.remainders[self._nearest(size)])

    def _nearest(self, size: float) -> int:
        """Index of the size of the grid that is nearest in ratio."""
        return int(np.argmin(np.abs(np.log(self.sizes / size))))

    def left_by(self, other: "Contribution", size: float) -> FloatArray:
        """(p,) RMS that another effect leaves of the remainder at a size [N m].

        It is computed once for each remainder of the grid: in proportion to the size where no bound of the other effect
        depends on it.
        """
        if self.linear and not other.in_proportion:
            return other.leaves(self.at(size))
        index = 0 if self.linear else self._nearest(size)
        if (other, index) not in self._left:
            self._left[other, index] = other.leaves(self.remainders[index])
        return (size if self.linear else 1.0) * self._left[other, index]

    @property
    def in_proportion(self) -> bool:
        """Whether what the effect leaves of a torque grows in proportion to the torque."""
        return self.linear and all(p.lower in (0.0, -np.inf) for p in self.effect.coefficients[:1])

    def leaves(self, targets: FloatArray) -> FloatArray:
        """(p,) RMS that the effect leaves of torques (p, N) that the declared model does not imitate [N m].

        A single coefficient keeps its sign bound; a drive effect may take any size of its grid at its own strength.
        """
        if self._basis is not None:
            left = targets - (targets @ self._basis) @ self._basis.T
            return np.asarray(np.sqrt(np.mean(left**2, axis=1)))
        squares = np.sum(self.span**2, axis=0)
        lower = [p.lower for p in self.effect.coefficients[:1]]
        # between neighbouring sizes of the grid the change is nearly in proportion
        low, high = (lower[0] if lower else -np.inf, np.inf) if self.linear else (0.5, 2.0)
        along = targets @ self.span
        beta = np.clip(along / np.where(squares > 0.0, squares, 1.0), low, high)
        best = np.argmin(beta * (beta * squares - 2.0 * along), axis=1)  # (target - beta span)^2 less target^2
        left = targets - self.span[:, best].T * np.take_along_axis(beta, best[:, None], axis=1)
        return np.asarray(np.sqrt(np.mean(left**2, axis=1)))

    @cached_property
    def _basis(self) -> FloatArray | None:
        """Orthonormal basis (N, r) of the span of several coefficients; None where there is at most one."""
        if not self.linear or self.span.shape[1] < 2:
            return None
        basis, upper = np.linalg.qr(self.span)
        lengths, rounding = np.abs(np.diag(upper)), np.finfo(float).eps * self.span.shape[0]
        if lengths.min() > rounding * lengths.max():
            return np.asarray(basis)
        basis, values, _ = np.linalg.svd(self.span, full_matrices=False)
        return np.asarray(basis[:, values > rounding * values[0]])


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
        allowed, limits = prior_coefficients(prepared.terms, WithinTolerance), bounds_of(prepared.terms)[1]
        if prepared.train.declared_gain is not None:
            design, allowed, limits = design[:, 1:], allowed[1:], limits[1:]
        self._errors: TolerableErrors | None = None
        if allowed.any():
            self._free = np.linalg.qr(design[:, ~allowed])[0]
            self._errors = TolerableErrors(_without(self._free, design[:, allowed]), limits[allowed])
        norms = np.linalg.norm(design, axis=0)
        self.design = design / np.where(norms > 0.0, norms, 1.0)
        self._basis = np.linalg.qr(self.design)[0]
        self.rows = design.shape[0]

    def remainder(self, values: FloatArray) -> FloatArray:
        """What the declared model leaves of columns (N, k)."""
        return _without(self._basis, values)

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
        if self._errors is not None and phi.shape[1] == 1:
            own = _without(self._free, phi[:, 0])
            if (limit := self._errors.free_up_to(own)) > 0.0:
                sizes = limit * SIZES
                beyond = self._errors.remainders(own, sizes)
                whole = sizes * np.sqrt(np.mean(phi**2))
                return Contribution(effect, shape, sizes, beyond[:, None], whole, phi[:, 0], beyond.T, limit)
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


def _without(basis: FloatArray, values: FloatArray) -> FloatArray:
    """Values (N, ...) without their part in the span of an orthonormal basis (N, m)."""
    return np.asarray(values - basis @ (basis.T @ values))


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


def is_late(effect: Effect) -> bool:
    """Whether the effect is a delay or a lag of the drive."""
    return isinstance(effect, DriveEffect) and effect.id in ("delay", "current_lag")
