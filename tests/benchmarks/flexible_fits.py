"""How well any function of the recorded signals can predict a torque on a log that took no part in its fit.

Two figures bound what a model can reach, whatever its form:

- `evaluated_errors`: models from least squares on friction columns to gradient-boosted trees are fitted on some logs
  and evaluated on another one. The smallest of these errors is chosen in view of that log, so it is an optimistic
  bound.
- `repeatability`: rows of equal signals, at least a second apart, have torques y_a and y_b. A function of these signals
  gives both the same prediction, so the RMS of its error on such pairs is at least sqrt(E[(y_a - y_b)^2]/4); where the
  scatter about the best function is independent in both rows, it is sqrt(E[(y_a - y_b)^2]/2), which is returned.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from sklearn.ensemble import HistGradientBoostingRegressor

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.types import FloatArray

COLUMNS = (
    "offset",
    "current",
    "velocity",
    "direction",
    "loaded direction",
    "acceleration",
    "slip",
    "loaded slip",
    "i|i|",
)
PUBLISHED = "published"
LINEAR: Mapping[str, tuple[int, ...]] = {
    PUBLISHED: (0, 1, 6, 7, 8),
    "friction": (1, 2, 3),
    "load-dependent friction": (1, 2, 3, 4),
    "load-dependent friction, offset": (0, 1, 2, 3, 4),
    "load-dependent friction, inertia": (1, 2, 3, 4, 5),
    "all columns but the offset": (1, 2, 3, 4, 5, 6, 7, 8),
    "all columns": (0, 1, 2, 3, 4, 5, 6, 7, 8),
}
"""Names of least-squares fits, and the `COLUMNS` that they have; the published model of the AK80-9 bench is one."""
SIGNALS = ("current", "velocity", "acceleration", "direction", "position", "current rate", "jerk", "travel")
TREES: Mapping[str, int] = {"current, velocity, acceleration, direction": 4, "all signals": 8}
"""Names of boosted fits, and how many of the `SIGNALS` they see."""
BENEATH = "load-dependent friction, inertia"
"""The trees follow what this least-squares fit and the published one leave: trees do not extrapolate a slope."""
NEAR = np.array([0.3, 0.5, 5.0, 0.5])
"""Distance in current [A], velocity [rad/s], acceleration [rad/s^2] and direction up to which rows count as equal."""
LEAST_SECONDS = 1.0
NEIGHBOURS = 200


@dataclass(frozen=True)
class LogRows:
    """The rows of one log, all through the same filters.

    Attributes:
        torque: (N,) what is predicted [N m].
        columns: (N, 9) `COLUMNS`.
        signals: (N, 8) `SIGNALS`.
        time: (N,) [s].
    """

    torque: FloatArray
    columns: FloatArray
    signals: FloatArray
    time: FloatArray


def log_rows(samples: Samples) -> LogRows:
    """The rows of a joint with a measured torque.

    Args:
        samples: Of one log.
    """
    s = samples.signals
    slip = s.velocity / (0.1 + np.abs(s.velocity))
    fresh = (s.direction, np.abs(s.effort) * s.direction, slip, np.abs(s.effort) * slip, np.abs(s.effort) * s.effort)
    direction, loaded, slip, loaded_slip, squared = (samples.reduce(f, fresh=True) for f in fresh)
    current, velocity, acceleration = (samples.reduce(f) for f in (s.effort, s.velocity, s.acceleration))
    rates = [samples.reduce(np.gradient(f, s.period)) for f in (s.effort, s.acceleration)]
    place = [samples.reduce(f) for f in (s.position, s.travel)]
    plain = (np.ones_like(current), current, velocity, direction, loaded, acceleration, slip, loaded_slip, squared)
    seen = (current, velocity, acceleration, direction, place[0], *rates, place[1])
    return LogRows(
        samples.reduce(s.load_torque),
        np.stack(plain, axis=-1),
        np.stack(seen, axis=-1),
        s.time[samples.rows],
    )


def evaluated_errors(train: Sequence[LogRows], evaluated: LogRows) -> dict[str, float]:
    """RMS [N m] on a log of each kind of fit, by its name; `PUBLISHED` is the published model, fitted anew."""
    torque = np.concatenate([log.torque for log in train])
    seen = np.concatenate([log.signals for log in train])
    columns = np.concatenate([log.columns for log in train])
    out = {}
    for name, kept in LINEAR.items():
        features = columns[:, kept]
        theta = np.linalg.lstsq(features, torque, rcond=None)[0]
        left = evaluated.torque - evaluated.columns[:, kept] @ theta
        out[name] = _rms(left)
        for trees, count in TREES.items() if name in (PUBLISHED, BENEATH) else ():
            model = HistGradientBoostingRegressor(
                max_iter=150, learning_rate=0.06, max_leaf_nodes=16, min_samples_leaf=40, l2_regularization=1.0
            ).fit(seen[:, :count], torque - features @ theta)
            out[f"{name}, then trees of {trees}"] = _rms(left - model.predict(evaluated.signals[:, :count]))
    return out


def smallest(errors: Mapping[str, float], but: str = PUBLISHED) -> tuple[str, float]:
    """Name and RMS [N m] of the best fit other than the one that it is compared with."""
    name = min((key for key in errors if key != but), key=lambda key: errors[key])
    return name, errors[name]


def repeatability(log: LogRows, others: Sequence[LogRows] = ()) -> tuple[float, int]:
    """RMS difference [N m] of the torque in rows of equal signals, over the root of two, and the number of pairs.

    What is left of the differences in the signals is corrected with a least-squares fit of all columns. NaN without
    pairs.

    Args:
        log: Its rows are compared with their nearest neighbours ...
        others: ... in these logs; in the log itself, at least a second away, where there are none.
    """
    pool = list(others) or [log]
    torque, columns, near, time = (
        np.concatenate(parts)
        for parts in (
            [each.torque for each in pool],
            [each.columns for each in pool],
            [each.signals[:, :4] / NEAR for each in pool],
            [each.time for each in pool],
        )
    )
    distance, index = cKDTree(near).query(log.signals[:, :4] / NEAR, k=NEIGHBOURS, distance_upper_bound=1.0)
    valid = np.isfinite(distance)
    if not others:
        valid &= np.abs(time[np.minimum(index, time.size - 1)] - log.time[:, None]) > LEAST_SECONDS
    has = valid.any(axis=1)
    if not has.any():
        return float("nan"), 0
    nearest = index[has, np.argmax(valid[has], axis=1)]
    theta = np.linalg.lstsq(log.columns, log.torque, rcond=None)[0]
    difference = log.torque[has] - torque[nearest] - (log.columns[has] - columns[nearest]) @ theta
    return _rms(difference) / float(np.sqrt(2.0)), int(has.sum())


def offset_of(log: LogRows) -> float:
    """Constant torque [N m] of a log, beside gain, friction that depends on the load, and inertia."""
    kept = [0, *LINEAR[BENEATH]]
    return float(np.linalg.lstsq(log.columns[:, kept], log.torque, rcond=None)[0][0])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
