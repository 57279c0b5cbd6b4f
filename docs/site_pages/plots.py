"""Small plots as SVG text: points and lines in a frame with ticks, as fast to write as a table."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from drake_tc.types import FloatArray

WIDTH, HEIGHT, LEFT, BOTTOM, TOP, RIGHT = 420, 260, 58, 40, 26, 10
FORWARD, BACKWARD, INK = "#0171b2", "#c15201", "#333333"


@dataclass(frozen=True)
class Series:
    """Points (N,) of one colour, joined by a line or not."""

    x: FloatArray
    y: FloatArray
    colour: str
    line: bool = False
    name: str = ""


def plot(title: str, x_label: str, y_label: str, series: Sequence[Series]) -> str:
    """A frame with all series, as one `<svg>` element."""
    xs, ys = np.concatenate([s.x for s in series]), np.concatenate([s.y for s in series])
    x_range, y_range = _range(xs), _range(ys)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" role="img" aria-label="{escape(title)}" '
        'font-family="sans-serif" font-size="11">',
        f'<text x="{LEFT}" y="15" font-size="12" fill="{INK}">{escape(title)}</text>',
        *_axis(x_range, vertical=False),
        *_axis(y_range, vertical=True),
    ]
    for each in series:
        parts.append(_marks(each, x_range, y_range))
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(f'<text x="{middle:.0f}" y="{HEIGHT - 6}" text-anchor="middle" fill="{INK}">{escape(x_label)}</text>')
    y_place = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(
        f'<text transform="translate(12 {y_place:.0f}) rotate(-90)" text-anchor="middle" fill="{INK}">'
        f"{escape(y_label)}</text>"
    )
    parts += _legend([s for s in series if s.name])
    return "".join([*parts, "</svg>"])


def _marks(series: Series, x_range: tuple[float, float], y_range: tuple[float, float]) -> str:
    x = LEFT + (series.x - x_range[0]) / (x_range[1] - x_range[0]) * (WIDTH - LEFT - RIGHT)
    y = HEIGHT - BOTTOM - (series.y - y_range[0]) / (y_range[1] - y_range[0]) * (HEIGHT - BOTTOM - TOP)
    if series.line:
        path = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
        return f'<path d="M{path}" fill="none" stroke="{series.colour}" stroke-width="1.4"/>'
    path = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x, y, strict=True))
    return f'<path d="{path}" stroke="{series.colour}" stroke-width="3" stroke-linecap="round" stroke-opacity="0.5"/>'


def _legend(named: Sequence[Series]) -> list[str]:
    texts = []
    for number, each in enumerate(named):
        x = WIDTH - RIGHT - 4
        y = TOP + 4 + 14 * number
        texts.append(f'<text x="{x}" y="{y + 4}" text-anchor="end" fill="{each.colour}">{escape(each.name)}</text>')
    return texts


def _axis(limits: tuple[float, float], *, vertical: bool) -> list[str]:
    parts = []
    for tick in _ticks(*limits):
        share = (tick - limits[0]) / (limits[1] - limits[0])
        if vertical:
            y = HEIGHT - BOTTOM - share * (HEIGHT - BOTTOM - TOP)
            parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#dddddd"/>')
            parts.append(f'<text x="{LEFT - 5}" y="{y + 4:.1f}" text-anchor="end" fill="#666666">{tick:g}</text>')
        else:
            x = LEFT + share * (WIDTH - LEFT - RIGHT)
            parts.append(f'<path d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#dddddd"/>')
            place = HEIGHT - BOTTOM + 14
            parts.append(f'<text x="{x:.1f}" y="{place}" text-anchor="middle" fill="#666666">{tick:g}</text>')
    return parts


def _range(values: FloatArray) -> tuple[float, float]:
    low, high = float(np.min(values)), float(np.max(values))
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _ticks(low: float, high: float) -> list[float]:
    rough = (high - low) / 5.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(f for f in (1, 2, 5, 10) if f * power >= rough)
    first = math.ceil(low / step)
    return [round(step * number, 12) for number in range(first, math.floor(high / step) + 1)]
