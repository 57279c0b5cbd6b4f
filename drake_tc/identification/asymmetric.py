"""The asymmetric penalty: a friction model that never over-compensates (Del Prete et al., 2016, section 3).

A feedforward that over-estimates friction makes the joint run away; one that under-estimates it is only weaker.
So residuals on the side of over-estimation cost w times more:

    s_i = sign(b_i),  r_i = s_i (a_iᵀ x − b_i),   min_x F(x) = Σ φ(r_i),   φ(z) = w z² if z > 0 else z²

F is convex and C¹, piecewise quadratic: a semi-smooth Newton method ends at the exact minimum in a few steps.

A continuous three-piece line for each direction of motion (Del Prete et al., 2016, section 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.identification.autocorrelation import automatic_bandwidth, critical_value_95, long_run_covariance
from drake_tc.identification.regression import MAX_CONDITION, check_excitation, checked, column_scale
from drake_tc.types import BoolArray, FloatArray

_MAX_STEPS = 100
_COARSE = 20_000


@dataclass(frozen=True)
class AsymmetricFit:
    """Minimum of the asymmetric penalty.

    Attributes:
        names: The p parameters.
        coefficients: (p,) x.
        residual: (T,) b − A x [unit of b]; it has the sign of b where |b| is under-estimated.
        cost: F(x) [unit of b, squared].
        over_estimated: Share of samples with |A x| beyond |b|, in [0, 1].
        hac_covariance: (p, p) H⁻¹ S H⁻¹ from the penalty's own scores, autocorrelation included.
        ci95: (p, 2) 95 % confidence interval of the minimiser.
        condition_number: Of A with its columns scaled to unit length.
        steps: Newton steps taken.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    residual: FloatArray
    cost: float
    over_estimated: float
    hac_covariance: FloatArray
    ci95: FloatArray
    condition_number: float
    steps: int

    @property
    def parameters(self) -> dict[str, float]:
        """Estimates by name."""
        return dict(zip(self.names, map(float, self.coefficients), strict=True))


def penalty(z: FloatArray, weight: float = 100.0) -> FloatArray:
    """φ(z) = w z² for z > 0, z² otherwise; elementwise."""
    return np.asarray(np.where(z > 0, weight, 1.0) * z**2)


def asymmetric_least_squares(
    columns: FloatArray,
    target: FloatArray,
    *,
    names: Sequence[str] | None = None,
    weight: float = 100.0,
    lengths: Sequence[int] | None = None,
) -> AsymmetricFit:
    """Minimise F by a semi-smooth Newton method with an Armijo line search; linear in the samples.

    Each step solves (Aᵀ D A) d = −Aᵀ D (A x − b), D_ii = w where r_i > 0, else 1, and halves d until F falls
    enough. Long logs start from the minimum over every k-th sample. Samples with b_i = 0 have s_i = 0 and
    take no part, as in the paper.

    Args:
        columns: A (T, p), finite.
        target: b (T,), finite.
        names: The p parameters; x0, x1, ... when None.
        weight: w >= 1; 1 is ordinary least squares.
        lengths: Lengths of the contiguous stretches, for the intervals.

    Raises:
        IdentificationError: As `least_squares`; a weight below 1; a search that does not come to rest.

    Source: Del Prete et al., 2016, eq. 8 (w = 100). The paper solved the QP below; this is exact.

    Example:
        >>> fit = asymmetric_least_squares(np.ones((2, 1)), np.array([1.0, 2.0]), weight=3.0)
        >>> fit.coefficients.round(6).tolist()  # (3 * 1 + 2) / 4
        [1.25]
    """
    a, b, labels = checked(columns, target, names)
    _check_weight(weight)
    sign = np.sign(b)
    # one row a parameter: every operation below runs along contiguous samples
    rows = np.ascontiguousarray(a.T) * np.abs(sign)
    scale = column_scale(rows.T, labels)
    rows /= scale[:, None]
    condition = check_excitation(_triangular(rows), labels, MAX_CONDITION)
    y: FloatArray = np.asarray(np.linalg.solve(rows @ rows.T, rows @ b))
    if b.size > _COARSE:
        coarse = slice(None, None, b.size // _COARSE + 1)
        y, _ = _newton(rows[:, coarse], b[coarse], sign[coarse], weight, y)
    y, steps = _newton(rows, b, sign, weight, y)
    x = y / scale
    z = sign * (y @ rows - b)
    curvature = np.where(z > 0, weight, 1.0)
    scores = rows * (-sign * curvature * z)
    bandwidth = max(automatic_bandwidth(score, lengths) for score in scores)
    inverse = np.linalg.inv((rows * curvature) @ rows.T)
    meat = long_run_covariance(scores.T, bandwidth, lengths)
    covariance = inverse @ meat @ inverse / np.outer(scale, scale)
    half = critical_value_95(bandwidth, b.size) * np.sqrt(np.diag(covariance))
    return AsymmetricFit(
        names=labels,
        coefficients=x,
        residual=b - a @ x,
        cost=float(penalty(z, weight).sum()),
        over_estimated=float(np.mean(z > 0)),
        hac_covariance=covariance,
        ci95=np.stack([x - half, x + half], axis=1),
        condition_number=condition,
        steps=steps,
    )


def _triangular(rows: FloatArray) -> FloatArray:
    """R with RᵀR = rows rowsᵀ; from the samples themselves where the product is too ill-conditioned."""
    try:
        return np.asarray(np.linalg.cholesky(rows @ rows.T).T)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.qr(rows.T)[1])


def _newton(
    rows: FloatArray, goal: FloatArray, sign: FloatArray, weight: float, y: FloatArray
) -> tuple[FloatArray, int]:
    """Minimise from y; rows (p, T), goal and sign (T,). The minimiser and the steps taken."""
    error = y @ rows - goal
    for step in range(1, _MAX_STEPS + 1):
        curvature = np.where(sign * error > 0, weight, 1.0)
        weighted = curvature * error
        half_gradient = rows @ weighted
        cost = float(weighted @ error)
        direction = -np.linalg.solve((rows * curvature) @ rows.T, half_gradient)
        decrease = 2 * float(half_gradient @ direction)
        if -decrease <= 1e-15 * cost + 1e-300:
            return y, step
        along, length = direction @ rows, 1.0
        trial = error + along
        while penalty(sign * trial, weight).sum() > cost + 1e-4 * length * decrease:
            length *= 0.5
            if length < 1e-10:
                return y, step
            trial = error + length * along
        y, error = np.asarray(y + length * direction), trial
    raise IdentificationError(f"asymmetric fit did not come to rest in {_MAX_STEPS} Newton steps")


def _check_weight(weight: float) -> None:
    if not (np.isfinite(weight) and weight >= 1):
        raise IdentificationError(f"asymmetric weight must be finite and >= 1, got {weight:g}")


_MIN_POINTS = 3


@dataclass(frozen=True)
class ThreePieces:
    """f(τ) = o + k2 τ + (k3 − k2) max(τ − τ2, 0) − (k1 − k2) max(τ1 − τ, 0): continuous by construction.

    Attributes:
        breaks: (τ1, τ2), τ1 < τ2 [N·m].
        slopes: (k1, k2, k3) left, middle, right [effort/(N·m)].
        offset: o, the middle line's value at τ = 0 [effort].
        middle_at_bound: Whether the middle slope rests on a bound.
        rms: Of the residual [effort].
        converged: Whether the break points came to rest.
        rounds: Rounds of fitting and moving taken.
    """

    breaks: tuple[float, float]
    slopes: tuple[float, float, float]
    offset: float
    middle_at_bound: bool
    rms: float
    converged: bool = True
    rounds: int = 0

    def __call__(self, torque: FloatArray) -> FloatArray:
        """f(τ), (T,) [effort]."""
        x = np.array([self.offset, self.slopes[1], self.slopes[2], self.slopes[0]])
        x[2:] -= self.slopes[1]
        return np.asarray(_hinges(np.asarray(torque, dtype=np.float64), self.breaks) @ x)


@dataclass(frozen=True)
class PiecewiseFit:
    """Δq = f±(τ), one three-piece line for each sign of the velocity.

    Attributes:
        forward: For q̇ > 0.
        backward: For q̇ < 0.
    """

    forward: ThreePieces
    backward: ThreePieces

    def __call__(self, torque: FloatArray, velocity: FloatArray) -> FloatArray:
        """Effort (T,) at the torque [N·m] and velocity [rad/s]; the mean of both at zero velocity."""
        torque, velocity = np.asarray(torque, dtype=np.float64), np.asarray(velocity, dtype=np.float64)
        share = 0.5 * (1 + np.sign(velocity))
        return np.asarray(share * self.forward(torque) + (1 - share) * self.backward(torque))


def fit_three_pieces(
    torque: FloatArray,
    effort: FloatArray,
    *,
    breaks: tuple[float, float] = (-0.5, 0.5),
    middle_slope: tuple[float, float] = (0.0, np.inf),
    max_rounds: int = 10,
) -> ThreePieces:
    """Fit three lines to their own points, move the break points to the lines' intersections, until at rest.

    The middle line's slope is bounded. A last fit with the break points held makes the curve continuous also
    where they did not come to rest; a move that would leave a piece with fewer than 3 points, or cross the
    break points, is not made (`converged` is then False). Not convex: the start matters.

    Args:
        torque: τ (T,) [N·m].
        effort: Δq (T,) [effort].
        breaks: Start (τ1, τ2) [N·m].
        middle_slope: (lowest, highest) k2 [effort/(N·m)].
        max_rounds: At most this many moves.

    Raises:
        IdentificationError: Break points or bounds out of order, or a piece with too few points at the start.

    Source: Del Prete et al., 2016, section 3.3, which assumes that the rounds converge.

    Example:
        >>> torque = np.linspace(-4.0, 4.0, 161)
        >>> effort = 0.2 * torque + 0.3 * np.clip(torque, -1.0, 1.0)
        >>> fit = fit_three_pieces(torque, effort, breaks=(-1.0, 1.0))
        >>> np.round(fit.slopes, 6).tolist(), np.round(fit.breaks, 6).tolist()
        ([0.2, 0.5, 0.2], [-1.0, 1.0])
    """
    tau, y = np.asarray(torque, dtype=np.float64), np.asarray(effort, dtype=np.float64)
    if tau.shape != y.shape or tau.ndim != 1 or not (np.isfinite(tau).all() and np.isfinite(y).all()):
        raise IdentificationError(f"expected finite torque and effort (T,), got {tau.shape} and {y.shape}")
    if not (breaks[0] < breaks[1] and middle_slope[0] < middle_slope[1]):
        raise IdentificationError(f"break points and slope bounds must be rising, got {breaks}, {middle_slope}")
    if not _populated(tau, breaks):
        counts = [int(m.sum()) for m in _pieces(tau, breaks)]
        raise IdentificationError(
            f"excitation too poor: each piece needs {_MIN_POINTS} distinct torques; break points "
            f"{breaks[0]:g} and {breaks[1]:g} N·m leave {counts} samples"
        )
    converged, rounds = False, 0
    span = float(np.ptp(tau))
    while rounds < max_rounds and not converged:
        rounds += 1
        moved = _intersections(tau, y, breaks, middle_slope)
        if moved is None or not _populated(tau, moved):
            break
        step = max(abs(moved[0] - breaks[0]), abs(moved[1] - breaks[1]))
        breaks = moved
        converged = step <= 1e-9 * span
    return replace(_continuous(tau, y, breaks, middle_slope), converged=converged, rounds=rounds)


def fit_piecewise(
    torque: FloatArray,
    velocity: FloatArray,
    effort: FloatArray,
    *,
    breaks: tuple[float, float] = (-0.5, 0.5),
) -> PiecewiseFit:
    """Fit `fit_three_pieces` to the samples of each sign of the velocity; samples at rest are left out.

    Args:
        torque: τ (T,) [N·m].
        velocity: q̇ (T,) [rad/s].
        effort: Δq (T,) [effort].
        breaks: Start of the break points [N·m].

    Raises:
        IdentificationError: As `fit_three_pieces`.

    Example:
        >>> torque = np.tile(np.linspace(-4.0, 4.0, 161), 2)
        >>> velocity = np.repeat([1.0, -1.0], 161)
        >>> effort = 0.2 * torque + 0.3 * np.clip(torque, -1.0, 1.0) + 0.05 * velocity
        >>> fit = fit_piecewise(torque, velocity, effort, breaks=(-1.0, 1.0))
        >>> np.round(fit.forward.slopes, 6).tolist()
        [0.2, 0.5, 0.2]
    """
    return PiecewiseFit(
        *(fit_three_pieces(torque[way], effort[way], breaks=breaks) for way in (velocity > 0, velocity < 0))
    )


def _pieces(tau: FloatArray, breaks: tuple[float, float]) -> tuple[BoolArray, BoolArray, BoolArray]:
    return tau < breaks[0], (tau >= breaks[0]) & (tau <= breaks[1]), tau > breaks[1]


def _populated(tau: FloatArray, breaks: tuple[float, float]) -> bool:
    return all(np.unique(tau[piece]).size >= _MIN_POINTS for piece in _pieces(tau, breaks))


def _intersections(
    tau: FloatArray, y: FloatArray, breaks: tuple[float, float], middle: tuple[float, float]
) -> tuple[float, float] | None:
    free = (-np.inf, np.inf)
    lines = [
        _line(tau[piece], y[piece], bounds)
        for piece, bounds in zip(_pieces(tau, breaks), (free, middle, free), strict=True)
    ]
    crossings = []
    for (offset, slope), (next_offset, next_slope) in pairwise(lines):
        if abs(slope - next_slope) <= 1e-12 * max(abs(slope), abs(next_slope)):
            return None
        crossings.append((next_offset - offset) / (slope - next_slope))
    return (crossings[0], crossings[1]) if crossings[0] < crossings[1] else None


def _line(tau: FloatArray, y: FloatArray, bounds: tuple[float, float]) -> tuple[float, float]:
    """Offset and bounded slope: for one slope the bounded optimum is the clipped free one."""
    centred = tau - tau.mean()
    slope = float(np.clip(centred @ y / (centred @ centred), *bounds))
    return float(y.mean() - slope * tau.mean()), slope


def _hinges(tau: FloatArray, breaks: tuple[float, float]) -> FloatArray:
    right, left = np.maximum(tau - breaks[1], 0), -np.maximum(breaks[0] - tau, 0)
    return np.stack([np.ones_like(tau), tau, right, left], axis=1)


def _continuous(
    tau: FloatArray, y: FloatArray, breaks: tuple[float, float], middle: tuple[float, float]
) -> ThreePieces:
    """The best three pieces with these break points."""
    from scipy.optimize import lsq_linear

    a = _hinges(tau, breaks)
    lower, upper = np.full(4, -np.inf), np.full(4, np.inf)
    lower[1], upper[1] = middle
    q, r = np.linalg.qr(a)
    x = np.linalg.solve(r, q.T @ y)
    at_bound = not lower[1] <= x[1] <= upper[1]
    if at_bound:
        x = lsq_linear(r, q.T @ y, (lower, upper), method="bvls", tol=1e-14).x
    rms = float(np.sqrt(np.mean((y - a @ x) ** 2)))
    slopes = (float(x[1] + x[3]), float(x[1]), float(x[1] + x[2]))
    return ThreePieces(breaks, slopes, float(x[0]), at_bound, rms)
