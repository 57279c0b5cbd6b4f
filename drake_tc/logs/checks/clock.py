"""The clock of a log: its instants, its period, and a uniform grid over each stretch, or what cannot be mended.

A table may join several clocks, each row with the columns of one sender, and a file may state its period beside its
arrays (`hz: 50`, `dt: 0.02`).

A logger that samples on a steady clock and stamps the rows late, by its own scheduling, writes stamps t_i that
scatter about the true instants. A logger that samples unsteadily and stamps at once writes true stamps. With a smooth
curve s_i through the stamps, the instants are

    tau_i = s_i + lambda (t_i - s_i),

where lambda is 0 for the first logger and 1 for the second. The positions tell it: over the rows, a smooth motion
q(tau) has the roughness H q = lambda H (v (t - s)) + noise, where H is 1 minus the cubic Savitzky-Golay smoothing over
11 rows, and v the velocity. Least squares over all joints give lambda and its standard error.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.signal import savgol_filter

from drake_tc.errors import LogError
from drake_tc.logs.columns import RawLog, file_row
from drake_tc.logs.names import meaning, time_among, words
from drake_tc.logs.record import MIN_ROWS
from drake_tc.logs.rig import Rig
from drake_tc.logs.units import TIME
from drake_tc.types import BoolArray, FloatArray, IntArray

ROUGH_ROWS, ORDER = 11, 3
"""Rows and order of the smoothing whose remainder is the roughness."""
SMOOTH_ROWS = 201
"""Rows over which the stamps of a steady clock are fitted by a line."""
LEVEL_ROWS = 25
"""Rows on either side of a lost row that show the step in the stamps."""
LEAST_SCATTER = 0.02
"""Scatter of the stamps in periods below which it does not matter."""
LARGEST_ERROR = 0.1
"""Standard error of lambda up to which the positions tell it."""
MOSTLY_NOISE = 0.5
"""Lambda below which, by three standard errors, the scatter is noise of the stamps."""
OUT_OF_ORDER = 10.0
"""Step backwards, over the median scatter of the stamps, that is none of it: about five of its standard deviations."""
GAP = 5.0
"""Steps of time in periods that begin another stretch."""


class Instants(NamedTuple):
    """Times of the rows, and a note where they are not the stamps.

    Attributes:
        time: (T,) [s].
        notes: One sentence, or none.
    """

    time: FloatArray
    notes: tuple[str, ...] = ()


class _Stretch(NamedTuple):
    """Rows between gaps.

    Attributes:
        rows: Their numbers (N,).
        smooth: (N,) instants of a steady clock [s].
        steady: (N,) whether the rows near a sample are complete.
    """

    rows: IntArray
    smooth: FloatArray
    steady: BoolArray


def sampling_instants(time: FloatArray, positions: Sequence[FloatArray], others: Sequence[FloatArray] = ()) -> Instants:
    """The instants of the samples: a smooth clock where the stamps scatter about it and the motion does not.

    Rows that repeat the stamp and all values of the row before keep its time. Where rows are out of order, the stamps
    are returned as they are.

    Args:
        time: (T,) stamps [s], NaN where there is none.
        positions: (T,) of each joint.
        others: (T,) of each further channel.
    """
    known = np.isfinite(time)
    channels = [q for q in positions if np.isfinite(q[known]).all() and np.ptp(q[known]) > 0.0]
    repeats = np.diff(time[known], prepend=np.nan) == 0.0
    for values in (*positions, *others) if repeats.any() else ():
        repeats &= ~(np.diff(values[known], prepend=np.nan) != 0.0)
    if not channels or known.sum() - repeats.sum() < 2 * SMOOTH_ROWS:
        return Instants(time)
    index = np.flatnonzero(known)[~repeats]
    stamps = time[index]
    period = (stamps[-1] - stamps[0]) / (stamps.size - 1)
    steps = np.diff(stamps)
    period = float(np.median(steps[np.abs(steps) < GAP * period])) if period > 0.0 else 0.0
    if period <= 0.0 or float(steps.min()) < -GAP * period:
        return Instants(time)
    stretches = list(_stretches(stamps, period))
    away = np.concatenate([stamps[s.rows] - s.smooth for s in stretches]) if stretches else np.zeros(0)
    if away.size < 0.5 * stamps.size or float(steps.min()) < -OUT_OF_ORDER * float(np.median(np.abs(away))):
        return Instants(time)  # rows that are out of order are no scatter
    if not LEAST_SCATTER * period < float(away.std()) < float(steps.std()):
        return Instants(time)  # independent scatter is 0.7 of that of the steps; a clock whose rate changes has more
    share, error = _share(stamps, [q[index] for q in channels], stretches, period)
    if error > LARGEST_ERROR or share + 3.0 * error > MOSTLY_NOISE:
        return Instants(time)
    instants = stamps.copy()
    for s in stretches:
        instants[s.rows] = s.smooth + max(share, 0.0) * (stamps[s.rows] - s.smooth)
    if np.any(np.diff(instants) <= 0.0):
        return Instants(time)
    result = time.copy()
    result[index] = instants
    for row in np.flatnonzero(known)[repeats].tolist():
        result[row] = result[row - 1]
    note = (
        f"The time stamps scatter by {1e3 * float(away.std()):.3g} ms RMS about a steady clock. The positions are"
        " smooth on that clock and not on the stamps, so the times of the clock were used."
    )
    return Instants(result, (note,))


def _stretches(stamps: FloatArray, period: float) -> Iterator[_Stretch]:
    """The stretches between gaps that are long enough, with the instants of a steady clock."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(stamps) > GAP * period) + 1, [stamps.size]])
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if last - first < SMOOTH_ROWS:
            continue
        own = stamps[first:last]
        number, steady = _row_numbers(own, period)
        slope, start = np.polyfit(number, own, 1)
        line = start + slope * number
        yield _Stretch(np.arange(first, last), line + savgol_filter(own - line, SMOOTH_ROWS, 1), steady)


def _row_numbers(stamps: FloatArray, period: float) -> tuple[FloatArray, BoolArray]:
    """Numbers (N,) of the rows, counting those that were lost, and where none was lost nearby (N,).

    A lost row raises the level of all later stamps by a period. Means over `LEVEL_ROWS`, without single stamps that are
    far off, see the step through the scatter, and least squares find its row.
    """
    rows = np.arange(stamps.size, dtype=np.float64)
    above = stamps - np.polyfit(rows, stamps, 1)[0] * rows
    middle = median_filter(above, LEVEL_ROWS, mode="nearest")
    level = uniform_filter1d(np.clip(above, middle - 2.0 * period, middle + 2.0 * period), LEVEL_ROWS, mode="nearest")
    half = LEVEL_ROWS // 2 + 1
    rise = np.zeros(stamps.size)
    rise[half:-half] = level[2 * half :] - level[: -2 * half]
    lost: FloatArray = np.zeros(stamps.size)
    steady: BoolArray = np.ones(stamps.size, dtype=bool)
    edges = np.flatnonzero(np.diff((rise > 0.5 * period).astype(np.int8)))
    for begin, end in zip((edges[::2] + 1).tolist(), (edges[1::2] + 1).tolist(), strict=True):
        first, last = max(0, begin - half), min(stamps.size, end + half)
        size = period * max(1.0, np.round(rise[begin:end].max() / period))
        near = above[first:last] - level[max(0, first - half)]
        at = first + int(np.argmax(np.cumsum((near - size) ** 2 - near**2))) + 1
        lost[min(at, stamps.size - 1)] = size / period
        steady[max(0, at - ROUGH_ROWS) : at + ROUGH_ROWS] = False
    return np.asarray(rows + np.cumsum(lost), dtype=np.float64), steady


def _share(
    stamps: FloatArray, positions: Sequence[FloatArray], stretches: Sequence[_Stretch], period: float
) -> tuple[float, float]:
    """Lambda and its standard error, by least squares weighted with each joint's noise."""
    information, total = 0.0, 0.0
    for q in positions:
        x, y = np.zeros(0), np.zeros(0)
        for s in stretches:
            own = q[s.rows]
            velocity = savgol_filter(own, ROUGH_ROWS, ORDER, deriv=1, delta=period)
            x = np.append(x, _rough(velocity * (stamps[s.rows] - s.smooth))[s.steady])
            y = np.append(y, _rough(own)[s.steady])
        square = float(x @ x)
        if square == 0.0:
            continue
        own_share = float(x @ y) / square
        noise = float(np.mean((y - own_share * x) ** 2)) + 1e-12 * float(np.mean(x**2))
        information += square / noise
        total += float(x @ y) / noise
    if information == 0.0:
        return 1.0, np.inf
    return total / information, float(information**-0.5)


def _rough(values: FloatArray) -> FloatArray:
    return np.asarray(values - savgol_filter(values, ROUGH_ROWS, ORDER))


GAP_PERIODS = 5.0
LONGEST_PERIOD = 0.15
SHORTEST_PERIOD = 5e-5
UNSTEADY = 0.05
"""Scatter of the steps in periods from which rounding a step does not tell how many rows were lost."""
SLOPE_ROWS, SLOPE_ORDER = 11, 3
"""Grid samples and order of the polynomial by which a row is carried to a grid sample near it."""
NEAR = 0.75
"""Distance in periods up to which a row stands for a grid sample."""
JUMP = 6.0
"""Distance from the linear interpolation, over its median, above which a row is beside a jump and not carried."""


@dataclass(frozen=True)
class Clock:
    """A uniform grid over the rows of a log, one block between gaps.

    Attributes:
        period: [s].
        raw_time: (T,) time of the rows [s], snapped to the grid where they lie on it.
        time: (N,) the grid [s], strictly increasing.
        block: (N,) number of the block of each grid sample.
        notes: One sentence for each thing found.
        row: (N,) the row nearest to each grid sample.
    """

    period: float
    raw_time: FloatArray
    time: FloatArray
    block: IntArray
    notes: tuple[str, ...]
    row: IntArray

    def resample(self, values: FloatArray, *, held: bool = False) -> FloatArray:
        """Values (T,) of the rows, on the grid (N,), interpolated linearly.

        A measurement is that of the nearest row, carried on by the slope and the curvature there: its noise stays as
        large and as white as it is, where an interpolation smooths it. Between rows that are far apart, and beside
        jumps, it is interpolated linearly too.

        Args:
            values: (T,).
            held: Whether they are a command, which has no noise and may have steps.
        """
        if self.time.size == self.raw_time.size and np.array_equal(self.time, self.raw_time):
            return values
        between = np.interp(self.time, self.raw_time, values)
        away = self.time - self.raw_time[self.row]
        if held or not np.any(away):
            return between
        slope, curvature = (self._derivative(between, order) for order in (1, 2))
        change = values[self.row] + (slope - 0.5 * curvature * away) * away - between
        size = np.abs(change)
        carried = (np.abs(away) < NEAR * self.period) & (size <= JUMP * float(np.median(size)))
        return np.where(carried, between + change, between)

    def _derivative(self, values: FloatArray, order: int) -> FloatArray:
        """Of values on the grid (N,); 0 in blocks that are too short for it."""
        out = np.zeros(values.size)
        edges = np.concatenate([[0], np.flatnonzero(np.diff(self.block)) + 1, [values.size]])
        for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            if last - first >= SLOPE_ROWS:
                out[first:last] = savgol_filter(
                    values[first:last], SLOPE_ROWS, SLOPE_ORDER, deriv=order, delta=self.period
                )
        return out

    def resample_mask(self, mask: BoolArray) -> BoolArray:
        """A grid sample is masked when a row that it is made from is."""
        if not mask.any():
            return np.zeros(self.time.size, dtype=bool)
        return np.asarray(np.interp(self.time, self.raw_time, mask.astype(np.float64)) > 1e-9)


def rows_in_order(time: FloatArray, path: Path) -> tuple[BoolArray, tuple[str, ...]]:
    """Which rows to keep, (T,): those with a time of their own.

    Rows without a time are left out (up to one in twenty), rows that repeat the time of the one before are dropped.

    Raises:
        LogError: Too few rows, too many without a time, or time that goes backwards (names the row).
    """
    valid = np.isfinite(time)
    lost = int(time.size - valid.sum())
    notes = []
    if lost > max(1, time.size // 20):
        first = int(np.flatnonzero(~valid)[0])
        raise LogError(
            f"{path}: column 'time' has no value in {lost} rows, first in {file_row(path, first)}; "
            "log a time stamp a row"
        )
    if lost:
        notes.append(f"{lost} rows without a time stamp were left out.")
    index = np.flatnonzero(valid)
    steps = np.diff(time[index])
    back = np.flatnonzero(steps < 0)
    if back.size:
        row = int(index[back[0] + 1])
        before, now = time[index[back[0]]], time[row]
        what = "the clock was reset or runs were joined" if now < before - 1.0 else "rows are out of order"
        raise LogError(
            f"{path}: time goes backwards at {file_row(path, row)}, from {before:.9g} s to {now:.9g} s: {what}; "
            "split the file there or sort its rows"
        )
    same = np.concatenate([[False], steps == 0])
    _refuse_constant(time[index], same, path)
    keep = valid.copy()
    keep[index[same]] = False
    if same.any():
        row = int(index[same][0])
        notes.append(f"{int(same.sum())} rows that repeat a time stamp were dropped, the first of them row {row + 1}.")
    if int(keep.sum()) < MIN_ROWS:
        raise LogError(
            f"{path}: only {int(keep.sum())} usable rows; at least {MIN_ROWS} are needed, a few seconds of motion"
        )
    return keep, tuple(notes)


def _refuse_constant(time: FloatArray, same: BoolArray, path: Path) -> None:
    """Refuse times (T,) of which too few differ from the one before."""
    changes = int((~same[1:]).sum())
    if changes + 1 < MIN_ROWS <= time.size:
        what = f"changes in {changes} of {time.size} rows only" if changes else f"is constant ({time[0]:.9g} s)"
        raise LogError(
            f"{path}: column 'time' {what}; expected a time stamp that increases from row to row:"
            " map the column that holds it, or write stamps with more digits"
        )


def _period(steps: FloatArray, path: Path, unit: float) -> float:
    """Sampling period [s]: the median step, refined by a line through all so that rounded stamps do not bias it."""
    median = float(np.median(steps))
    if not SHORTEST_PERIOD <= median <= LONGEST_PERIOD:
        fits = [name for name, each in TIME.items() if SHORTEST_PERIOD <= median / unit * each <= LONGEST_PERIOD]
        hint = f"it looks like {fits[0]}: set units: {{time: {fits[0]}}}" if fits else "check its unit"
        raise LogError(
            f"{path}: column 'time' has a median step of {median:.6g} s, expected {SHORTEST_PERIOD:g} to "
            f"{LONGEST_PERIOD:g} s; {hint}"
        )
    near = steps[steps < GAP_PERIODS * median]
    at = np.cumsum(near)
    place = _places(at, median)
    place, at = place - place.mean(), at - at.mean()
    refined = float(place @ at / (place @ place))  # slope of time over the place in the sequence
    best = refined if 1e-6 * median < abs(refined - median) < 0.2 * median else median
    return float(f"{best:.9g}")


def _places(at: FloatArray, period: float) -> FloatArray:
    """Places (N,) in the sequence of rows at times (N,) without gaps, counting those that were lost."""
    steps = np.diff(at)
    whole = np.maximum(np.rint(steps / period), 1.0)
    if at.size < SMOOTH_ROWS or float(np.std(steps - whole * period)) < UNSTEADY * period:
        return np.concatenate([[0.0], np.cumsum(whole)])
    return _row_numbers(at, period)[0]


def _resolution(time: FloatArray) -> float:
    """Decimal step in which the time stamps are written [s], 0 when there is none above a microsecond."""
    for step in (1e-3, 1e-4, 1e-5, 1e-6):
        ticks = (time - time[0]) / step
        if np.all(np.abs(ticks - np.rint(ticks)) < 1e-3):
            return step
    return 0.0


def uniform_clock(
    time: FloatArray, enabled: BoolArray, path: Path, stepped: BoolArray | None = None, unit: float = 1.0
) -> Clock:
    """Lay a uniform grid over strictly increasing times (T,).

    The period is that of the rows with the drive on. A step above 5 periods is a gap and starts a new block; shorter
    holes are lost rows, to be interpolated. Rows that lie on the grid within 2 % of a period (or within the rounding
    of the time stamps) are put on it exactly, so that an undisturbed log passes through unchanged. Steps (T - 1,) that
    are `stepped` start a new block, too. `unit` is that of the file's time [s], for the message.

    Raises:
        LogError: A period that makes no sense in seconds.
    """
    steps = np.diff(time)
    on = enabled[1:] & enabled[:-1]
    stepped = np.zeros(steps.size, dtype=bool) if stepped is None else stepped
    right = on & ~stepped
    period = _period(steps[right if int(right.sum()) >= MIN_ROWS else ~stepped], path, unit)
    apart = (steps > GAP_PERIODS * period) | stepped
    edges = np.concatenate([[0], np.flatnonzero(apart) + 1, [time.size]])
    slack = max(0.02 * period, 0.6 * _resolution(time[:: max(1, time.size // 20000)]))
    if slack > 0.3 * period:
        slack = 0.02 * period
    snapped, grids, blocks, lost, worst = time.copy(), [], [], 0, 0.0
    for number, (first, last) in enumerate(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)):
        own = time[first:last]
        index = np.rint((own - own[0]) / period)
        off = own - own[0] - index * period
        shift = float(np.median(off)) if slack > 0.02 * period else 0.0
        off -= shift
        if own.size > 1 and np.abs(off).max() <= slack and np.all(np.diff(index) >= 1):
            snapped[first:last] = own[0] + shift + index * period
            lost += int(index[-1]) + 1 - own.size
            grid = own[0] + shift + np.arange(int(index[-1]) + 1) * period
        else:
            worst = max(worst, float(np.abs(np.diff(own) - period).max(initial=0.0)))
            lost += max(0, int(_places(own, period)[-1]) + 1 - own.size)
            grid = own[0] + np.arange(int((own[-1] - own[0]) / period + 1e-6) + 1) * period
        grids.append(grid)
        blocks.append(np.full(grid.size, number, dtype=np.int64))
    notes = _notes(steps[~apart], period, lost=lost, worst=worst)
    if stepped.any():
        first = int(np.flatnonzero(stepped)[0])
        notes += (
            f"The clock steps by {1e3 * steps[first]:.4g} ms at {time[first]:.6g} s although the joints moved on by one"
            f" period ({int(stepped.sum())} such step{'s' if stepped.sum() > 1 else ''}); the run was split there.",
        )
    gaps = steps[steps > GAP_PERIODS * period]
    if gaps.size:
        at = time[int(np.argmax(steps > GAP_PERIODS * period))]
        notes += (
            f"{gaps.size} gap{'s' if gaps.size > 1 else ''} of more than {GAP_PERIODS:g} periods split the run "
            f"(the longest {gaps.max():.4g} s, the first at {at:.6g} s).",
        )
    grid = np.concatenate(grids)
    after = np.clip(np.searchsorted(snapped, grid), 1, snapped.size - 1)
    row = after - (grid - snapped[after - 1] < snapped[after] - grid)
    return Clock(period, snapped, grid, np.concatenate(blocks), notes, row)


def _notes(steps: FloatArray, period: float, *, lost: int, worst: float) -> tuple[str, ...]:
    notes: tuple[str, ...] = ()
    if worst > 0.0:
        notes += (
            f"The clock jitters: steps differ from the period of {1e3 * period:.4g} ms by "
            f"{1e3 * steps.std():.3g} ms RMS, {1e3 * worst:.3g} ms at most; all channels were brought "
            "to a uniform clock.",
        )
    if lost > 0:
        notes += (f"{lost} lost rows in short holes of the clock were filled by linear interpolation.",)
    return notes


MOST_TOGETHER = 0.5
"""Share of the rows with a position in which the other columns of the balance have values, too: below, they are on
clocks of their own, and not channels with missing values."""
LONGEST_HOLE = 2.5
"""Usual spacings of a column up to which it is interpolated."""
HELD = ("position_command", "voltage")
"""Commands keep their value until the next one."""


def on_rows_of_positions(raw: RawLog, rig: Rig) -> RawLog:
    """The log on the rows that have all positions, if the other columns of the balance have values in other rows.

    Measurements are interpolated linearly between their own samples, commands held. What lies outside, or in holes of
    more than 2.5 usual spacings, is missing (NaN). Without this, the position would be interpolated at the rows of the
    others: its noise and its steps would look smaller, and its rate higher, than they are.
    """
    motion = [f"{j}/{'velocity' if j in raw.speed_only else 'position'}" for j in rig.joints]
    needed = [
        name for j in rig.joints for name in rig.required_columns(j) if name in raw.columns and name not in motion
    ]
    timed = np.isfinite(raw.time)
    main = timed & np.all([np.isfinite(raw.columns[name]) for name in motion], axis=0)
    together = main & np.all([np.isfinite(raw.columns[name]) for name in [*needed, *motion]], axis=0)
    if not needed or not 0 < main.sum() < timed.sum() or together.sum() > MOST_TOGETHER * main.sum():
        return raw
    columns, moved = {}, []
    for name, values in raw.columns.items():
        own = timed & np.isfinite(values)
        if (own & main).sum() > MOST_TOGETHER * main.sum() or own.sum() < 2:
            columns[name] = values[main]
            continue
        columns[name] = _at(raw.time[main], raw.time[own], values[own], held=name.rpartition("/")[2] in HELD)
        moved.append(name)
    note = (
        f"The columns have values in different rows: the {int(main.sum())} rows with a position are the samples, and "
        f"{', '.join(moved)} {'was' if len(moved) == 1 else 'were'} interpolated there (commands held)."
    )
    rest = {name: getattr(raw, name)[main] for name in ("rows", "time", "enabled", "valid")}
    return replace(raw, columns=columns, notes=(*raw.notes, note), **rest)


def _at(time: FloatArray, own: FloatArray, values: FloatArray, *, held: bool) -> FloatArray:
    """Values (S,) of a column at its own times (S,), at other times (T,)."""
    order = np.argsort(own, kind="stable")
    own, values = own[order], values[order]
    before = np.searchsorted(own, time, side="right") - 1
    inside = (before >= 0) & (time <= own[-1])
    if held:
        return np.where(before >= 0, values[np.maximum(before, 0)], np.nan)
    spacing = np.diff(own)
    hole = spacing[np.clip(before, 0, spacing.size - 1)] > LONGEST_HOLE * float(np.median(spacing))
    on_sample = own[np.maximum(before, 0)] == time
    return np.where(inside & (~hole | on_sample), np.interp(time, own, values), np.nan)


RATES = ("hz", "fps", "rate", "frequency", "freq", "fs")
PERIODS = ("dt", "period", "timestep", "ts")
"""Words of the names of a rate [Hz] and of a period [s]."""


def stated_period(numbers: Mapping[str, float]) -> float | None:
    """The period [s] that single numbers of a file state; None where there is none, or two that differ.

    Example:
        >>> stated_period({"config/action_hz": 50.0, "mass": 0.5})
        0.02
    """
    found = set()
    for name, value in numbers.items():
        said = [word.lower() for word in words(name.rpartition("/")[2])]
        if not np.isfinite(value) or value <= 0.0 or not said:
            continue
        if said[-1] in RATES or any(word in ("hz", "fps") for word in said):
            found.add(1.0 / value)
        elif said[-1] in PERIODS:
            found.add(float(value))
    return found.pop() if len(found) == 1 else None


WHOLE_SECONDS = ("sec", "secs")
PARTS: Mapping[str, float] = {
    **dict.fromkeys(("nsec", "nsecs", "nanosec", "nanosecs"), 1e-9),
    "usec": 1e-6,
    "usecs": 1e-6,
}
"""Names of the second number of a stamp, with its unit [s]."""


def with_whole_stamps(table: pd.DataFrame) -> pd.DataFrame:
    """The table with a column `time`, where its stamps are two numbers, `stamp.sec` and `stamp.nanosec`.

    It begins within the first second, so that no digit is lost. Other columns that are called like a time go first.
    """
    last = {name: re.split(r"[^A-Za-z]", name)[-1] for name in map(str, table.columns)}
    by_end = {(name.removesuffix(word), word.lower()): name for name, word in last.items()}
    pairs = [
        (by_end[stem, word], rest, PARTS[part])
        for (stem, part), rest in by_end.items()
        if part in PARTS
        for word in WHOLE_SECONDS
        if (stem, word) in by_end
    ]
    stamps = {name for pair in pairs for name in pair[:2]}
    aside = dict.fromkeys(stamps, "part of a time stamp in two columns")
    table.attrs["aside"] = {**table.attrs.get("aside", {}), **aside}
    told = (meaning(name) for name in last if name not in stamps)
    if not pairs or any(each is not None and each.quantity == "time" for each in told):
        return table
    whole, rest, unit = pairs[0]
    seconds, more = (pd.to_numeric(table[name], errors="coerce").to_numpy(np.float64) for name in (whole, rest))
    first = next(iter(seconds[np.isfinite(seconds)]), 0.0)
    table.insert(0, "time", seconds - first + unit * more)
    note = f"The time is that of {whole!r} and {rest!r} together, counted from the first second."
    table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table


COUNTERS = tuple(2.0**bits * unit for bits in (16, 32) for unit in (1.0, 1e-3, 1e-6))
"""Values at which the counters of microcontrollers wrap around, in counts or converted to s."""


def with_counters_unwrapped(table: pd.DataFrame) -> pd.DataFrame:
    """The table with a time that is continued where its counter wraps around: it falls by its range, to a few steps."""
    name = time_among(map(str, table.columns))
    if name is None or not pd.api.types.is_numeric_dtype(table[name]):
        return table
    time = table[name].to_numpy(np.float64, na_value=np.nan)
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    for counter in COUNTERS:
        wraps = np.abs(steps + counter) <= GAP * usual
        if wraps.any() and np.nanmax(time) < counter and usual < 1e-2 * counter:
            table[name] = time + counter * np.concatenate([[0.0], np.cumsum(wraps)])
            count = int(wraps.sum())
            note = f"The counter of {name!r} wraps around at {counter:.10g} (found: {count}); the time was continued."
            table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table


def with_times(table: pd.DataFrame, period: float | None) -> pd.DataFrame:
    """The table with a column `time` of multiples of a stated period [s], where none is called like a time."""
    told = (meaning(str(name)) for name in table.columns)
    if period is None or any(each is not None and each.quantity == "time" for each in told):
        return table
    table.insert(0, "time", period * np.arange(len(table)))
    note = f"The file has no times but states a rate of {1.0 / period:.6g} Hz, so its rows are {period:.6g} s apart."
    table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table
