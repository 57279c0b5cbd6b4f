"""What is left: could any function of the measured signals, or a stretch of time, still explain it?"""

from dataclasses import dataclass

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

from drake_tc.diagnosis.result import Side, TimeStretch, Unexplained
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import BoolArray, FloatArray, IntArray

MOST_ROWS = 12_000
GROUP_SECONDS = 1.5
MOST_WANDER = 0.5
"""Longest correlation time [s] of a residual in which a loud stretch is an event."""
SIGNALS = ("velocity", "acceleration", "position", "load_torque", "effort", "direction", "travel", "temperature")


@dataclass(frozen=True)
class StructureOptions:
    """When a remainder counts as structure; calibrated on simulated rigs that lack nothing.

    Attributes:
        least_fraction: Smallest share of the residual's variance that a function of the signals must explain.
        least_rms: Smallest RMS of that share, in noise floors.
        least_of_before: ... and as a share of the held-out error before.
        least_nats: Evidence of that share, in effective samples of what is left: noise that wanders has few.
        most_growth: How many times the training error the held-out one may be: beyond it the model does not carry over.
        least_growth: ... by at least this share of the held-out error before; so too for all that lies beyond the
            range of the training runs, for stretches and for lines.
        least_burst: How many times the typical half-second RMS a confined stretch must reach.
        least_line: Share of the residual's variance that one spectral line must hold.
    """

    least_fraction: float = 0.25
    least_rms: float = 0.6
    least_of_before: float = 0.05
    least_nats: float = 25.0
    most_growth: float = 2.5
    least_growth: float = 0.25
    least_burst: float = 3.0
    least_line: float = 0.25


def features(side: Side) -> FloatArray:
    """(N, 8) of the `SIGNALS` on the side's rows; an unrecorded signal is constant."""
    columns = [getattr(side.samples.signals, name)[side.samples.rows] for name in SIGNALS]
    return np.asarray(np.nan_to_num(np.stack(columns, axis=-1)))


def inside_range(train: FloatArray, held: FloatArray, margin: float = 0.05) -> BoolArray:
    """Held-out rows (M,) whose signals lie where the training rows (N, 8) have been.

    Beyond it the found effects extrapolate: an error there says how their curve goes on, not that a cause is missing.
    """
    low, high = train.min(axis=0), train.max(axis=0)
    slack = margin * (high - low)
    inside = np.all((held >= low - slack) & (held <= high + slack), axis=1)
    return np.asarray(inside)


def cross_predict(x: FloatArray, y: FloatArray, group: IntArray, seed: int, folds: int = 4) -> FloatArray:
    """Out-of-fold predictions (N,) of a gradient-boosted tree; samples of one group share a fold."""
    out = np.zeros_like(y)
    fold = np.random.default_rng(seed).permutation(int(group.max()) + 1)[group] % folds
    for f in range(folds):
        model = HistGradientBoostingRegressor(
            max_iter=80,
            learning_rate=0.12,
            max_leaf_nodes=24,
            min_samples_leaf=40,
            l2_regularization=1.0,
            random_state=seed,
        )
        held = fold == f
        if held.any() and (~held).sum() > 100:
            model.fit(x[~held], y[~held])
            out[held] = model.predict(x[held])
    return out


def share_explained(y: FloatArray, predicted: FloatArray) -> float:
    """1 - sum (y - yhat)^2 / sum (y - mean)^2, at least 0."""
    return max(0.0, 1.0 - float(np.sum((y - predicted) ** 2) / max(np.sum((y - y.mean()) ** 2), 1e-300)))


def spectral_line(side: Side) -> tuple[float, float]:
    """(frequency [Hz], share of the variance) of the strongest line in time of the residual, over all its runs.

    Periodogram of each run with zeros where there are no rows, 0.3-30 Hz, powers added (each run has its own phase).
    Four times the local median is taken off, so that coloured noise does not make a line.
    """
    samples = side.samples
    time = samples.signals.time[samples.rows]
    r = side.after - side.after.mean()
    step = samples.row_period
    runs = np.unique(samples.run)
    longest = max(float(np.ptp(time[samples.run == k])) for k in runs)
    size = 2 * int(longest / step) + 2
    power = np.zeros(size // 2 + 1)
    for k in runs:
        rows = samples.run == k
        slot = np.round((time[rows] - time[rows][0]) / step).astype(int)
        grid = np.bincount(slot, r[rows], size)[:size]
        power += 2.0 * np.abs(np.fft.rfft(grid, size)) ** 2 / max(int(rows.sum()), 1)
    frequency = np.fft.rfftfreq(size, step)
    share = power / max(float(np.sum(r**2)), 1e-300)
    share[(frequency < 0.3) | (frequency > 30.0)] = 0.0
    best = int(np.argmax(share))
    near = share[max(1, best - 120) : best + 120]
    return float(frequency[best]), float(share[best] - 4.0 * np.median(near[near > 0.0]))


def bursts(side: Side, ratio: float, least: float) -> tuple[TimeStretch, ...]:
    """Stretches of neighbouring half-second blocks whose residual RMS is `ratio` times the typical one or more.

    They count as confined when they are few, at most a quarter of the blocks, and when they hold most of the energy;
    `least` is the smallest RMS [effort] that matters.
    """
    samples = side.samples
    count = int(samples.block.max()) + 1
    rows = np.bincount(samples.block, minlength=count)
    level = np.sqrt(np.bincount(samples.block, side.after**2, count) / np.maximum(rows, 1))
    full = rows >= 0.3 * np.max(rows)
    if full.sum() < 8:
        return ()
    typical = float(np.median(level[full]))
    loud = full & (level > max(ratio * typical, least))
    quiet = ~loud[samples.block]
    if correlation_time(side.after[quiet] - side.after[quiet].mean()) * samples.row_period > MOST_WANDER:
        return ()  # noise that wanders this slowly makes loud stretches by itself
    energy = float(np.sum(level[loud] ** 2 * rows[loud]) / max(float(np.sum(level**2 * rows)), 1e-300))
    if not loud.any() or loud.sum() > 0.25 * full.sum() or energy < 0.4:
        return ()
    found: list[TimeStretch] = []
    time = samples.signals.time[samples.rows]
    for b in np.flatnonzero(loud):
        inside = samples.block == b
        run = samples.runs[int(samples.run[inside][0])]
        start, end = float(time[inside][0]), float(time[inside][-1])
        if found and found[-1].run == run and start - found[-1].end < 0.7:
            found[-1] = TimeStretch(run, found[-1].start, end)
        else:
            found.append(TimeStretch(run, start, end))
    return tuple(found)


def judge(train: Side, held: Side, floor: float, options: StructureOptions, seed: int = 0) -> Unexplained:
    """What is left of both sides after the final model, and whether it is more than noise."""
    sides = (train, held)
    x = np.concatenate([features(s) for s in sides])
    y = np.concatenate([s.after for s in sides])
    inside = inside_range(features(train), features(held))
    carried = inside.sum() >= max(300, 0.05 * inside.size)
    inside = inside if carried else np.ones_like(inside)
    is_held = np.concatenate([np.zeros(train.after.size, bool), inside])
    time = np.concatenate([s.samples.signals.time[s.samples.rows] for s in sides])
    run = np.concatenate([train.samples.run, held.samples.run + len(train.samples.runs)])
    stride = max(1, int(np.ceil(y.size / MOST_ROWS)))
    x, y, is_held, time, run = x[::stride], y[::stride], is_held[::stride], time[::stride], run[::stride]
    for side_rows in (run >= len(train.samples.runs), run < len(train.samples.runs)):
        spread = 3.0 * float(np.percentile(np.abs(y[side_rows]), 95.0))
        y[side_rows] = np.clip(y[side_rows], -spread, spread)
    group = np.unique(run * 10**6 + (time / GROUP_SECONDS).astype(int), return_inverse=True)[1]
    clock = np.stack([time, run.astype(float)], axis=-1)
    by_signals = cross_predict(x, y, group, seed)
    by_both = cross_predict(np.hstack([x, clock]), y, group, seed)
    by_time = cross_predict(clock, y, group, seed)
    signals_share = share_explained(y[is_held], by_signals[is_held])
    interplay = share_explained(y, by_both) - share_explained(y, by_time)
    fraction = max(signals_share, min(interplay, share_explained(y, by_both)))
    rms = float(np.sqrt(np.mean(held.after**2)))
    explained = np.sqrt(fraction) * float(np.std(y[is_held]))
    before = float(np.sqrt(np.mean(held.before**2)))
    least = max(options.least_rms * floor, options.least_of_before * before)
    lengths = [int(n) for n in np.bincount(run[is_held]) if n]
    left = y[is_held] - by_signals[is_held] if signals_share >= fraction else y[is_held] - by_both[is_held]
    whole = y[is_held] - y[is_held].mean()
    n_eff = left.size / max(correlation_time(part, lengths) for part in (left - left.mean(), whole))
    nats = -0.5 * n_eff * float(np.log(max(1.0 - fraction, 1e-9)))
    enough = least if carried else max(least, options.least_growth * before)
    functional = fraction >= options.least_fraction and explained >= enough and nats >= options.least_nats
    event = max(2.0 * least, 2.5 * floor, options.least_growth * before)
    stretches = tuple(s for side in sides for s in bursts(side, options.least_burst, event))
    frequency, line = max((spectral_line(s) for s in sides), key=lambda p: p[1])
    periodic = line >= options.least_line and np.sqrt(line) * rms >= event
    train_rms = float(np.sqrt(np.mean(train.after**2)))
    grown = (
        rms > options.most_growth * train_rms
        and rms - train_rms > max(least, options.least_growth * before)
        and not stretches
    )
    names: list[str] = []
    if functional or grown:
        names += depends_on(x, y, group, seed)
    if interplay > signals_share + 0.1 and functional:
        names.append("time")
    if (stretches or periodic) and "time" not in names:
        names.append("time")
    return Unexplained(
        fraction=float(fraction),
        structured=bool(functional or stretches or periodic or grown),
        depends_on=tuple(names),
        confined_to=stretches,
        period_hz=frequency if periodic else None,
        ceiling=float(rms * np.sqrt(max(0.0, 1.0 - signals_share))),
    )


def depends_on(x: FloatArray, y: FloatArray, group: IntArray, seed: int) -> list[str]:
    """Signals whose shuffling costs the flexible regressor at least 15 % of what the most important one costs."""
    rng = np.random.default_rng(seed)
    first = group % 2 == 0
    model = HistGradientBoostingRegressor(max_iter=80, learning_rate=0.12, min_samples_leaf=40, random_state=seed)
    model.fit(x[first], y[first])
    base = float(np.mean((y[~first] - model.predict(x[~first])) ** 2))
    cost = np.zeros(x.shape[1])
    for j in range(x.shape[1]):
        shuffled = x[~first].copy()
        shuffled[:, j] = rng.permutation(shuffled[:, j])
        cost[j] = float(np.mean((y[~first] - model.predict(shuffled)) ** 2)) - base
    order = [int(j) for j in np.argsort(-cost) if cost[j] > 0.15 * cost.max()]
    return [SIGNALS[j] for j in order if cost.max() > 0.0]
