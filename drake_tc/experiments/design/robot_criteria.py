"""Optimality criteria of a robot's motion: functions of the information M (P, P), with their slopes df/dM.

With C = M^-1 and the standard errors s_i = sqrt(C_ii), of which t_i are those after the growing sinusoids,

    intervals:  f = -(2P/p) log(mean over the groups g of mean_{i in g} (s_i/t_i)^p),   df/dM = C W C
    D:          f = log det M,                                                          df/dM = C
    E:          f = log lambda_min(M), with the unit eigenvector u,                     df/dM = u u'/lambda_min

W is diagonal. The groups are base parameters, friction coefficients and rotor inertias. With p = 2, the first criterion
is A-optimality in units of the default's variances, with the same weight for each group. A larger p weighs the
parameters more whose intervals are the widest in these units. D-optimality accepts wider intervals of a few friction
coefficients for narrower ones of many base parameters.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_tc.types import FloatArray, IntArray

CriterionName = Literal["intervals", "D", "E"]
LEAST = 1e-9
"""Smallest eigenvalue that is counted."""
POWER = 2.0
"""p of the power mean."""


class InformationCriterion(ABC):
    """A function of the information: larger is better."""

    @abstractmethod
    def value_and_slope(self, information: FloatArray) -> tuple[float, FloatArray]:
        """(f, df/dM (P, P)) at M (P, P)."""

    def value(self, information: FloatArray) -> float:
        """The value f at M (P, P)."""
        return self.value_and_slope(information)[0]


@dataclass(frozen=True)
class Determinant(InformationCriterion):
    """D-optimality."""

    def value_and_slope(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Of log det M."""
        eigen, vectors = _eigen(information)
        return float(np.sum(np.log(eigen))), np.asarray((vectors / eigen) @ vectors.T)


@dataclass(frozen=True)
class SmallestEigenvalue(InformationCriterion):
    """E-optimality."""

    def value_and_slope(self, information: FloatArray) -> tuple[float, FloatArray]:
        """Of log lambda_min(M)."""
        eigen, vectors = _eigen(information)
        return float(np.log(eigen[0])), np.outer(vectors[:, 0], vectors[:, 0]) / eigen[0]


@dataclass(frozen=True, eq=False)
class RelativeIntervals(InformationCriterion):
    """Power mean of the standard errors in units of those after the default motion.

    Attributes:
        reference: (P,) standard errors t_i after the default motion.
        groups: Indices of the parameters of each group.
        power: p.
    """

    reference: FloatArray
    groups: Sequence[IntArray]
    power: float = POWER

    def value_and_slope(self, information: FloatArray) -> tuple[float, FloatArray]:
        """The value is 0 for the default motion, and 2P log 2 where all intervals are half as wide."""
        eigen, vectors = _eigen(information)
        covariance = (vectors / eigen) @ vectors.T
        variance = np.diag(covariance)
        powers = (np.sqrt(variance) / self.reference) ** self.power
        share = np.zeros_like(powers)
        for group in self.groups:
            share[group] = powers[group] / (group.size * len(self.groups))
        mean, scale = float(share.sum()), 2.0 * powers.size / self.power
        weights = 0.5 * self.power * scale * share / (mean * variance)
        return -scale * float(np.log(mean)), np.asarray((covariance * weights) @ covariance)


def standard_errors(information: FloatArray) -> FloatArray:
    """(P,) square roots of the diagonal of M^-1 (Cramer and Rao)."""
    eigen, vectors = np.linalg.eigh(information)
    return np.asarray(np.sqrt(np.sum(vectors**2 / np.maximum(eigen, 1e-12), axis=1)))


def _eigen(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    eigen, vectors = np.linalg.eigh(information)
    return np.maximum(eigen, LEAST), vectors
