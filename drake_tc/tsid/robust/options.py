"""How exactly a robust program is solved, and for how long.

How long a robust solve may take, over all programs that it consists of.

By how much the joint torques err: e ~ N(0, Sigma).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from drake_tc.control.torque_uncertainty_file import checked_covariance
from drake_tc.errors import ParamsError
from drake_tc.types import BoolArray, FloatArray


@dataclass(frozen=True)
class Budget:
    """When to stop early.

    Attributes:
        iterations: Steps of Newton's method at most, of all programs of a solve together.
        seconds: Wall time at most, by `clock`; infinite for a simulation that shall repeat itself.
        clock: Seconds, e.g. time.perf_counter; needed where `seconds` is finite.

    Raises:
        ParamsError: no iterations, a time that is not positive, or a finite time without a clock.
    """

    iterations: int = 1000
    seconds: float = math.inf
    clock: Callable[[], float] | None = None

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise ParamsError(f"iterations: expected at least 1, got {self.iterations}")
        if not self.seconds > 0.0:
            raise ParamsError(f"seconds: expected more than 0, got {self.seconds:g}")
        if math.isfinite(self.seconds) and self.clock is None:
            raise ParamsError("budget: expected a clock, as seconds is finite; time.perf_counter is one")

    def started(self) -> "Spending":
        """The budget with its time running from now on."""
        return Spending(self)


class Spending:
    """What is left of a budget."""

    __slots__ = ("_clock", "_left", "_until")

    def __init__(self, budget: Budget) -> None:
        """Start the time."""
        self._left = budget.iterations
        self._clock = budget.clock if math.isfinite(budget.seconds) else None
        self._until = self._clock() + budget.seconds if self._clock is not None else math.inf

    def most(self) -> int:
        """How many steps may be taken until it is asked again whether this is `late`."""
        return max(self._left, 1) if self._clock is None else 1

    def steps(self, count: int) -> None:
        """Count steps."""
        self._left -= count

    def late(self) -> bool:
        """Whether nothing is left."""
        return self._left <= 0 or (self._clock is not None and self._clock() >= self._until)


@dataclass(frozen=True)
class Options:
    """Of Newton's method.

    Attributes:
        accuracy: A program ends when the model promises less than this times the weight of R. Tasks that count less
            than that beside R are met only as well as this leaves them. A smaller accuracy needs more iterations, most
            of all in a cold start far from all limits.
        budget: Of iterations and, where it has a clock, of wall time; the best feasible torque comes back.

    Raises:
        ParamsError: an accuracy that is not above 0.
    """

    accuracy: float = 1e-6
    budget: Budget = field(default_factory=Budget)

    def __post_init__(self) -> None:
        if not self.accuracy > 0.0:
            raise ParamsError(f"accuracy: expected > 0, got {self.accuracy:g}")


ROUNDING = 1e-9
"""Relative to the largest variance: how far from symmetric and positive semidefinite a covariance may be."""

CERTAIN = 1e-12
"""Relative to the largest standard deviation: what is less counts as exactly known."""


@dataclass(frozen=True, eq=False)
class TorqueError:
    """Zero-mean Gaussian torque error of n joints, e = L zeta with zeta ~ N(0, I) of r <= n axes.

    For a diagonal Sigma the axes are the joints that err. Else L = diag(sigma) C^(1/2) with C the correlations: of all
    L with L L^T = Sigma the one whose axes stay nearest to the joints, whatever their order and units.

    Attributes:
        covariance: (n,) variances or (n, n) Sigma [(N m)^2]; kept as (n, n).
        sigma: (n,) standard deviations [N m].
        diagonal: Whether the joints err independently.
        plain: Whether moreover every joint errs, so that the axes are the joints.
        root: (n, r) L.
        scale: (n,) units in which the robust programs count torques: sigma, and the largest of them where it is 0.

    Raises:
        ParamsError: a covariance that is not finite, not square, not symmetric or not positive semidefinite.
    """

    covariance: FloatArray
    sigma: FloatArray = field(init=False)
    diagonal: bool = field(init=False)
    plain: bool = field(init=False)
    root: FloatArray = field(init=False, repr=False)
    scale: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        covariance = _checked(np.array(self.covariance, dtype=np.float64))
        sigma = np.sqrt(np.diagonal(covariance))
        largest = float(sigma.max())
        erring = sigma > CERTAIN * largest
        diagonal = not np.any(covariance - np.diag(np.diagonal(covariance)))
        root = np.diag(sigma)[:, erring] if diagonal else _root(covariance, sigma, erring)
        values = {
            "covariance": covariance,
            "sigma": sigma,
            "root": root,
            "scale": np.where(erring, sigma, largest if largest > 0.0 else 1.0),
        }
        for name, value in values.items():
            kept = np.ascontiguousarray(value)
            kept.setflags(write=False)
            object.__setattr__(self, name, kept)
        object.__setattr__(self, "diagonal", diagonal)
        object.__setattr__(self, "plain", bool(diagonal and erring.all()))

    @property
    def joints(self) -> int:
        """N."""
        return len(self.sigma)

    def row_sigma(self, matrix: FloatArray) -> FloatArray:
        """(m,) standard deviations of G e, sigma_G = sqrt(diag(G Sigma G^T)), for G (m, n)."""
        rows = matrix @ self.root if not self.diagonal else matrix * self.sigma
        deviation: FloatArray = np.sqrt(np.einsum("ij,ij->i", rows, rows))
        return deviation


def _checked(covariance: FloatArray) -> FloatArray:
    """(n, n) of what was given; raises ParamsError."""
    if covariance.ndim not in (1, 2) or covariance.size == 0 or covariance.shape[0] != covariance.shape[-1]:
        raise ParamsError(f"covariance: expected (n,) variances or (n, n), n >= 1, got shape {covariance.shape}")
    if covariance.ndim == 2:
        return checked_covariance(covariance)
    if not np.all(np.isfinite(covariance)):
        raise ParamsError("covariance: expected finite numbers, got NaN or infinity")
    if covariance.min() < 0.0:
        raise ParamsError(f"covariance: expected variances >= 0; the smallest is {covariance.min():g}")
    return np.diag(covariance)


def _root(covariance: FloatArray, sigma: FloatArray, erring: BoolArray) -> FloatArray:
    """diag(sigma) times the symmetric root of the correlations, or its eigenvectors where that is singular."""
    keep = np.flatnonzero(erring)
    correlation = covariance[np.ix_(keep, keep)] / np.outer(sigma[keep], sigma[keep])
    values, vectors = np.linalg.eigh(correlation)
    positive = values > ROUNDING * values.max()
    half = vectors[:, positive] * np.sqrt(values[positive])
    root = np.zeros((len(sigma), len(keep) if positive.all() else int(positive.sum())))
    root[keep] = sigma[keep, None] * (half @ vectors.T if positive.all() else half)
    return root
