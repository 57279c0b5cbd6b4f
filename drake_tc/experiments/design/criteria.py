"""How good a motion is: information about parameters, and how much of every effect it shows.

With the columns Z (T, p) of the parameters in units of their typical sizes, the weights w of the rows in motion, the
noise s [N m] and the rate of independent samples,

    M = (n/(T s^2)) Z' diag(w) Z,   D: max log det M,   E: max lambda_min(M)                    (Fisher information)

How far two models stay apart at a motion, whatever the parameters of the wrong one are.

For effect A of size z beside a model whose other effect is B (Atkinson and Fedorov, Biometrika 62, 1975, eq. 2)

    T(A, B) = min_{beta, theta, shape of B} n/(T s^2) |z phi_A - X beta - Phi_B(shape) theta|_w^2       (T-optimality)

X: declared columns; w: weights of the rows in motion; s: noise [N m]; n: independent samples; theta and the shape
inside their bounds. T is twice the expected logarithm of the ratio of the likelihoods. The design makes the smallest T
over the orders of A and B, over both signs of A and over its shapes, largest.

An order in which B has more parameters than A is left out: of two models that fit equally well, a diagnosis takes the
one with fewer parameters, and lists the other one only if it fits better. A diagnosis must also find the effect at all,
which depends on the distances V of A and of B from the declared model without either of them.
Where the smallest V is less than `ENOUGH` times what a diagnosis asks for, the criterion falls by the logarithm of what
is lacking; a larger one adds nothing, since only T separates the two.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from drake_tc.diagnosis.priors import NAMED_FLOORS
from drake_tc.experiments.design.forms import EffectForm, Projection, contributions
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint
from drake_tc.experiments.design.robot_goal import Determinant, SmallestEigenvalue
from drake_tc.experiments.fitted import Noise
from drake_tc.types import FloatArray


class Criterion(ABC):
    """A goal of a design: larger is better, differentiable nearly everywhere.

    Attributes:
        duration: Of the experiment [s].
    """

    duration: float

    @abstractmethod
    def value(self, columns: BalanceColumns) -> float:
        """Of one period of a motion, repeated over the whole experiment."""


def information_scale(joint: DesignJoint, duration: float, rows: int) -> float:
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
        own = [] if self.joint.gain_held else ["1/drive gain"]
        for term in self.joint.declared:
            own += [p.name for p in term.effect.coefficients]
        return (*own, *(f"{form.effect.key}: {form.size.name}" for form in self.forms))

    @property
    def unit_names(self) -> tuple[str, ...]:
        """Of the parameters; the drive's is that of 1/K."""
        units = self.joint.context.units
        own = [] if self.joint.gain_held else [units.of("N*m/effort")]
        for term in self.joint.declared:
            own += [units.of(p.unit) for p in term.effect.coefficients]
        return (*own, *(form.size.unit for form in self.forms))

    def columns(self, columns: BalanceColumns) -> FloatArray:
        """Z (T, p) [N m] for a change of each parameter by its typical size: see `units`."""
        every = columns.design(self.joint.declared)
        declared = every[:, every.shape[1] - self._declared_size :] * self.units[: self._declared_size]
        made = [change[:, :1] for change in contributions(self.forms, columns)]
        return np.concatenate([declared, *made], axis=1)

    @property
    def _declared_size(self) -> int:
        free = 0 if self.joint.gain_held else 1
        return free + sum(len(t.effect.coefficients) for t in self.joint.declared)

    @property
    def units(self) -> FloatArray:
        """(p,) typical sizes: a tenth of a fitted drive's torque per effort and of friction, an effect's own size."""
        n = self.joint.numbers
        part = 0.05 * n.torque
        sizes = [] if self.joint.gain_held else [0.1 / n.gain]
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
        scale = information_scale(columns.joint, self.duration, z.shape[0])
        return np.asarray(scale * z.T @ (columns.weight[:, None] * z))

    def value(self, columns: BalanceColumns) -> float:
        """Log det M, or log lambda_min(M)."""
        return (SmallestEigenvalue() if self.smallest else Determinant()).value(self.information(columns))


@dataclass(frozen=True, eq=False)
class AllEffects(Criterion):
    """As much as possible of every effect beside the declared model: the mean of log(r^2/r_least^2), saturated.

    Attributes:
        joint: The joint. forms: Effects. duration: Of the experiment [s].
    """

    joint: DesignJoint
    forms: tuple[EffectForm, ...]
    duration: float

    def ratios(self, columns: BalanceColumns) -> FloatArray:
        """(e,) RMS of each effect's remainder, at the middle one of its shapes, over what is found."""
        declared = Projection(columns)
        joint, rows = columns.joint, math.sqrt(float(np.mean(columns.weight)))
        noise = Noise(joint.floor or joint.noise, joint.noise, max(joint.independent_per_second * self.duration, 3.0))
        made = contributions(self.forms, columns)
        squares = np.mean(declared.of(np.concatenate(made, axis=1)) ** 2, axis=0)
        phases = np.array([change.shape[1] for change in made])
        found = np.sqrt(np.add.reduceat(squares, np.cumsum(phases) - phases) / phases)
        return np.asarray(found / [rows * noise.least(form.effect.degrees_of_freedom) for form in self.forms])

    def value(self, columns: BalanceColumns) -> float:
        """Mean over the effects of -log(1 + (r_least/r)^2)."""
        ratios = np.maximum(self.ratios(columns), 1e-6)
        return -float(np.mean(np.log1p(ratios**-2)))


FOUND = NAMED_FLOORS**2
"""V/n that a diagnosis asks of an effect: half a noise floor."""
ENOUGH = 4.0
"""V over what a diagnosis asks for, from which on an effect is found for certain: twice the size that is found."""
CERTAIN = float(norm.ppf(0.98))
"""Standard deviations by which the better of two models must be better."""
SOFT = 8.0
"""Sharpness of the smooth minimum over shapes, on a logarithmic scale."""
Distances = Mapping[tuple[str, str], FloatArray]
"""By (truth, other), T for each shape and sign of the truth."""


@dataclass(frozen=True, eq=False)
class Discrimination(Criterion):
    """T-optimality for two effects, each taken for the truth in turn.

    Attributes:
        joint: The joint.
        orders: (truth, other), in both orders. An order is left out if the other model contains the truth or has more
            parameters.
        duration: Of the experiment [s].
        contained: (truth, other, proof) of an order in which the other model contains the truth.
    """

    joint: DesignJoint
    orders: tuple[tuple[EffectForm, EffectForm], ...]
    duration: float
    contained: tuple[tuple[str, str, str], ...] = ()

    def distances(self, columns: BalanceColumns, declared: Projection) -> Distances:
        """T of both orders; `declared` takes the declared model out of the columns."""
        out = {}
        for truth, other in self.orders:
            targets, widths = [], []
            for shape in truth.shapes:
                left = declared.of(truth.change(columns, shape))
                signs = (1.0, -1.0) if truth.either_sign else (1.0,)
                targets += [sign * left for sign in signs]
                widths += [left.shape[1]] * len(signs)
            least = self._scale(columns) * other.left(declared, columns, np.concatenate(targets, axis=1))
            ends = np.cumsum(widths)
            means = [np.mean(least[e - w : e]) for e, w in zip(ends, widths, strict=True)]
            out[truth.effect.key, other.effect.key] = np.array(means)
        return out

    def visibilities(self, columns: BalanceColumns, declared: Projection) -> dict[str, FloatArray]:
        """By effect, the distance T of each shape from the declared model alone."""
        scale, out = self._scale(columns), {}
        for form in dict.fromkeys(form for order in self.orders for form in order):
            left = [declared.of(form.change(columns, shape)) for shape in form.shapes]
            out[form.effect.key] = np.array([scale * np.mean(np.sum(each**2, axis=0)) for each in left])
        return out

    def _scale(self, columns: BalanceColumns) -> float:
        return information_scale(columns.joint, self.duration, columns.weight.size)

    def value(self, columns: BalanceColumns) -> float:
        """Smooth minimum of log T over both orders and all shapes, less what the visibility of an effect lacks."""
        declared = Projection(columns)
        apart = _soft_minimum(np.concatenate(list(self.distances(columns, declared).values())))
        visible = np.concatenate(list(self.visibilities(columns, declared).values()))
        seen = _soft_minimum(visible / (ENOUGH * self._asked(columns)))
        return apart + min(seen, 0.0)

    def _asked(self, columns: BalanceColumns) -> float:
        """V that a diagnosis asks of an effect, in the units of `visibilities`."""
        sliding = self.duration * max(float(np.mean(columns.weight)), 1e-9)
        return FOUND * columns.joint.independent_per_second * sliding


def _soft_minimum(squares: FloatArray) -> float:
    logs = np.log(squares + 1e-9)
    least = float(logs.min())
    return least - float(np.log(np.mean(np.exp(-SOFT * (logs - least))))) / SOFT
