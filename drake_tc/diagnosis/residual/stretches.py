"""The residual over time: stretches in which it stands out, spectral lines in it, and what is slow."""

import numpy as np

from drake_tc.diagnosis.residual.unexplained import DataSplit, TimeStretch
from drake_tc.diagnosis.thresholds import LONGEST_CORRELATION, LOUD_ENERGY, LOUD_SHARE
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray, IntArray


def spectral_line(split: DataSplit) -> tuple[float, float]:
    """(frequency [Hz], share of the variance) of the strongest line in time of the residual, over all its runs.

    Periodogram of each run with zeros where there are no rows, 0.3-30 Hz, powers added (each run has its own phase).
    Four times the local median is taken off, so that coloured noise does not make a line.
    """
    samples = split.samples
    time = samples.signals.time[samples.rows]
    r = split.after - split.after.mean()
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
    near = near[near > 0.0]
    return float(frequency[best]), float(share[best] - 4.0 * np.median(near)) if near.size else 0.0


def slow_share(split: DataSplit, seconds: float) -> float:
    """Share of sum r^2 that the means of the two neighbouring pieces of `seconds` explain; at most 1.

        1 - sum (r_k - (m_(g-1) + m_(g+1))/2)^2 / sum r_k^2,   k in piece g of its run

    The mean of the residual counts: a level that only one run has is as slow as can be. At the end of a run, or beside
    a piece without rows, the other neighbour alone is taken.
    """
    samples, left = split.samples, split.after
    time = samples.signals.time[samples.rows]
    error = left.copy()
    for k in np.unique(samples.run):
        rows = samples.run == k
        piece = (time[rows] / seconds).astype(int) + 1
        size = int(piece.max()) + 2
        count = np.bincount(piece, minlength=size)
        mean = np.bincount(piece, left[rows], size) / np.maximum(count, 1)
        near = (count[:-2] > 0).astype(float) + (count[2:] > 0)
        around = np.zeros(size)
        around[1:-1] = (mean[:-2] + mean[2:]) / np.maximum(near, 1.0)
        error[rows] -= around[piece]
    return 1.0 - float(np.sum(error**2) / max(np.sum(left**2), 1e-300))


def loud_stretches(split: DataSplit, ratio: float, least: float) -> tuple[TimeStretch, ...]:
    """Stretches of neighbouring half-second blocks whose residual is `ratio` times the typical one or more.

    Both the RMS and the median of the absolute residual of a block must be that large: a few rows at a reversal, whose
    direction of motion is uncertain, make a block loud without anything having acted on the joint. Stretches count as
    confined when they are few, at most a quarter of the blocks, and hold most of the energy; `least` is the smallest
    RMS [effort] that matters.
    """
    samples = split.samples
    count = int(samples.block.max()) + 1
    rows = np.bincount(samples.block, minlength=count)
    level = np.sqrt(np.bincount(samples.block, split.after**2, count) / np.maximum(rows, 1))
    full = rows >= 0.3 * np.max(rows)
    if full.sum() < 8:
        return ()
    middle = _median_by_block(samples.block, np.abs(split.after), count)
    loud = full & (level > max(ratio * float(np.median(level[full])), least))
    loud &= middle > ratio * float(np.median(middle[full]))
    quiet = ~loud[samples.block]
    if not loud.any() or not quiet.any():
        return ()
    rest = split.after[quiet]
    if correlation_time(rest - rest.mean()) * samples.row_period > LONGEST_CORRELATION:
        return ()  # noise that wanders this slowly makes loud stretches by itself
    energy = float(np.sum(level[loud] ** 2 * rows[loud]) / max(float(np.sum(level**2 * rows)), 1e-300))
    if loud.sum() > LOUD_SHARE * full.sum() or energy < LOUD_ENERGY:
        return ()
    return _joined(split, np.flatnonzero(loud))


def _median_by_block(block: IntArray, values: FloatArray, count: int) -> FloatArray:
    """(B,) medians of the values (N,) of each block; 0 for a block without any."""
    order = np.lexsort((values, block))
    ends = np.cumsum(np.bincount(block, minlength=count))
    sizes = np.diff(np.concatenate([[0], ends]))
    at = np.minimum(ends - sizes + sizes // 2, values.size - 1)
    return np.where(sizes > 0, values[order][at], 0.0)


def _joined(split: DataSplit, blocks: IntArray) -> tuple[TimeStretch, ...]:
    """Neighbouring blocks as one stretch."""
    samples = split.samples
    time = samples.signals.time[samples.rows]
    found: list[TimeStretch] = []
    for b in blocks:
        inside = samples.block == b
        run = samples.runs[int(samples.run[inside][0])]
        start, end = float(time[inside][0]), float(time[inside][-1])
        if found and found[-1].run == run and start - found[-1].end < 0.7:
            found[-1] = TimeStretch(run, found[-1].start, end)
        else:
            found.append(TimeStretch(run, start, end))
    return tuple(found)
