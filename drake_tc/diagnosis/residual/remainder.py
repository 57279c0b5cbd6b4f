"""The smooth part R of the residual of a joint whose verdict is `unexplained_structure`, and its share of the error.

With rows y = Psi c + e of the training runs, c ~ N(0, a^2), e ~ N(0, s^2), and l = s^2/a^2, the ridge l is the one of
the largest evidence (MacKay, 1992):

    log p(y | l) = -n/2 log s^2 - 1/2 sum_k log(1 + g_k/l) + constant,    s^2 = (y'y - y'Psi (Psi'Psi + l)^-1 Psi'y)/n

g_k are the eigenvalues of Psi'Psi. Neighbouring rows are correlated: of N rows, n = N `share` are independent. R
explains the share 1 - |y - R|^2/|y|^2 of the squared error of the held-out runs. Its interval is that of a bootstrap
over the runs, or over stretches of them if there are few runs.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from drake_tc.actuation.remainder import Remainder, features, nearest
from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.residual.unexplained import DataSplit
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray, IntArray

COUNT = 300
"""Number of features."""
SLOW = 0.1
"""Speed at which the direction turns over, as a share of the RMS speed."""
POINTS, COVERED = 60, 99.5
"""Points near which the rows lie, and share of the rows that lie within the radius [%]."""
LARGEST = 2.0
"""Largest standard deviation a of R before the rows, over the RMS of what is left: R is a part of it."""
DECADES = 12.0
"""Range in which the ridge is searched."""
LEAST_SHARE = 0.01
"""Least share of the squared error for which a remainder is kept."""
DRAWS, SEED = 1000, 0
"""Draws and seed of the bootstrap."""
FEWEST_RUNS, STRETCHES = 5, 20
"""Fewest held-out runs that the bootstrap draws whole; fewer runs are cut into this many stretches in total."""


@dataclass(frozen=True, eq=False)
class FoundRemainder:
    """The remainder of a joint.

    Attributes:
        model: Fitted to the training runs; it has the share and its interval.
        rms: Of its torque on the held-out runs [N m].
    """

    model: Remainder
    rms: float

    @property
    def holds(self) -> bool:
        """Whether the interval of its share lies above `LEAST_SHARE`; only then is it stored in a model file."""
        return self.model.share_ci95[0] > LEAST_SHARE


def remainder_of(train: DataSplit, held: DataSplit, gain: float) -> FoundRemainder:
    """Fit what is left of the training runs, and judge it on the held-out ones.

    Args:
        train: Rows of the training runs with their residual `after` [effort].
        held: The same of the held-out runs.
        gain: K [effort/(N m)] of the model after.
    """
    empty = _scaling(train.samples)
    design, target = _columns(empty, train.samples), train.after / gain
    left = target - design @ _ridge(design, target, target, 1.0)
    weights = _ridge(design, target, left, _independent(train.samples, left))
    largest = float(np.abs(design @ weights).max(initial=0.0))
    model = replace(empty, largest=largest, weights=weights)
    told = model.torque(*_on_rows(held.samples))
    share, interval = share_of(held.after / gain, told, _groups(held.samples))
    return FoundRemainder(replace(model, share=share, share_ci95=interval), rms(told))


def _scaling(samples: Samples) -> Remainder:
    """A remainder with zero weights and the scales of the rows."""
    s, rows = samples.signals, samples.rows
    slow = max(SLOW * rms(s.velocity[rows]), 1e-9)
    x = np.stack([s.position[rows], s.velocity[rows], np.tanh(s.velocity[rows] / slow), s.load_torque[rows]], axis=1)
    center, deviation = x.mean(axis=0), x.std(axis=0)
    scale = np.where(deviation > 1e-9 * np.maximum(np.abs(center), 1e-9), deviation, 1.0)
    z = (x - center) / scale
    points = _points(z)
    radius = float(np.percentile(nearest(z, points), COVERED))
    return Remainder(center, scale, points, radius, slow, 0.0, np.zeros(COUNT))


def _points(z: FloatArray) -> FloatArray:
    """(M, 4) rows of which each is the one farthest from those before it (Gonzalez, 1985)."""
    chosen = [z[int(np.argmin(np.sum(z**2, axis=1)))]]
    distance = nearest(z, np.array(chosen))
    while len(chosen) < min(POINTS, len(z)):
        chosen.append(z[int(np.argmax(distance))])
        distance = np.minimum(distance, nearest(z, chosen[-1][None, :]))
    return np.array(chosen)


def _on_rows(samples: Samples) -> tuple[FloatArray, FloatArray, FloatArray]:
    s, rows = samples.signals, samples.rows
    return s.position[rows], s.velocity[rows], s.load_torque[rows]


def _columns(model: Remainder, samples: Samples) -> FloatArray:
    """(N, K) features on the rows."""
    return features(model.scaled(*_on_rows(samples)), model.weights.size)


def _ridge(design: FloatArray, target: FloatArray, left: FloatArray, share: float) -> FloatArray:
    """(K,) weights at the ridge of the largest evidence; a `share` of the rows is independent, `left` bounds it."""
    values, turn = np.linalg.eigh(design.T @ design)
    values, moment = np.maximum(values, 1e-300), turn.T @ (design.T @ target)
    square, n = float(target @ target), max(share * target.size, 1.0)
    least = np.log10(max(float(left @ left), 1e-12 * square, 1e-300) / max(LARGEST**2 * square, 1e-300))

    def loss(exponent: float) -> float:
        ridge = 10.0**exponent
        rest = max(square - float(np.sum(moment**2 / (values + ridge))), 1e-12 * square)
        return 0.5 * n * float(np.log(rest)) + 0.5 * float(np.sum(np.log1p(values / ridge)))

    best = minimize_scalar(loss, bounds=(least, least + DECADES), method="bounded")
    return np.asarray(turn @ (moment / (values + 10.0 ** float(best.x))))


def _independent(samples: Samples, residual: FloatArray) -> float:
    """Share of the rows that are independent."""
    _, lengths = np.unique(samples.run, return_counts=True)
    return 1.0 / max(correlation_time(residual, lengths.tolist()), 1.0)


def _groups(samples: Samples) -> IntArray:
    """(N,) numbers of the runs, or of stretches of them where there are few."""
    if np.unique(samples.run).size >= FEWEST_RUNS:
        return samples.run
    return np.minimum(np.arange(samples.rows.size) * STRETCHES // max(samples.rows.size, 1), STRETCHES - 1)


def share_of(error: FloatArray, told: FloatArray, group: IntArray) -> tuple[float, tuple[float, float]]:
    """1 - |error - told|^2/|error|^2 with its 95 % interval by a bootstrap over groups (N,) of the rows."""
    numbers = np.unique(group)
    before = np.array([float(np.sum(error[group == k] ** 2)) for k in numbers])
    after = np.array([float(np.sum((error - told)[group == k] ** 2)) for k in numbers])
    drawn = np.random.default_rng(SEED).integers(numbers.size, size=(DRAWS, numbers.size))
    shares = 1.0 - after[drawn].sum(axis=1) / np.maximum(before[drawn].sum(axis=1), 1e-300)
    low, high = np.percentile(shares, [2.5, 97.5])
    return float(1.0 - after.sum() / max(before.sum(), 1e-300)), (float(low), float(high))
