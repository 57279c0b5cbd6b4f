"""How good a motion is: information about parameters, and how far two models stay apart whatever their parameters are.

With the columns Z (T, p) of the parameters in units of their typical sizes, the weights w of the rows in motion, the
noise s [N m] and the rate of independent samples,

    M = (n/(T s^2)) Z' diag(w) Z,   D: max log det M,   E: max lambda_min(M)                    (Fisher information)

For effect A of size z beside a model whose other effect is B (Atkinson and Fedorov, Biometrika 62, 1975, eq. 2)

    T(A, B) = min_{beta, shape of B} n/(T s^2) |z phi_A - X beta - Phi_B(shape) theta|_w^2           (T-optimality)

X: declared columns. The design makes the smallest T over both orders of A and B, and over the shapes of A, largest.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.thresholds import JOINT, SAME_ERROR
from drake_tc.effects.base import Effect
from drake_tc.effects.context import EFFORT_UNIT
from drake_tc.effects.library import effect
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint
from drake_tc.experiments.sizes import Size, acts_through_shape, directions
from drake_tc.types import FloatArray

CERTAIN = float(norm.ppf(JOINT.least_share))
"""Standard deviations of the share of block resamples that a diagnosis asks for."""
MOST_SHAPES = 3
SOFT = 8.0
"""Sharpness of the smooth minimum over shapes, on a logarithmic scale."""


@dataclass(frozen=True, eq=False)
class EffectForm:
    """One effect with its size, as it takes part in a goal.

    Attributes:
        effect: The effect.
        size: Its size.
        strength: Size that is put in.
        shapes: Values of its shape parameters that are tried.
    """

    effect: Effect
    size: Size
    strength: float
    shapes: tuple[Mapping[str, float], ...]

    def change(self, columns: BalanceColumns, shape: Mapping[str, float]) -> FloatArray:
        """(T, p) contribution [N m] at the strength, one column for each phase."""
        numbers = columns.joint.numbers
        if acts_through_shape(self.effect):
            term = Term(self.effect, {self.size.name: self.strength})
            return np.asarray((columns.effort([term]) - columns.effort(()))[:, None] / numbers.gain)
        phi = columns.of(Term(self.effect, shape))
        thetas = np.stack(directions(self.effect, numbers), axis=-1)
        return np.asarray(self.strength * phi @ thetas)

    def span(self, columns: BalanceColumns, shape: Mapping[str, float]) -> FloatArray:
        """(T, k) what a fit with the effect can explain; a shape effect at several sizes near any strength."""
        if not acts_through_shape(self.effect):
            return columns.of(Term(self.effect, shape))
        before = columns.effort(())
        made = [columns.effort([Term(self.effect, {self.size.name: f * self.strength})]) - before for f in (0.7, 1.4)]
        return np.stack(made, axis=-1) / columns.joint.numbers.gain


def form_of(joint: DesignJoint, key: str, size: Size, strength: float | None = None) -> EffectForm:
    """An effect at its typical size, or at a strength, with a few of its shapes."""
    member = effect(key)
    if acts_through_shape(member):
        shapes: tuple[Mapping[str, float], ...] = ({},)
    else:
        grid = member.shape_grid(joint.context)
        every = max(1, -(-len(grid) // MOST_SHAPES))
        shapes = tuple(grid[::every])
    return EffectForm(member, size, size.typical if strength is None else strength, shapes)


def remainder(basis: FloatArray, values: FloatArray) -> FloatArray:
    """What columns (T, m) leave of values (T, k); columns that are zero or alike do not count twice."""
    norms = np.linalg.norm(basis, axis=0)
    live = basis[:, norms > 1e-9 * max(float(norms.max(initial=0.0)), 1e-300)]
    unit = live / np.linalg.norm(live, axis=0)
    u, s, _ = np.linalg.svd(unit, full_matrices=False)
    u = u[:, s > 1e-7 * s[0]]
    return np.asarray(values - u @ (u.T @ values))


class Criterion(ABC):
    """A goal of a design: larger is better, differentiable nearly everywhere."""

    @abstractmethod
    def value(self, columns: BalanceColumns) -> float:
        """Of one period of a motion, repeated over the whole experiment."""


def _scale(joint: DesignJoint, duration: float, rows: int) -> float:
    """n/(T s^2): information per row and squared newton metre."""
    return joint.independent_per_second * duration / (rows * joint.noise**2)


@dataclass(frozen=True, eq=False)
class Parameters(Criterion):
    """D- or E-optimality for the declared parameters and for those of further effects.

    Attributes:
        joint: The joint. forms: Effects that are estimated along.
        duration: Of the experiment [s]. smallest: E- instead of D-optimality.
    """

    joint: DesignJoint
    forms: tuple[EffectForm, ...]
    duration: float
    smallest: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, in the order of the columns."""
        own = ["1/drive gain"]
        for term in self.joint.declared:
            own += [p.name for p in term.effect.coefficients]
        return (*own, *(f"{form.effect.key}: {form.size.name}" for form in self.forms))

    @property
    def unit_names(self) -> tuple[str, ...]:
        """Of the parameters; the drive's is that of 1/K."""
        unit = EFFORT_UNIT[self.joint.context.drive]
        own = [f"N*m/{unit}"]
        for term in self.joint.declared:
            own += [p.unit.replace("effort", unit) for p in term.effect.coefficients]
        return (*own, *(form.size.unit for form in self.forms))

    def columns(self, columns: BalanceColumns) -> FloatArray:
        """Z (T, p) [N m] for a change of each parameter by its typical size: see `units`."""
        declared = columns.design(self.joint.declared) * self.units[: 1 + self._declared_size]
        made = [form.change(columns, form.shapes[len(form.shapes) // 2])[:, :1] for form in self.forms]
        return np.concatenate([declared, *made], axis=1)

    @property
    def _declared_size(self) -> int:
        return sum(len(t.effect.coefficients) for t in self.joint.declared)

    @property
    def units(self) -> FloatArray:
        """(p,) typical sizes: a tenth of the drive's torque per effort and of friction, an effect's own size."""
        n = self.joint.numbers
        part = 0.05 * n.torque
        sizes = [0.1 / n.gain]
        for term in self.joint.declared:
            typical = {
                "viscous": 0.1 * max(n.viscous, part / max(n.speed, 1e-9)),
                "coulomb": 0.1 * max(n.coulomb, 0.2 * part),
                "rotor_inertia": 0.1 * max(n.inertia, 1e-9),
            }
            sizes += [typical.get(term.effect.key, part)] * len(term.effect.coefficients)
        return np.array([*sizes, *(form.strength for form in self.forms)])

    def information(self, columns: BalanceColumns) -> FloatArray:
        """M (p, p) of the whole experiment, in units of the typical sizes."""
        z = self.columns(columns)
        scale = _scale(self.joint, self.duration, z.shape[0])
        return np.asarray(scale * z.T @ (columns.weight[:, None] * z))

    def value(self, columns: BalanceColumns) -> float:
        """Log det M, or log lambda_min(M)."""
        found = self.information(columns)
        eigen = np.maximum(np.linalg.eigvalsh(found), 1e-12)
        return float(np.log(eigen[0]) if self.smallest else np.sum(np.log(eigen)))


@dataclass(frozen=True, eq=False)
class Discrimination(Criterion):
    """T-optimality for two effects, each taken for the truth in turn.

    Attributes:
        joint: The joint.
        orders: (truth, other) of both orders; of one where the other model contains the truth.
        duration: Of the experiment [s].
    """

    joint: DesignJoint
    orders: tuple[tuple[EffectForm, EffectForm], ...]
    duration: float

    def distances(self, columns: BalanceColumns) -> dict[tuple[str, str], FloatArray]:
        """By (truth, other): T for each shape of the truth, the smallest over the shapes of the other."""
        out = {}
        for truth, other in self.orders:
            out[truth.effect.key, other.effect.key] = self._distance(columns, truth, other)
        return out

    def _distance(self, columns: BalanceColumns, truth: EffectForm, other: EffectForm) -> FloatArray:
        root = np.sqrt(columns.weight)[:, None]
        declared = root * columns.design(self.joint.declared)
        targets = [root * truth.change(columns, shape) for shape in truth.shapes]
        widths = [t.shape[1] for t in targets]
        stacked = np.concatenate(targets, axis=1)
        scale = _scale(self.joint, self.duration, stacked.shape[0])
        left = []
        for shape in other.shapes:
            basis = np.concatenate([declared, root * other.span(columns, shape)], axis=1)
            left.append(scale * np.sum(remainder(basis, stacked) ** 2, axis=0))
        least = np.min(left, axis=0)
        ends = np.cumsum(widths)
        return np.array([np.mean(least[e - w : e]) for e, w in zip(ends, widths, strict=True)])

    def value(self, columns: BalanceColumns) -> float:
        """Smooth minimum of log T over both orders and all shapes."""
        logs = np.log(np.concatenate(list(self.distances(columns).values())) + 1e-9)
        least = float(logs.min())
        return least - float(np.log(np.mean(np.exp(-SOFT * (logs - least))))) / SOFT

    def probability(self, distances: Mapping[tuple[str, str], FloatArray]) -> float:
        """That a diagnosis tells the true effect from the other one, for the worse order and a shape in the middle.

        Args:
            distances: Of `distances`.
        """
        worst = min(float(np.median(each)) for each in distances.values())
        return told_apart(worst, self.joint.independent_per_second * self.duration)


def told_apart(distance: float, independent: float) -> float:
    """Probability that a diagnosis tells two models apart whose distance is T.

    The difference of the squared errors is normal with mean T and variance 4 T in units of the noise. A diagnosis lists
    two effects as indistinguishable unless it is positive in 98 % of the resamples and the error rises by 2 %.

    Args:
        distance: T.
        independent: Samples n.
    """
    if distance <= 0.0:
        return 0.0
    needed = independent * ((1.0 + SAME_ERROR) ** 2 - 1.0)
    spread = 2.0 * np.sqrt(distance)
    return float(min(norm.cdf(distance / spread - CERTAIN), norm.cdf((distance - needed) / spread)))


@dataclass(frozen=True, eq=False)
class Everything(Criterion):
    """As much as possible of every effect beside the declared model: the mean of log(r^2/r_least^2), saturated.

    Attributes:
        joint: The joint. forms: Effects. duration: Of the experiment [s]. least: RMS that is found [N m].
    """

    joint: DesignJoint
    forms: tuple[EffectForm, ...]
    duration: float
    least: float

    def ratios(self, columns: BalanceColumns) -> FloatArray:
        """(e,) RMS of each effect's remainder over what is found."""
        root = np.sqrt(columns.weight)[:, None]
        declared = root * columns.design(self.joint.declared)
        out = []
        for form in self.forms:
            change = root * form.change(columns, form.shapes[len(form.shapes) // 2])
            left = remainder(declared, change)
            out.append(float(np.sqrt(np.mean(left**2) / np.mean(columns.weight))))
        return np.array(out) / self.least

    def value(self, columns: BalanceColumns) -> float:
        """Mean over the effects of -log(1 + (r_least/r)^2)."""
        ratios = np.maximum(self.ratios(columns), 1e-6)
        return -float(np.mean(np.log1p(ratios**-2)))
