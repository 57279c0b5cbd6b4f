"""How torques err, how exactly and for how long a robust program is solved, and the problem in units of the error.

Torques are over sigma, rows over sigma_G. R_ind = -log p_ind is of every side of every row by itself (see
`drake_tc.kernels.tsid.programs`); p_box of the largest box tau +- s sigma inside the polytope, by a quadratic program.

Source: Del Prete and Mansard, 2015, eq. 7, 13 and 17.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeqp3, dorgqr
from scipy.special import erfcinv

from drake_tc.control.torque_uncertainty_file import checked_covariance
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.rows import LeastSquares, Polytope
from drake_tc.types import BoolArray, FloatArray, IntArray


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


_SCALED = Kernel("tsid.scaling", "scaled")

FEASIBLE = 1e-6
"""In units of a row (one sigma): what a point may miss and still count as feasible."""


class ScaledRows(NamedTuple):
    """lower <= A x <= upper; infinite where a side has no limit.

    Attributes:
        matrix: (m, n) A.
        lower, upper: (m,).
        bounds: How many leading rows are those of the identity.
    """

    matrix: FloatArray
    lower: FloatArray
    upper: FloatArray
    bounds: int = 0

    def miss(self, x: FloatArray) -> float:
        """By how much the worst row is missed at x; negative inside."""
        value = self.matrix @ x
        return float(max((self.lower - value).max(initial=-np.inf), (value - self.upper).max(initial=-np.inf)))

    def along(self, origin: FloatArray, basis: FloatArray) -> "ScaledRows":
        """The same rows over y, with x = origin + basis y."""
        shift = self.matrix @ origin
        return ScaledRows(np.ascontiguousarray(self.matrix @ basis), self.lower - shift, self.upper - shift)


class ScaledProblem(NamedTuple):
    """min ||D x - d||^2 on rows, with tau = scale * x, so that a row errs by 1 and a step of 1 in x is one sigma.

    Attributes:
        cost: D diag(scale), d.
        limits: Every row of the polytope, over its sigma_G; a row that does not err over its own length instead.
        certain: (m,) 1 for a row that does not err, else 0.
        sure: How many do not err.
        noise: (m, r) of limits.matrix e: G L over the same divisors.
        scale: (n,) [N m].
    """

    cost: LeastSquares
    limits: ScaledRows
    certain: IntArray
    sure: int
    noise: FloatArray
    scale: FloatArray

    def along(self, origin: FloatArray, basis: FloatArray) -> "ScaledProblem":
        """The same problem over y, with x = origin + basis y; its `scale` stays that of x."""
        cost = LeastSquares(
            np.ascontiguousarray(self.cost.matrix @ basis), self.cost.target - self.cost.matrix @ origin
        )
        return self._replace(cost=cost, limits=self.limits.along(origin, basis))

    @property
    def rows(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """The limits and which of them do not err, as compiled functions take them."""
        return *self.limits[:3], self.certain

    @property
    def erring(self) -> ScaledRows:
        """The limits without those of the rows that do not err: what probabilities are about."""
        if not self.sure:
            return self.limits
        sure = self.certain > 0
        lower = np.where(sure, -np.inf, self.limits.lower)
        return ScaledRows(self.limits.matrix, lower, np.where(sure, np.inf, self.limits.upper))


def scaled(cost: LeastSquares, polytope: Polytope, error: TorqueError) -> ScaledProblem:
    """Both over sigma; see `ScaledProblem`."""
    matrix, target = np.ascontiguousarray(polytope.matrix), cost.target
    sides = np.ascontiguousarray(polytope.lower), np.ascontiguousarray(polytope.upper)
    priced, rows, lower, upper, noise, certain, _, sure = _SCALED(
        np.ascontiguousarray(cost.matrix), (matrix, *sides), error.scale, error.root, error.plain
    )
    limits = ScaledRows(rows, lower, upper, polytope.bounds)
    return ScaledProblem(LeastSquares(priced, target), limits, certain, sure, noise, error.scale)


def nothing(n: int) -> LeastSquares:
    """A cost that is 0."""
    return LeastSquares(np.zeros((0, n)), np.zeros(0))


_EVALUATED = Kernel("tsid.scaling", "evaluated")


def p_ind(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Product of the probabilities of the single sides (eq. 7); 0 where a row that does not err is violated.

    Exact where no row has two sides and the rows are orthogonal in the metric of Sigma.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    return float(_EVALUATED(torque / problem.scale, problem.scale, problem.rows, tuple(problem.cost))[2])


def certain_miss(rows: ScaledRows, certain: IntArray, x: FloatArray) -> bool:
    """Whether a row that does not err (1 in certain) is missed at x."""
    if not certain.any():
        return False
    sure = certain > 0
    return ScaledRows(rows.matrix[sure], rows.lower[sure], rows.upper[sure]).miss(x) > FEASIBLE


_HAS_ONE_MINIMISER = Kernel("tsid.problem", "has_one_minimiser")
RANK = 1e-10
"""Relative to the longest: a row of D, less what the rows before it span, that is shorter adds no direction."""


def null_basis(matrix: FloatArray) -> FloatArray:
    """(n, n - rank) orthonormal basis of {x: D x = 0}, by QR of D^T with column pivoting."""
    rows, n = matrix.shape
    if rows == 0:
        return np.eye(n)
    if _HAS_ONE_MINIMISER(np.ascontiguousarray(matrix)):
        return np.zeros((n, 0))
    factors, _, tau, _, _ = dgeqp3(matrix.T)
    pivots = np.abs(np.diagonal(factors))
    rank = int(np.count_nonzero(pivots > RANK * pivots.max(initial=0.0)))
    square = np.zeros((n, n), order="F")
    square[:, : len(pivots)] = factors[:, : len(pivots)]
    basis: FloatArray = dorgqr(square, tau)[0][:, rank:]
    return basis


_PROGRAM, _SIZE = Kernel("tsid.scaling", "box_program"), Kernel("tsid.scaling", "box_size")
_RISK = Kernel("tsid.scaling", "box_risk")


def box_rows(problem: ScaledProblem) -> tuple[ScaledRows, LeastSquares]:
    """Rows over (x, s) of a box of half width s sigmas around x, and the cost, which s does not enter.

    See `drake_tc.kernels.tsid.scaling.box_program`.
    """
    limits, cost = problem.limits, problem.cost
    rows, lower, upper, priced = _PROGRAM(limits.matrix, limits.lower, limits.upper, problem.noise, cost.matrix)
    return ScaledRows(rows, lower, upper), LeastSquares(priced, cost.target)


def box_size(problem: ScaledProblem, x: FloatArray) -> float:
    """Largest s with x +- s inside; negative where x is outside, -inf where a row that does not err is missed."""
    size: float = _SIZE(x, problem.rows, problem.noise)
    return size


def box_risk(size: float, axes: int) -> float:
    """R_box = -log p_box of a box of half width `size` sigmas in `axes` independent directions; inf for none."""
    risk: float = _RISK(float(size), axes)
    return risk


def size_of_risk(risk: float, axes: int) -> float:
    """The half width whose R_box is `risk`; inverse of `box_risk`."""
    return math.sqrt(2.0) * float(erfcinv(-math.expm1(-risk / max(axes, 1))))


def p_box(polytope: Polytope, torque: FloatArray, error: TorqueError) -> float:
    """Probability that the error stays in the largest box |zeta_i| <= s around the torque: a lower bound of p.

    e = L zeta as in `TorqueError`; with a diagonal Sigma the box is |e_i| <= s sigma_i. 0 outside the polytope.
    """
    problem = scaled(nothing(error.joints), polytope, error)
    return math.exp(-box_risk(box_size(problem, torque / problem.scale), error.root.shape[1]))
