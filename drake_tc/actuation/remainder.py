"""`Remainder`: torque that no effect of a joint's model explains, as a smooth function of motion and load.

    R(x) = d(z) clip(sum_k c_k psi_k(z), -m, m),    psi_k(z) = sqrt(2/K) cos(w_k'z + b_k)
    z    = ((q, v, tanh(v/v_s), tau) - center)/scale

psi are Fourier features of Gaussian kernels of one and two signals (Rahimi and Recht, 2007), w and b fixed. m is the
largest value on the rows that were fitted, and d falls from 1 to 0 outside of these rows, which lie within a radius r
of one of the points p_j:

    d(z) = exp(-(max(min_j |z - p_j| - r, 0)/`EDGE`)^2/2)

The effort of a joint with a remainder is K (tau + J qddot + sum theta phi + R). No controller adds it by itself.
"""

from dataclasses import dataclass, field
from functools import cache
from itertools import combinations

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.types import FloatArray

SIGNALS = ("position", "velocity", "direction", "load_torque")
"""What the function depends on, in this order."""
EDGE = 0.5
"""Standard deviation of the decay outside the range that was seen, in scaled signals."""
SUBSETS = tuple(subset for size in (1, 2) for subset in combinations(range(len(SIGNALS)), size))
"""Numbers of the signals on which a feature depends."""
LENGTHS = (2.0, 0.7)
"""Length scales of the features, in scaled signals; half of the features have each."""


@cache
def frequencies(count: int) -> tuple[FloatArray, FloatArray]:
    """(K, 4) w and (K,) b of K features: normal and uniform values at the points of a Halton sequence.

    A feature depends on one signal or on two (`SUBSETS`, in turn), so that R generalises from few runs.
    """
    from scipy.stats import norm, qmc

    turn = np.arange(count)
    points = qmc.Halton(len(SIGNALS) + 2, scramble=False).random(count // len(SUBSETS) + 2)[turn // len(SUBSETS) + 1]
    used = np.array([[i in subset for i in range(len(SIGNALS))] for subset in SUBSETS])[turn % len(SUBSETS)]
    lengths = np.where(points[:, -1] < 0.5, *LENGTHS)
    w: FloatArray = used * norm.ppf(points[:, : len(SIGNALS)]) / lengths[:, None]
    return w, 2.0 * np.pi * points[:, -2]


@dataclass(frozen=True, eq=False)
class Remainder:
    """The remainder of one joint.

    Attributes:
        center, scale: (4,) of the `SIGNALS`.
        points: (M, 4) scaled signals near which the rows lie that were fitted. radius: r.
        slow: v_s [rad/s].
        largest: m [N m].
        weights: (K,) c [N m].
        share, share_ci95: Share of the squared error of held-out runs that it explains, with its 95 % interval.

    Raises:
        ParamsError: sizes that do not agree, or numbers that are not possible.

    Example:
        >>> flat = Remainder(np.zeros(4), np.ones(4), np.zeros((1, 4)), 1.0, 0.1, 2.0, np.zeros(8))
        >>> flat.torque(np.zeros(3), np.zeros(3), np.zeros(3)).tolist()
        [0.0, 0.0, 0.0]
    """

    center: FloatArray
    scale: FloatArray
    points: FloatArray
    radius: float
    slow: float
    largest: float
    weights: FloatArray
    share: float = float("nan")
    share_ci95: tuple[float, float] = field(default=(float("nan"), float("nan")))

    def __post_init__(self) -> None:
        n = len(SIGNALS)
        for name in ("center", "scale", "points", "weights"):
            value = np.array(getattr(self, name), dtype=np.float64)
            fits = value.shape == (n,) if name in ("center", "scale") else value.ndim == (2 if name == "points" else 1)
            if not fits or (name == "points" and value.shape[1] != n) or not np.isfinite(value).all():
                raise ParamsError(f"remainder.{name}: expected finite numbers of {n} signals, got shape {value.shape}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if not (np.all(self.scale > 0.0) and self.slow > 0.0 and self.largest >= 0.0 and self.radius >= 0.0):
            raise ParamsError("remainder: expected scale > 0, slow > 0, largest >= 0 and radius >= 0")

    def torque(self, position: FloatArray, velocity: FloatArray, load_torque: FloatArray) -> FloatArray:
        """(T,) R [N m], resisting as friction does."""
        z = self.scaled(position, velocity, load_torque)
        inside = np.exp(-0.5 * (np.maximum(nearest(z, self.points) - self.radius, 0.0) / EDGE) ** 2)
        return np.asarray(inside * np.clip(features(z, self.weights.size) @ self.weights, -self.largest, self.largest))

    @property
    def rms(self) -> float:
        """RMS of R at the points [N m], which are spread evenly over the range of the data."""
        inside = np.clip(features(self.points, self.weights.size) @ self.weights, -self.largest, self.largest)
        return float(np.sqrt(np.mean(inside**2)))

    def scaled(self, position: FloatArray, velocity: FloatArray, load_torque: FloatArray) -> FloatArray:
        """(T, 4) z."""
        x = np.stack([position, velocity, np.tanh(velocity / self.slow), load_torque], axis=1)
        return np.asarray((x - self.center) / self.scale)


def nearest(z: FloatArray, points: FloatArray) -> FloatArray:
    """(T,) distance of scaled signals (T, 4) from the nearest of the points (M, 4)."""
    least = np.full(len(z), np.inf)
    for point in points:
        least = np.minimum(least, np.sum((z - point) ** 2, axis=1))
    return np.asarray(np.sqrt(least))


def features(z: FloatArray, count: int) -> FloatArray:
    """(T, K) psi of scaled signals (T, 4)."""
    w, b = frequencies(count)
    return np.asarray(np.sqrt(2.0 / count) * np.cos(z @ w.T + b))
