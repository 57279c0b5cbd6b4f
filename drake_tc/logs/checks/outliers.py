"""Repair of the angles and measurements of a log: turns undone, what no sensor read taken out; a sentence for each.

A turn: a step between neighbouring rows within a little of 2 pi n, in a channel whose other steps are much smaller. It
is undone exactly, whether the channel stays there (an encoder that wraps round) or comes back (one sample a turn off).
A spike: one to three rows far from the median of their neighbourhood, by many times what the channel does elsewhere.

A dropout: a stretch of exactly 0 in place of readings. A sensor that drops out leaves its signal with a leap, reads 0
in one or more rows, and comes back with a leap. One of the two leaps is small where the signal crosses 0 at that
moment.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_dilation, maximum_filter1d, median_filter

from drake_tc.errors import LogError
from drake_tc.logs.channels import grid_step, true_spans
from drake_tc.logs.checks.clock import GAP_PERIODS
from drake_tc.logs.checks.jumps import held_rows, repeated_rows, saturated_position, saturated_torque
from drake_tc.logs.columns import RawLog, file_row
from drake_tc.types import BoolArray, FloatArray

TURN = 2.0 * np.pi
NEAR_A_TURN = 0.25
"""Distance of a step from 2 pi n below which it may be turns [rad]."""
MOST_TURNS = 1000.0
"""Of one step; a larger one is a wild value."""
LIKE_OTHERS = 2.0
"""What is left of a step without its turns is at most so many times the largest other step."""
NEIGHBOURHOOD = 9
"""Rows of the running median; it passes over spikes of up to four rows."""
LONGEST_SPIKE = 3
USUAL = 95.0
"""Percentile of distances and steps that is usual in a channel; spikes are rarer than the rest."""
WILD = 30.0
"""A spike lies so many usual distances away from the running median."""
WILD_RANGE = 0.3
"""And so large a share of the channel's range (0.5 to 99.5 %) at least."""
MANY_STEPS = 30.0
"""So many of the smallest steps: the last digit of an encoder at rest flickers."""
ALONE, AROUND = 10.0, 10
"""A spike is so many times larger than any other distance within so many rows: an impact rings, and is none."""
MOST_SPIKES = 0.01
"""Share of the rows with spikes above which a channel is not mended."""


@dataclass(frozen=True)
class Turns:
    """Whole turns found in an angle.

    Attributes:
        values: (T,) without the turns.
        rows: Where they were gained or lost.
    """

    values: FloatArray
    rows: tuple[int, ...]


def without_turns(values: FloatArray) -> Turns:
    """An angle (T,) [rad] without the whole turns between its rows; NaN stays.

    Steps of 2 pi n +- 0.25 rad are turns if what is left without them is like the other steps, and every other step
    is below a tenth of a turn; a joint that moves faster than that between two samples is left alone.
    """
    at = np.flatnonzero(np.isfinite(values))
    steps = np.diff(values[at])
    turns = np.round(steps / TURN)
    found = (turns != 0) & (np.abs(turns) <= MOST_TURNS) & (np.abs(steps - TURN * turns) < NEAR_A_TURN)
    largest = float(np.abs(steps[~found]).max(initial=0.0))
    found &= np.abs(steps - TURN * turns) <= LIKE_OTHERS * largest  # else a wild value that happens to be near one
    if not found.any() or np.abs(steps[~found]).max(initial=0.0) > 0.1 * TURN:
        return Turns(values, ())
    mended = values.copy()
    mended[at[1:]] -= TURN * np.cumsum(np.where(found, turns, 0.0))
    return Turns(mended, tuple((at[1:][found]).tolist()))


def spikes(values: FloatArray) -> BoolArray:
    """Rows (T,) of a channel that hold spikes; NaN are none.

    A distance d = |x - median of 9 rows| is wild above 30 times its 95th percentile, above 0.3 of the channel's range
    (2.5 to 97.5 %), above ten times the 95th percentile of the steps between rows, and above thirty times the smallest
    of them. A spike stands alone: it is ten times larger than all else within ten rows.
    """
    wild = np.zeros(values.size, dtype=bool)
    at = np.flatnonzero(np.isfinite(values))
    if at.size < 20 * NEIGHBOURHOOD:
        return wild
    x = values[at]
    distance = np.abs(x - median_filter(x, NEIGHBOURHOOD, mode="nearest"))
    usual = float(np.percentile(distance, USUAL))
    low, high = np.percentile(x, [2.5, 97.5])
    steps = np.abs(np.diff(x))
    step, finest = float(np.percentile(steps, USUAL)), float(np.min(steps, where=steps > 0.0, initial=np.inf))
    found = distance > max(WILD * usual, WILD_RANGE * float(high - low), 10.0 * step, MANY_STEPS * finest)
    if found.any():
        calm = maximum_filter1d(np.where(found, 0.0, distance), 2 * AROUND + 1, mode="nearest")
        wild[at[_alone(found) & (distance > ALONE * calm)]] = True
    return wild


def _alone(found: BoolArray) -> BoolArray:
    """The stretches of True (T,) that are no longer than a spike, with no other within ten rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], found, [False]]).astype(np.int8))).reshape(-1, 2)
    gaps = np.concatenate([[np.inf], edges[1:, 0] - edges[:-1, 1], [np.inf]])
    alone = np.zeros(found.size, dtype=bool)
    for (first, end), before, after in zip(edges.tolist(), gaps[:-1], gaps[1:], strict=True):
        alone[first:end] = end - first <= LONGEST_SPIKE and min(before, after) > AROUND
    return alone


LEAP = 5.0
"""A leap into or out of 0, in 99th percentiles of the other steps."""
LEAST_CHANGING = 0.5
"""Share of the other steps that must not be 0: a channel that rests or moves by steps leaps by nature."""
MOST_ZEROS = 0.3
"""Share of rows with 0 above which 0 is a reading like any other."""
UNANSWERED = 1.5
"""A motion that goes on at this many 99th percentiles of its own steps at most has not answered a command of 0."""


def zero_rows(values: FloatArray, apart: BoolArray | None = None) -> BoolArray:
    """Rows (T,) of a channel that dropped out to exactly 0; NaN are none.

    Rows that are `apart` (T,) follow a gap of the clock: what lies between them and the row before is no leap.

    A stretch of zeros counts if it is left, or was entered, with a leap of more than five times the 99th percentile of
    the steps between other rows. Where the channel is 0 for two rows or more without any leap too, the sensor has a
    threshold, and only stretches with both leaps count.
    """
    dropped = np.zeros(values.size, dtype=bool)
    zero = values == 0.0
    if not zero.any() or zero.mean() > MOST_ZEROS:
        return dropped
    steps = np.abs(np.diff(values))
    others = steps[np.isfinite(steps) & ~(zero[1:] | zero[:-1])]
    if others.size < 20 or float(np.mean(others > 0.0)) < LEAST_CHANGING:
        return dropped
    leap = LEAP * float(np.percentile(others, 99))
    stretches = true_spans(zero)
    parted = np.zeros(values.size, dtype=bool) if apart is None else apart
    leaps = [_leaps(values, begin, end, leap, parted) for begin, end in stretches]
    natural = any(end - begin > 1 and not count for (begin, end), count in zip(stretches, leaps, strict=True))
    for (begin, end), count in zip(stretches, leaps, strict=True):
        if count > natural:
            dropped[begin:end] = True
    return dropped


def unanswered_zeros(command: FloatArray, position: FloatArray, apart: BoolArray | None = None) -> BoolArray:
    """Rows (T,) in which a position command was logged as 0 while the joint moved on as before.

    Both leaps must be there, the command must come back to where it was going, and the position must not answer. A
    command of 0 that was sent moves the joint, and is a command like any other.
    """
    dropped = zero_rows(command, apart)
    if not dropped.any():
        return dropped
    usual, pace = (_usual_step(values, dropped) for values in (position, command))
    for begin, end in true_spans(dropped):
        length = end - begin
        if begin == 0 or end == command.size:
            dropped[begin:end] = False
            continue
        returned = abs(command[end] - command[begin - 1]) <= pace * (length + 1)
        moved = np.abs(np.diff(position[begin - 1 : min(end + length, position.size)]))
        if not returned or np.nanmax(moved, initial=0.0) > UNANSWERED * usual:
            dropped[begin:end] = False
    return dropped


def _leaps(values: FloatArray, begin: int, end: int, leap: float, apart: BoolArray) -> int:
    """How many of the two ends of a stretch are leaps; the end of a log is none, and a gap of the clock is none."""
    before = values[begin - 1] if begin and not apart[begin] else 0.0
    sides = (before, values[end] if end < values.size and not apart[end] else 0.0)
    return sum(bool(abs(side) > leap) for side in sides)


def _usual_step(values: FloatArray, without: BoolArray) -> float:
    """The 99th percentile of the steps (T - 1,) outside of rows (T,)."""
    steps = np.abs(np.diff(values))[~(without[1:] | without[:-1])]
    steps = steps[np.isfinite(steps)]
    return float(np.percentile(steps, 99)) if steps.size else 0.0


ANGLES = ("position", "motor_position", "position_command")
SLOW = ("temperature", "supply_voltage", "position_gain")
"""Channels that repeat values by nature."""
MEASURED = ("position", "motor_position", "torque", "velocity")
DROPPING = (*MEASURED, "current")
EFFORTS = ("position_command", "current", "voltage")
ANSWERS = ("torque", "velocity")
"""Measurements that follow a pulse of the effort at once."""
WITHIN = 2
"""Rows between such a pulse and the answer to it, at most."""


def without_outliers(raw: RawLog, joints: Sequence[str], sliding: Collection[str] = ()) -> RawLog:
    """The log with the turns of its angles undone, and NaN where a sensor did not read; the notes say where.

    A sensor did not read in spikes, where it dropped out to 0, at the end of its range, and where it repeated a value
    in motion. Angles of one joint that differ by whole turns are put together. Commands have no spikes: what was
    commanded was commanded. Spikes of currents and voltages are left alone, as switching makes real ones. So are those
    of torque and velocity at the same time, which answer them. Positions of the joints `sliding` have no turns.

    Raises:
        LogError: spikes in more than one row in a hundred of a channel.
    """
    columns = dict(raw.columns)
    notes: list[str] = []
    for joint in joints:
        notes += _without_dropouts(columns, joint, raw)
        for name in () if joint in sliding else _own(columns, joint, ANGLES):
            if (turns := without_turns(columns[name])).rows:
                columns[name] = turns.values
                where = _where(np.isin(np.arange(turns.values.size), turns.rows), raw)
                notes.append(f"Column {name} jumps by whole turns of 2 pi in {where}; the turns were undone.")
        if joint not in sliding:
            _put_together(columns, joint)
        for name in _own(columns, joint, MEASURED):
            notes += _without_spikes(columns, name, raw, _pulses(columns, joint, name))
        notes += _without_saturation(columns, joint, raw)
        notes += _without_held(columns, joint, raw)
    return replace(raw, columns=columns, notes=(*raw.notes, *notes)) if notes else raw


def _own(columns: Mapping[str, FloatArray], joint: str, suffixes: Sequence[str]) -> list[str]:
    """Names of the joint's channels with these last parts."""
    return [name for name in (f"{joint}/{suffix}" for suffix in suffixes) if name in columns]


def _where(rows: BoolArray, raw: RawLog) -> str:
    """How many rows (T,), and which is the first."""
    count = int(rows.sum())
    return f"{count} row{'s' if count > 1 else ''} (the first: {file_row(raw.path, int(np.argmax(rows)))})"


def _taken_out(columns: dict[str, FloatArray], name: str, what: str, rows: BoolArray, raw: RawLog) -> list[str]:
    """NaN in rows (T,) in which a channel was not read, and the sentence about them; none where there are none."""
    if not rows.any():
        return []
    columns[name] = np.where(rows, np.nan, columns[name])
    return [f"Column {name} {what} in {_where(rows, raw)}; they were taken out."]


def _without_dropouts(columns: dict[str, FloatArray], joint: str, raw: RawLog) -> list[str]:
    """NaN where a channel dropped out to 0; a position command only where the joint did not answer."""
    name, position = f"{joint}/position_command", columns.get(f"{joint}/position")
    steps = np.diff(raw.time, prepend=raw.time[:1])
    apart = steps > GAP_PERIODS * float(np.median(steps))
    notes = []
    for each in _own(columns, joint, DROPPING):
        notes += _taken_out(columns, each, "drops out to 0", zero_rows(columns[each], apart), raw)
    if name in columns and position is not None:
        rows = unanswered_zeros(columns[name], position, apart)
        notes += _taken_out(columns, name, "drops out to 0, and the joint moves on,", rows, raw)
    return notes


def _without_saturation(columns: dict[str, FloatArray], joint: str, raw: RawLog) -> list[str]:
    """NaN where the position or the torque of a joint rests at the end of its sensor's range."""
    notes, command = [], columns.get(f"{joint}/position_command")
    for name in _own(columns, joint, ("position", "torque")):
        values, step = columns[name], grid_step(columns[name])
        torque = name.endswith("/torque")
        rows = saturated_torque(values, step) if torque else saturated_position(values, command, step)
        reached = float(np.nanmax(np.abs(values[rows]), initial=0.0))
        what = f"stops at an extreme value (up to {reached:.4g}), as at the end of the sensor's range,"
        notes += _taken_out(columns, name, what, rows, raw)
    return notes


def _without_held(columns: dict[str, FloatArray], joint: str, raw: RawLog) -> list[str]:
    """NaN where the joint's position was held in motion, in the position and in what repeats there with it."""
    name = f"{joint}/position"
    if name not in columns:
        return []
    notes = _without_repeats(columns, held_rows(columns[name]), raw)
    own = [each for each in columns if each.rpartition("/")[0] == joint and each.rpartition("/")[2] not in SLOW]
    others = [columns[each] for each in own if each != name]
    return notes + _without_repeats(columns, repeated_rows(columns[name], others), raw)


def _without_repeats(columns: dict[str, FloatArray], held: BoolArray, raw: RawLog) -> list[str]:
    """NaN in the rows (T,) of the channels that repeat there."""
    if not held.any():
        return []
    names = []
    for name, values in columns.items():
        if np.array_equal(values[held], values[np.flatnonzero(held) - 1], equal_nan=True):
            columns[name] = np.where(held, np.nan, values)
            names.append(name)
    first = file_row(raw.path, int(np.argmax(held)))
    return [
        f"Column {name} repeats an earlier value in {int(held.sum())} rows in which the joint moved on (the first:"
        f" {first}); they were taken out."
        for name in names
        if name.rpartition("/")[2] not in SLOW
    ]


def _put_together(columns: dict[str, FloatArray], joint: str) -> None:
    """Take whole turns between position and command, which undoing turns may leave, from the command."""
    command, position = columns.get(f"{joint}/position_command"), columns.get(f"{joint}/position")
    if command is None or position is None:
        return
    between = command - position
    if np.isfinite(between).any():
        whole = np.round(np.nanmedian(between) / TURN)
        columns[f"{joint}/position_command"] = command - TURN * whole if whole else command


def _pulses(columns: dict[str, FloatArray], joint: str, name: str) -> BoolArray:
    """Rows (T,) near spikes of the joint's effort, if the channel is one that answers them."""
    near = np.zeros(columns[name].size, dtype=bool)
    if name.rpartition("/")[2] in ANSWERS:
        for effort in _own(columns, joint, EFFORTS):
            near |= spikes(columns[effort])
    return np.asarray(binary_dilation(near, iterations=WITHIN)) if near.any() else near


def _without_spikes(columns: dict[str, FloatArray], name: str, raw: RawLog, pulses: BoolArray) -> list[str]:
    """NaN where a channel has spikes that no pulse (T,) explains."""
    values = columns[name]
    wild = spikes(values) & ~pulses
    if (count := int(wild.sum())) > MOST_SPIKES * values.size:
        first = int(np.argmax(wild))
        raise LogError(
            f"{raw.path}: column {name} has spikes in {count} of {values.size} rows, the first in"
            f" {file_row(raw.path, first)} ({values[first]:.4g}); expected a column without spikes: repair the"
            " wiring or the logger, and record again"
        )
    largest = float(np.max(np.abs(values[wild] - np.nanmedian(values)))) if count else 0.0
    return _taken_out(columns, name, f"has spikes of up to {largest:.3g}", wild, raw)
