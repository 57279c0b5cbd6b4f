"""How good a motion is: information about parameters, and how much of every effect it shows.

With the columns Z (T, p) of the parameters in units of their typical sizes, the weights w of the rows in motion, the
noise s [N m] and the rate of independent samples,

    M = (n/(T s^2)) Z' diag(w) Z,   D: max log det M,   E: max lambda_min(M)                    (Fisher information)
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from drake_tc.experiments.check.joint import Noise
from drake_tc.experiments.design.forms import EffectForm, Projection, contributions, declared_columns
from drake_tc.experiments.design.joint import BalanceColumns, DesignJoint
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
        found = self.information(columns)
        eigen = np.maximum(np.linalg.eigvalsh(found), 1e-12)
        return float(np.log(eigen[0]) if self.smallest else np.sum(np.log(eigen)))


@dataclass(frozen=True, eq=False)
class AllEffects(Criterion):
    """As much as possible of every effect beside the declared model: the mean of log(r^2/r_least^2), saturated.

    Attributes:
        joint: The joint. forms: Effects. duration: Of the experiment [s].
    """

    joint: DesignJoint
    forms: tuple[EffectForm, ...]
    duration: float

    def noise(self, joint: DesignJoint, seconds: float | None = None) -> Noise:
        """Of a run of so many seconds in motion; None for the experiment. `joint` has the noise of this run."""
        length = self.duration if seconds is None else seconds
        return Noise(joint.floor or joint.noise, joint.noise, max(joint.independent_per_second * length, 3.0))

    def ratios(self, columns: BalanceColumns) -> FloatArray:
        """(e,) RMS of each effect's remainder, at the middle one of its shapes, over what is found."""
        declared = Projection(declared_columns(columns), columns.weight)
        noise, rows = self.noise(columns.joint), math.sqrt(float(np.mean(columns.weight)))
        made = contributions(self.forms, columns)
        squares = np.mean(declared.of(np.concatenate(made, axis=1)) ** 2, axis=0)
        phases = np.array([change.shape[1] for change in made])
        found = np.sqrt(np.add.reduceat(squares, np.cumsum(phases) - phases) / phases)
        return np.asarray(found / [rows * noise.least(form.effect.degrees_of_freedom) for form in self.forms])

    def value(self, columns: BalanceColumns) -> float:
        """Mean over the effects of -log(1 + (r_least/r)^2)."""
        ratios = np.maximum(self.ratios(columns), 1e-6)
        return -float(np.mean(np.log1p(ratios**-2)))
