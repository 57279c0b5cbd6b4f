"""What is left of the residual: does it depend on recorded signals, or on a stretch of time?

Only signals whose own noise does not enter the residual may explain it. The residual holds the noise of the torque
channel and of the lightly filtered motion; a function of those two would find their noise in it and call it structure.
The features are therefore the motion after a kernel three times as wide, the command, and the load torque. With a
torque sensor, the load torque is the one that the model expects from the command and the motion. Otherwise the motion
alone tells the load, and the recorded effort minus load and friction is the residual itself, noise included: the load
torque is then that of the motion, and an effort (not a servo's goal) is no feature.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.diagnosis.data.samples import Samples, rms
from drake_tc.diagnosis.data.sliding import LEAST_ROWS
from drake_tc.diagnosis.priors import (
    LEAST_BURST,
    LEAST_FLOORS,
    LEAST_FRACTION,
    LEAST_GROWTH,
    LEAST_LINE,
    LEAST_LOG_EVIDENCE,
    LEAST_OF_BEFORE,
    LEAST_OF_SIGNAL,
    LEAST_RMS,
    LEAST_WANDER,
    MOST_FLOORS,
    MOST_GROWTH,
)
from drake_tc.diagnosis.problem.columns import BalanceCoefficients
from drake_tc.diagnosis.residual.over_time import loud_stretches, slow_share, spectral_line
from drake_tc.diagnosis.residual.unexplained import DataSplit, Unexplained
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingRegressor

MOST_ROWS = 12_000
GROUP_SECONDS = 1.5
WIDER = 3.0
"""Width of the features' kernel over the light kernel's."""
FEATURES = ("velocity", "acceleration", "position", "expected_torque", "command", "direction", "travel", "temperature")


def features(samples: Samples, known: BalanceCoefficients, *, servo: bool, load_measured: bool) -> FloatArray:
    """(N, 8) of the `FEATURES` on the rows; an unrecorded signal is constant.

    Args:
        samples: Of one split.
        known: 1/K, F_v and F_c of the final model.
        servo: Whether the effort is q_d - q.
        load_measured: Whether a torque sensor tells the load, not the motion.
    """
    s = samples.signals
    wide = CommonKernel(WIDER * samples.light.actual_width_s, s.period)
    q, v, a = (
        np.nan_to_num(f(s.position, samples.segments)) for f in (wide.smooth, wide.derivative, wide.second_derivative)
    )
    if load_measured:
        effort = s.command - q if servo else s.command
        friction = known.viscous * v + known.coulomb * s.direction
        expected = known.stiffness * effort - friction - s.rotor_inertia * a
    else:
        expected = np.nan_to_num(wide.smooth(s.load_torque, samples.segments))
    command = s.command if load_measured or servo else np.zeros_like(q)
    columns = (v, a, q, expected, command, s.direction, s.travel, s.temperature)
    return np.asarray(np.nan_to_num(np.stack([c[samples.rows] for c in columns], axis=-1)))


def beyond_range(train: FloatArray, held: FloatArray, margin: float = 0.05) -> BoolArray:
    """(M, k) where held-out signals (M, k) lie outside the range of the training rows (N, k), by a share of it."""
    low, high = train.min(axis=0), train.max(axis=0)
    slack = margin * (high - low)
    return np.asarray((held < low - slack) | (held > high + slack))


@dataclass(frozen=True, eq=False)
class _Rows:
    """Both splits' rows, thinned: features, clipped residual, run, time, group; which are held out and inside."""

    x: FloatArray
    y: FloatArray
    held: BoolArray
    run: IntArray
    clock: FloatArray
    group: IntArray
    carried: bool


def _rows(train: DataSplit, held: DataSplit, x: tuple[FloatArray, FloatArray]) -> _Rows:
    # beyond the trained range effects extrapolate: an error there says how their curve goes on, not what is missing
    inside = ~beyond_range(*x).any(axis=1)
    carried = bool(inside.sum() >= max(300, 0.05 * inside.size))
    inside = inside if carried else np.ones_like(inside)
    y = np.concatenate([s.after for s in (train, held)])
    is_held = np.concatenate([np.zeros(train.after.size, bool), inside])
    time = np.concatenate([s.samples.signals.time[s.samples.rows] for s in (train, held)])
    run = np.concatenate([train.samples.run, held.samples.run + len(train.samples.runs)])
    stride = max(1, int(np.ceil(y.size / MOST_ROWS)))
    thin = slice(None, None, stride)
    y, time, run = y[thin].copy(), time[thin], run[thin]
    for rows in (run >= len(train.samples.runs), run < len(train.samples.runs)):
        spread = 3.0 * float(np.percentile(np.abs(y[rows]), 95.0))
        y[rows] = np.clip(y[rows], -spread, spread)
    group = np.unique(run * 10**6 + (time / GROUP_SECONDS).astype(int), return_inverse=True)[1]
    clock = np.stack([time, run.astype(float)], axis=-1)
    return _Rows(np.concatenate(x)[thin], y, is_held[thin], run, clock, group, carried)


@dataclass(frozen=True)
class _Dependence:
    """What functions of signals and time explain.

    Attributes:
        fraction, rms: Largest share that takes signals, on held-out rows, and its RMS [effort].
        signals: Share that signals alone explain there.
        interplay: Share of all rows that signals and time together explain beyond time alone.
        log_evidence: Of `fraction`.
    """

    fraction: float
    rms: float
    signals: float
    interplay: float
    log_evidence: float


def _dependence(rows: _Rows, seed: int, executor: Executor | None) -> _Dependence:
    y, held, both_kinds = rows.y, rows.held, np.hstack([rows.x, rows.clock])
    by_signals, by_both, by_time = cross_predict((rows.x, both_kinds, rows.clock), y, rows.group, seed, executor)
    signals = share_explained(y[held], by_signals[held])
    both = share_explained(y, by_both)
    interplay = both - share_explained(y, by_time)
    fraction = max(signals, min(interplay, both))
    left = y[held] - (by_signals if signals >= fraction else by_both)[held]
    lengths = [int(n) for n in np.bincount(rows.run[held]) if n]
    whole = y[held] - y[held].mean()
    n_eff = left.size / max(correlation_time(part, lengths) for part in (left - left.mean(), whole))
    evidence = -0.5 * n_eff * float(np.log(max(1.0 - fraction, 1e-9)))
    rms = float(np.sqrt(fraction)) * float(np.std(y[held]))
    return _Dependence(float(fraction), rms, signals, interplay, evidence)


def _of_wandering_sensor(
    rows: _Rows,
    held: DataSplit,
    found: _Dependence,
    seed: int,
    executor: Executor | None,
) -> _Dependence | None:
    """The dependence that is left if a wandering sensor explains the held-out residual; None where it does not.

    A sensor that wanders leaves a slow function of time. Another signal that is as slow, a temperature, follows it by
    chance, so it speaks for structure only together with a faster one: friction that changes with the temperature
    changes its sign with the motion.
    """
    if slow_share(held, GROUP_SECONDS) < LEAST_WANDER or found.interplay >= LEAST_FRACTION:
        return None
    fast = rows.x[:, [name != "temperature" for name in FEATURES]]
    (by_fast,) = cross_predict((fast,), rows.y, rows.group, seed, executor)
    share = share_explained(rows.y[rows.held], by_fast[rows.held])
    return replace(found, fraction=share, signals=share) if share < LEAST_FRACTION else None


def assess_residual(
    train: DataSplit,
    held: DataSplit,
    x: tuple[FloatArray, FloatArray],
    floor: float,
    seed: int = 0,
    executor: Executor | None = None,
    *,
    least_of_before: float = LEAST_OF_BEFORE,
    sensor: bool = False,
) -> Unexplained:
    """What is left of both splits after the final model, and whether it is structure or simply more than noise.

    Args:
        train: Fitted rows. held: rows that took no part.
        held: The same of the held-out runs.
        x: Of each split, its `features`.
        floor: Noise floor [effort].
        seed: Of the folds.
        executor: Fits the regressors beside each other; None fits them here.
        least_of_before: As a share of the error before, what must be left to be flagged.
        sensor: Whether the load is that of a torque sensor, which may wander.
    """
    after, train_after = rms(held.after), rms(train.after)
    before = rms(held.before)
    effort = rms(held.weight * held.samples.signals.effort[held.samples.rows])
    floors = after / floor if floor > 0.0 else np.inf
    most = max(after, train_after) / floor if floor > 0.0 else np.inf
    rows = _rows(train, held, x)
    found = _dependence(rows, seed, executor)
    least = max(LEAST_RMS * floor, least_of_before * before)
    enough = max(least if rows.carried else max(least, LEAST_GROWTH * before), LEAST_OF_SIGNAL * effort)
    functional = found.fraction >= LEAST_FRACTION and found.rms >= enough and found.log_evidence >= LEAST_LOG_EVIDENCE
    event = max(2.0 * least, MOST_FLOORS * floor, LEAST_GROWTH * before)
    stretches = tuple(s for split in (train, held) for s in loud_stretches(split, LEAST_BURST, event))
    frequency, line = max((spectral_line(s) for s in (train, held)), key=lambda p: p[1])
    periodic = line >= LEAST_LINE and np.sqrt(line) * after >= event
    grown = (
        after > MOST_GROWTH * train_after and after - train_after > max(least, LEAST_GROWTH * before) and not stretches
    )
    structured = most >= LEAST_FLOORS and bool(functional or stretches or periodic or grown)
    if sensor and structured and not (stretches or periodic):
        wander = _of_wandering_sensor(rows, held, found, seed, executor)
        found, structured = wander or found, wander is None
    names = depends_on(rows.x, rows.y, rows.group, seed) if structured and (functional or grown) else []
    needs_time = found.interplay > found.signals + 0.1
    if structured and ((needs_time and functional) or stretches or periodic):
        names.append("time")
    return Unexplained(
        floors=float(floors),
        floors_anywhere=float(max(most, worst_rms(held) / floor if floor > 0.0 else np.inf)),
        excess=is_excess((train, held), (floor, floor), least_of_before),
        share_of_signal=after / max(effort, 1e-300),
        fraction=found.fraction,
        structured=structured,
        depends_on=tuple(names),
        confined_to=stretches if structured else (),
        period_hz=frequency if structured and periodic else None,
        explainable_rms=float(after * np.sqrt(max(0.0, 1.0 - found.signals))),
    )


def is_excess(splits: Sequence[DataSplit], floors: Sequence[float], least_of_before: float) -> bool:
    """Whether the training runs, the held-out runs, or one of the latter have more left than noise: more than the
    noise floor, and more than a remainder of what the model explains, which an effect's imperfect form leaves.
    """
    train, held = splits
    parts = [(train, slice(None), floors[0]), *((held, rows, floors[1]) for rows in parts_of(held))]
    for split, rows, floor in parts:
        after, before = rms(split.after[rows]), rms(split.before[rows])
        if after > MOST_FLOORS * floor and after > least_of_before * before:
            return True
    return False


def parts_of(held: DataSplit) -> list[slice | BoolArray]:
    """Rows of all held-out runs together, and of each that has those of a regression."""
    each = [held.samples.run == number for number in np.unique(held.samples.run)]
    return [slice(None), *(rows for rows in each if np.count_nonzero(rows) >= LEAST_ROWS)]


def worst_rms(held: DataSplit) -> float:
    """Largest RMS after [effort] of all held-out runs together and of each: quiet ones do not excuse a loud one."""
    return max(rms(held.after[rows]) for rows in parts_of(held))


def depends_on(x: FloatArray, y: FloatArray, group: IntArray, seed: int) -> list[str]:
    """Signals whose shuffling costs the flexible regressor at least 15 % of what the most important one costs."""
    rng = np.random.default_rng(seed)
    first = group % 2 == 0
    with threadpool_limits(1):
        model = trees(seed).fit(x[first], y[first])
    base = float(np.mean((y[~first] - model.predict(x[~first])) ** 2))
    cost = np.zeros(x.shape[1])
    for j in range(x.shape[1]):
        shuffled = x[~first].copy()
        shuffled[:, j] = rng.permutation(shuffled[:, j])
        cost[j] = float(np.mean((y[~first] - model.predict(shuffled)) ** 2)) - base
    order = [int(j) for j in np.argsort(-cost) if cost[j] > 0.15 * cost.max()]
    return [FEATURES[j] for j in order if cost.max() > 0.0]


def cross_predict(
    features: Sequence[FloatArray],
    y: FloatArray,
    group: IntArray,
    seed: int,
    executor: Executor | None = None,
    folds: int = 4,
) -> list[FloatArray]:
    """Out-of-fold predictions (N,) of gradient-boosted trees from each set of features (N, k)."""
    fold = np.random.default_rng(seed).permutation(int(group.max()) + 1)[group] % folds
    held = [rows for f in range(folds) if (rows := fold == f).any() and (~rows).sum() > 100]
    jobs = [(x[~rows], y[~rows], x[rows], seed) for x in features for rows in held]
    made: Iterator[FloatArray] = map(_predicted, jobs) if executor is None else executor.map(_predicted, jobs)
    out = [np.zeros_like(y) for _ in features]
    for each in out:
        for rows in held:
            each[rows] = next(made)
    return out


def _predicted(job: tuple[FloatArray, FloatArray, FloatArray, int]) -> FloatArray:
    """Trees of features (N, k) and values (N,), at other features (M, k): (M,)."""
    x, y, there, seed = job
    model = trees(seed, max_leaf_nodes=24, l2_regularization=1.0)
    with threadpool_limits(1):
        return np.asarray(model.fit(x, y).predict(there))


def trees(seed: int, **more: float) -> "HistGradientBoostingRegressor":
    """The regressor; `more` of its options."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(
        max_iter=80, learning_rate=0.12, min_samples_leaf=40, random_state=seed, **more
    )


def share_explained(y: FloatArray, predicted: FloatArray) -> float:
    """1 - sum (y - yhat)^2 / sum (y - mean)^2, at least 0."""
    return max(0.0, 1.0 - float(np.sum((y - predicted) ** 2) / max(np.sum((y - y.mean()) ** 2), 1e-300)))
