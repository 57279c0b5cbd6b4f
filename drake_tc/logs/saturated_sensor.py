"""A sensor at the end of its range: its signal stops at one extreme value although what it measures goes on.

A joint that turns round slows down before it rests, and leaves its rest slowly; a sensor at its limit cuts the signal,
with a change of slope on both sides as there is none elsewhere. A servo's command goes on beyond the position that
seems to stand. A command that leaves a position at which the servo has held it, back into the range, tells nothing of
the sensor: the joint answers it late. In a noisy channel many equal values in a row are no reading at all.
"""

from collections.abc import Sequence

import numpy as np

from drake_tc.logs.channels import true_spans
from drake_tc.types import BoolArray, FloatArray, IntArray

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
