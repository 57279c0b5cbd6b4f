"""The residual over time and frequency: loud stretches, lines, what is slow, and the band that the model explains.

In that band effort and motion tell of each other; above it neither can be a model of the other. Encoder errors, a
controller that answers them and a drive's own estimate of its torque fill the upper frequencies of a log with power
that the balance of motion and load cannot hold. With P_y the spectral density of the effort and P_r that of what the
final model leaves of it, both on the training rows,

    S(f) = 1 - P_r(f)/P_y(f)

is the share of the effort's power that the model explains at f. The band ends where S falls below one half for the
first time, smoothed over a third of an octave. Errors in the band are told beside those of the whole. Gaps between the
rows, at reversals, let some of the power above the limit leak below it: the errors in the band are upper bounds.
"""

import numpy as np

from drake_tc.diagnosis.data.noise_colour import spectral_density
from drake_tc.diagnosis.priors import LONGEST_CORRELATION, LOUD_ENERGY, LOUD_SHARE
from drake_tc.diagnosis.residual.unexplained import DataSplit, SharedBand, TimeStretch
from drake_tc.identification.autocorrelation import correlation_time
from drake_tc.types import FloatArray, IntArray

LEAST_SHARE = 0.5
LOWEST_HZ = 0.2
LEAST_LIMIT_HZ = 0.5
OCTAVES = 1.0 / 3.0


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


def shared_band(train: DataSplit, held: DataSplit) -> SharedBand | None:
    """The band that the training runs choose.

    None where the model explains the effort up to the end of the filters' band. Where it does not explain half of the
    effort's power even below half a hertz, there is no band: the limit is 0 and the errors are NaN.
    """
    samples = train.samples
    frequency, left = spectral_density(samples, train.after)
    effort = spectral_density(samples, samples.reduce(samples.signals.effort))[1]
    passed = frequency[np.abs(samples.light.gain(frequency) * samples.kernel.gain(frequency)) >= 0.1]
    edges = np.arange(np.log2(LOWEST_HZ), np.log2(max(passed.max(initial=0.0), 2.0 * LOWEST_HZ)), OCTAVES)
    for low, high in zip(2.0 ** edges[:-1], 2.0 ** edges[1:], strict=True):
        inside = (frequency >= low) & (frequency < high)
        if inside.any() and left[inside].sum() > (1.0 - LEAST_SHARE) * effort[inside].sum():
            limit = float(low)
            if limit < LEAST_LIMIT_HZ:
                return SharedBand(0.0, float("nan"), float("nan"))
            return SharedBand(limit, _below(train, limit), _below(held, limit))
    return None


def _below(split: DataSplit, limit: float) -> float:
    frequency, left = spectral_density(split.samples, split.after)
    inside = frequency <= limit
    mean = float(np.mean(split.after)) ** 2
    return float(np.sqrt(mean + np.sum(left[inside]) * (frequency[1] - frequency[0])))
