"""A continuous three-piece line for each direction of motion (Del Prete et al., 2016, section 3)."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drake_tc.errors import IdentificationError
from drake_tc.types import BoolArray, FloatArray

_MIN_POINTS = 3


@dataclass(frozen=True)
class ThreePieces:
    """f(τ) = o + k2 τ + (k3 − k2) max(τ − τ2, 0) − (k1 − k2) max(τ1 − τ, 0): continuous by construction.

    Attributes:
        breaks: (τ1, τ2), τ1 < τ2 [N·m].
        slopes: (k1, k2, k3) left, middle, right [effort/(N·m)].
        offset: o, the middle line's value at τ = 0 [effort].
        converged: Whether the break points came to rest.
        rounds: Rounds of fitting and moving taken.
        middle_at_bound: Whether the middle slope rests on a bound.
        rms: Of the residual [effort].
    """

    breaks: tuple[float, float]
    slopes: tuple[float, float, float]
    offset: float
    converged: bool
    rounds: int
    middle_at_bound: bool
    rms: float

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
    return _continuous(tau, y, breaks, middle_slope, converged, rounds)


def fit_piecewise(
    torque: FloatArray,
    velocity: FloatArray,
    effort: FloatArray,
    *,
    breaks: tuple[float, float] = (-0.5, 0.5),
    middle_slope: tuple[float, float] = (0.0, np.inf),
) -> PiecewiseFit:
    """Fit `fit_three_pieces` to the samples of each sign of the velocity; samples at rest are left out.

    Args:
        torque: τ (T,) [N·m].
        velocity: q̇ (T,) [rad/s].
        effort: Δq (T,) [effort].
        breaks: Start of the break points [N·m].
        middle_slope: Bounds of the middle slope [effort/(N·m)].

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
    pieces = [
        fit_three_pieces(torque[way], effort[way], breaks=breaks, middle_slope=middle_slope)
        for way in (velocity > 0, velocity < 0)
    ]
    return PiecewiseFit(*pieces)


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
    tau: FloatArray,
    y: FloatArray,
    breaks: tuple[float, float],
    middle: tuple[float, float],
    converged: bool,
    rounds: int,
) -> ThreePieces:
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
    return ThreePieces(breaks, slopes, float(x[0]), converged, rounds, at_bound, rms)
