"""Readings that a sensor could not follow: jumps of an angle, values at the end of a range.

Jumps of an angle: an encoder lost its zero, or a logger dropped rows without a gap in time. The steps s_k = q_{k+1} -
q_k of a moving joint differ from their neighbours only by its acceleration. A step that is far larger than all others
is therefore a jump of the reading and not a motion.

The end of a range: a signal stops at one extreme value although what it measures goes on. A joint that turns round
slows down before it rests, and leaves its rest slowly; a sensor at its limit cuts the signal, with a change of slope on
both sides as there is none elsewhere. A servo's command goes on beyond the position that seems to stand. A command that
leaves a position at which the servo has held it, back into the range, tells nothing of the sensor: the joint answers it
late. In a noisy channel many equal values in a row are no reading at all.

Positions that were held although the joint moved, and clocks that stepped: the motion around a row tells. The speed
next to a row is the mean of the differences over five rows before and five rows after it. A position that stands still
for k rows and then leaps by what that speed makes in k rows was not read meanwhile; a position that goes on by one
period over a longer step of the clock was read one period later, and the clock is wrong. A logger that repeats all
channels of a joint, from which the position then leaps, did not read it either.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from drake_tc.logs.channels import run_lengths, true_spans
from drake_tc.logs.columns import RawLog, file_row
from drake_tc.logs.rig import Rig
from drake_tc.types import BoolArray, FloatArray, IntArray

NEIGHBOURHOOD = 9
"""Number of steps whose median is taken as the motion of the joint there."""
ALONE, AROUND = 10.0, 10
"""A jump departs from that median by more than `ALONE` times as much as any other step within `AROUND` rows. An impact
rings, and has several large steps."""
LARGEST = 3.0
"""A jump is so many times larger than the largest other step of the run: no motion of this joint is as fast."""
MANY_STEPS = 30.0
"""A jump has so many times the encoder's smallest step: the last digit may flicker."""
LONG = 1.5
"""Sampling periods between two samples above which rows are missing: the joint moved on meanwhile."""
MOST_JUMPS = 5
"""Most jumps of one column that are taken for a lost zero."""


def jumps(time: FloatArray, angle: FloatArray) -> IntArray:
    """Rows k (m,) after which the angle jumps and stays at its new value. NaN are skipped, and spikes are not jumps.

    Args:
        time: (T,) [s].
        angle: (T,) [rad].
    """
    at = np.flatnonzero(np.isfinite(angle))
    if at.size < 20 * NEIGHBOURHOOD:
        return np.empty(0, dtype=np.int64)
    steps = np.diff(angle[at])
    periods = np.diff(time[at])
    departure = np.abs(steps - median_filter(steps, NEIGHBOURHOOD, mode="nearest"))
    size = np.abs(steps)
    finest = float(np.min(size, where=size > 0.0, initial=np.inf))
    candidates = np.flatnonzero((departure > MANY_STEPS * finest) & (periods < LONG * np.median(periods)))
    candidates = candidates[np.argsort(-departure[candidates])][: MOST_JUMPS + 1]
    found = np.array([k for k in candidates.tolist() if _alone(departure, k)], dtype=np.int64)
    others = float(np.delete(size, found).max(initial=0.0))
    found = np.sort(found[departure[found] > LARGEST * others])
    return at[found] if found.size <= MOST_JUMPS else np.empty(0, dtype=np.int64)


def _alone(departure: FloatArray, k: int) -> bool:
    around = departure[max(k - AROUND, 0) : k + AROUND + 1]
    return bool(departure[k] > ALONE * np.delete(around, min(k, AROUND)).max(initial=0.0))


def find_jumps(raw: RawLog, rig: Rig) -> tuple[BoolArray, tuple[str, ...]]:
    """Rows (T,) beside jumps of the joints' positions, at which the run is to be split, and one note for each jump."""
    beside, notes = np.zeros(raw.time.size, dtype=bool), []
    for name in (f"{joint}/position" for joint in rig.joints if joint not in raw.speed_only):
        rows = jumps(raw.time, raw.columns[name])
        for k in rows.tolist():
            end = k + 1 + int(np.argmax(np.isfinite(raw.columns[name][k + 1 :])))
            beside[k : end + 1] = True
            unit = rig.units_of(name.removesuffix("/position")).position
            size = float(raw.columns[name][end] - raw.columns[name][k])
            notes.append(
                f"Column {name} jumps by {size:.3g} {unit} at {raw.time[end] - raw.time[0]:.6g} s"
                f" ({file_row(raw.path, end)}) and stays at the new value. The joint moves this fast nowhere else: the"
                " encoder lost its zero, or rows are missing. The run was split there. If the zero was lost, cut the"
                " log at this row, and either leave out one part or correct its zero."
            )
    return beside, tuple(notes)


SHORTEST = 10
"""Rows of a plateau at least."""
RAGGED = 3
"""Rows that leave the limit inside of a plateau: noise at its edges."""
WIDTHS = (5, 10, 20, 40)
"""Rows over which slopes are taken."""
CORNER = 1.5
"""Change of slope of a corner, times the largest elsewhere."""
LEAST_NOISE = 1e-4
"""Of the channel's range: what is less is no noise that plateaus contradict."""
NOISE_STEPS = 0.3
"""Noise in steps of the sensor's grid, above which its last digit flickers."""
STRAINED, FAR = 1.5, 3.0
"""A servo's command goes on outwards beyond most plateaus, or beyond one, by so many 99th percentiles of its distance
from the position elsewhere."""
STRAIN_STEPS = 20.0
"""And by so many steps of the encoder: a joint that rests by friction is strained by a few."""
SETTLED, LEAST_RESTS = 100, 3
"""Rows of a constant command after which a servo rests, and rests elsewhere that tell how near its goals it comes."""
MOST = 0.9
"""Share of the rows above which an extreme value is where the channel rests."""
EDGE = 5
"""Rows beside a plateau that are left out too: noise at a limit is cut on one side."""

Span = tuple[int, int]


def saturated_torque(values: FloatArray, step: float = 0.0) -> BoolArray:
    """Rows (T,) in which a torque sensor rests at its largest or smallest value although its signal goes on.

    Args:
        values: (T,); NaN where missing.
        step: Of the sensor's grid, 0 where it has none (`channels.grid_step`).
    """
    least = max(LEAST_NOISE * _range(values), NOISE_STEPS * step)
    limits = _limits(values)
    if _rows(values.size, limits).mean() > MOST:
        return np.zeros(values.size, dtype=bool)
    chosen = [spans for spans in limits if _noise(values, spans) > least or _has_corners(values, spans, limits, step)]
    return _rows(values.size, chosen)


def saturated_position(values: FloatArray, command: FloatArray | None, step: float = 0.0) -> BoolArray:
    """Rows (T,) in which an encoder rests at its largest or smallest value although the joint goes on.

    Args:
        values: (T,) [rad]; NaN where missing.
        command: (T,) commanded position of a position servo [rad]; None for other drives.
        step: Of the encoder, 0 where it has none.
    """
    limits = _limits(values)
    if command is None:
        return _rows(values.size, [spans for spans in limits if _has_corners(values, spans, limits, step)])
    strain = command - values
    resting = _rows(values.size, limits) | ~np.isfinite(strain)
    if not limits or resting.mean() > MOST:
        return np.zeros(values.size, dtype=bool)
    usual = float(np.percentile(np.abs(strain[~resting] - np.median(strain[~resting])), 99))
    usual = max(usual, STRAIN_STEPS * step / STRAINED, np.finfo(np.float64).tiny)
    middle = 0.5 * float(np.nanmax(values) + np.nanmin(values))
    outwards = [strain if values[spans[0][0]] > middle else -strain for spans in limits]
    least, rests = STRAIN_STEPS * step, _rests(command, strain)
    strained = [
        spans
        for spans, out in zip(limits, outwards, strict=True)
        if _is_strained(out, spans, usual) or _rests_beyond(out, rests, spans, least)
    ]
    return _rows(values.size, strained)


def _range(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else 0.0


def _limits(values: FloatArray) -> list[list[Span]]:
    """The plateaus at the largest and at the smallest value; nothing for a channel that is short or constant."""
    finite = values[np.isfinite(values)]
    if finite.size < 20 * SHORTEST or np.ptp(finite) == 0.0:
        return []
    return [spans for limit in (finite.max(), finite.min()) if (spans := _plateaus(values == limit))]


def _plateaus(at: BoolArray) -> list[Span]:
    """First row and end of the stretches at a limit, of ten rows or more; those that are three rows apart are one."""
    merged: list[Span] = []
    for begin, end in true_spans(at):
        if merged and begin - merged[-1][1] <= RAGGED:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((begin, end))
    return [(begin, end) for begin, end in merged if end - begin >= SHORTEST]


def _rows(size: int, limits: Sequence[Sequence[Span]]) -> BoolArray:
    """Rows (T,) of plateaus and their edges."""
    rows = np.zeros(size, dtype=bool)
    for begin, end in (span for spans in limits for span in spans):
        rows[max(0, begin - EDGE) : end + EDGE] = True
    return rows


def _noise(values: FloatArray, spans: Sequence[Span]) -> float:
    """The least level of noise beside plateaus: that of fourth differences over 20 rows, as of white noise."""
    sides = [values[max(0, first) : first + 20] for begin, end in spans for first in (begin - 20, end)]
    whole = [side for side in sides if side.size == 20 and np.isfinite(side).all()]
    levels = [float(np.median(np.abs(np.diff(side, 4))) / (0.6745 * np.sqrt(70.0))) for side in whole]
    return min(levels, default=0.0)


def _is_strained(strain: FloatArray, spans: Sequence[Span], usual: float) -> bool:
    """Whether a servo's command goes on in plateaus, farther outwards from the position than it is away elsewhere."""
    middle = float(np.nanmedian(strain))
    parts = [np.maximum(strain[begin:end] - middle, 0.0) for begin, end in spans]
    strains = [min(np.nanmax(part, initial=0.0) / STRAINED, _range(part)) / usual for part in parts]
    return bool(2 * sum(each > 1.0 for each in strains) > len(spans) or max(strains) > FAR / STRAINED)


def _rests_beyond(strain: FloatArray, rests: IntArray, spans: Sequence[Span], least: float) -> bool:
    """Whether a servo that comes to rest at its goals elsewhere stays far inside of them in plateaus."""
    here = np.any([(begin <= rests) & (rests < end) for begin, end in spans], axis=0)
    others = strain[rests[~here]]
    if not here.any() or others.size < LEAST_RESTS:
        return False
    usual = float(np.max(np.abs(others - np.median(others))))
    return float(np.median(strain[rests[here]]) - np.median(others)) > max(least, FAR * usual)


def _rests(command: FloatArray, strain: FloatArray) -> IntArray:
    """The last rows of the stretches over which the command of a servo is constant and long enough to be reached."""
    same = np.concatenate([[False], np.diff(command) == 0.0])
    ends = np.array([end - 1 for begin, end in true_spans(same) if end - begin >= SETTLED], dtype=np.int64)
    return np.asarray(ends[np.isfinite(strain[ends])])


def _has_corners(values: FloatArray, spans: Sequence[Span], limits: Sequence[Sequence[Span]], step: float) -> bool:
    """Whether most plateaus have a change of slope on both sides as there is none elsewhere, over one of the widths."""
    return any(2 * _corners(values, spans, limits, width, step) > len(spans) for width in WIDTHS)


def _corners(
    values: FloatArray, spans: Sequence[Span], limits: Sequence[Sequence[Span]], width: int, step: float
) -> int:
    """How many plateaus of `width` rows or more are entered and left with such a change over `width` rows.

    Where a plateau touches an end of the log, its other side decides.
    """
    plain = np.ones(values.size, dtype=bool)
    for begin, end in (span for each in limits for span in each):
        plain[max(0, begin - width) : end + width] = False
    rises = values[width:] - values[:-width]
    changes = np.abs(rises[width:] - rises[:-width])[plain[: -2 * width] & plain[2 * width :]]
    changes = changes[np.isfinite(changes)]
    if changes.size < 20:
        return 0
    least = max(CORNER * float(changes.max()), 4.0 * step)
    count = 0
    for begin, end in spans:
        sides = ([abs(rises[begin - width])] if begin >= width else []) + (
            [abs(rises[end - 1])] if end - 1 < rises.size else []
        )
        count += bool(end - begin >= width and sides and min(sides) > least)
    return count


ROWS = 5
"""Rows before and after, over which the speed is taken."""
LEAST_DEVIATIONS = 3.0
"""Motion in deviations of the second difference (2.4 of the noise), below which nothing is told."""
REPEATED = 5
"""Rows in which a logger repeats itself, at least."""
LEAP = 1.5
"""Leap of a position behind them, times the largest step anywhere else."""
MOST_HELD = 0.02
"""Share of rows above which holding is the channel's way, as of one on a slower clock."""


def held_rows(position: FloatArray) -> BoolArray:
    """Rows (T,) whose position repeats the row before although the joint moved on.

    Args:
        position: (T,) [rad]; NaN where missing.

    Returns:
        With x the value that is held over k rows more and d the leap behind it: rows of stretches with
        d = (0.5 to 2) v (k + 1), v the speed per row around them, and v sqrt(k) beyond what noise makes by chance.
    """
    held = np.zeros(position.size, dtype=bool)
    if position.size < 4 * ROWS or not np.isfinite(position).all():
        return held
    starts, lengths = run_lengths(position)
    chosen = (lengths >= 2) & (starts >= ROWS) & (starts + lengths + ROWS < position.size)
    starts, lengths = starts[chosen], lengths[chosen]
    ends = starts + lengths
    leap = position[ends] - position[starts]
    usual = _speed(position, starts, ends) * lengths
    jumped = (leap * usual > 0.0) & (np.abs(leap) > 0.5 * np.abs(usual)) & (np.abs(leap) < 2.0 * np.abs(usual))
    speed = np.abs(usual) / lengths
    jumped &= speed * np.sqrt(lengths - 1.0) > LEAST_DEVIATIONS * _deviation(position)
    for start, end in zip(starts[jumped].tolist(), ends[jumped].tolist(), strict=True):
        held[start + 1 : end] = True
    return held if held.mean() <= MOST_HELD or len(true_spans(held)) == 1 else np.zeros_like(held)


def repeated_rows(position: FloatArray, others: Sequence[FloatArray]) -> BoolArray:
    """Rows (T,) that repeat the row before in all channels, of stretches behind which the position leaps.

    The joint may have turned round meanwhile, so that its speed before and after says nothing. No joint that rests
    moves farther in one row than it ever does in one.

    Args:
        position: (T,) [rad]; NaN where missing.
        others: (T,) each, the other channels of the joint; at least one.
    """
    repeated = np.zeros(position.size, dtype=bool)
    if not others or position.size < 4 * ROWS:
        return repeated
    same = np.concatenate([[False], np.all([np.diff(each) == 0.0 for each in (position, *others)], axis=0)])
    spans = [(begin, end) for begin, end in true_spans(same) if end - begin >= REPEATED and end < position.size]
    steps = np.nan_to_num(np.abs(np.diff(position)))
    behind = np.array([end - 1 for _, end in spans], dtype=np.int64)
    usual = float(np.delete(steps, behind).max(initial=0.0))
    for begin, end in spans:
        repeated[begin:end] = steps[end - 1] > LEAP * usual > 0.0
    return repeated


def stepped_clock(time: FloatArray, position: FloatArray, longest: float) -> BoolArray:
    """Steps (T - 1,) of the clock over which a position goes on by one period only, so that no rows were lost.

    Args:
        time: (T,) strictly increasing [s].
        position: (T,) [rad]; NaN where missing.
        longest: Steps beyond so many periods are gaps, whatever the position does.
    """
    stepped = np.zeros(time.size - 1, dtype=bool)
    steps = np.diff(time)
    period = float(np.median(steps))
    at = np.flatnonzero((steps > 1.5 * period) & (steps <= longest * period))
    at = at[(at >= ROWS) & (at + 1 + ROWS < time.size)]
    if not at.size or not np.isfinite(position).all():
        return stepped
    speed = _speed(position, at, at + 1)
    leap = position[at + 1] - position[at]
    beyond = speed * (steps[at] / period - 1.0)  # motion in the rows that would have been lost
    told = np.abs(beyond) > LEAST_DEVIATIONS * _deviation(position)
    stepped[at[told & (np.abs(leap - speed) < 0.5 * np.abs(beyond))]] = True
    return stepped


def _speed(position: FloatArray, before: IntArray, after: IntArray) -> FloatArray:
    """Motion per row, the mean of that up to the rows `before` and that from the rows `after` on."""
    until = (position[before] - position[before - ROWS]) / ROWS
    return np.asarray(0.5 * (until + (position[after + ROWS] - position[after]) / ROWS))


def _deviation(position: FloatArray) -> float:
    """Deviation of the second difference of a position (T,), and one encoder step at least [rad]."""
    steps = np.abs(np.diff(position))
    moving = steps[steps > 1e-12 * max(float(np.abs(position).max()), 1e-12)]
    finest = float(moving.min()) if moving.size else np.inf
    return max(1.4826 * float(np.median(np.abs(np.diff(position, 2)))), finest)
