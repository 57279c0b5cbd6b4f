"""Points of plots: rows of a data split with direction of motion and reversals, and what a cloud of points says.

A cloud has binned medians with quartiles and a frame that outliers do not set. Fewer samples keep every extreme.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.residual.unexplained import DataSplit, TimeStretch
from drake_tc.types import BoolArray, FloatArray, IntArray

REVERSAL_SECONDS = 0.1
LABELS: dict[str, tuple[str, str]] = {
    "velocity": ("velocity", "rad/s"),
    "acceleration": ("acceleration", "rad/s²"),
    "position": ("position", "rad"),
    "load_torque": ("load torque", "N·m"),
    "expected_torque": ("load torque expected by the model", "N·m"),
    "command": ("command", ""),
    "effort": ("effort", ""),
    "temperature": ("temperature", "°C"),
    "supply_voltage": ("supply voltage", "V"),
    "travel": ("travel since the last reversal", "rad"),
    "direction": ("direction of motion", ""),
    "time": ("time, runs end to end", "s"),
}
"""Name of each signal on an axis, and its unit."""


@dataclass(frozen=True)
class Quantity:
    """What a residual is drawn against.

    Attributes:
        key: A field of `Signals`, or "modulo-<cycles>".
        label: With unit, for the axis. title: for the heading.
        values: (N,) on the rows.
        marks: Where runs begin on the axis, for time. shaded: stretches that stand out, for time.
    """

    key: str
    title: str
    label: str
    values: FloatArray
    marks: tuple[float, ...] = ()
    shaded: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class SplitRows:
    """Rows of one split: direction (N,) in {-1, 0, 1}, and whether a reversal is within 0.1 s (N,)."""

    direction: FloatArray
    reversal: BoolArray


def rows_of(split: DataSplit) -> SplitRows:
    """Direction of motion and nearness to a reversal on the rows of `split`."""
    samples = split.samples
    direction = np.sign(samples.signals.direction[samples.rows])
    return SplitRows(np.asarray(direction), near_reversal(samples, REVERSAL_SECONDS))


def near_reversal(samples: Samples, seconds: float) -> BoolArray:
    """Whether the direction of motion turns within `seconds` of each row (N,), inside the row's own stretch."""
    sign = samples.signals.direction
    reach = max(1, round(seconds / samples.signals.period)) if samples.signals.period > 0.0 else 1
    near = np.zeros(len(samples.signals), dtype=bool)
    for stretch in samples.segments:
        turned = np.flatnonzero(np.diff(np.sign(sign[stretch]))) + 1
        edges = np.zeros(stretch.stop - stretch.start + 1)
        np.add.at(edges, np.maximum(turned - reach, 0), 1.0)
        np.add.at(edges, np.minimum(turned + reach, edges.size - 1), -1.0)
        near[stretch] = np.cumsum(edges)[:-1] > 0.0
    return np.asarray(near[samples.rows])


def quantity(split: DataSplit, key: str, effort_unit: str, stretches: Sequence[TimeStretch] = ()) -> Quantity | None:
    """The signal `key` on the split's rows, or None if it was not recorded."""
    if key == "time":
        return _time(split.samples, stretches)
    values = np.asarray(getattr(split.samples.signals, key)[split.samples.rows], dtype=float)
    if not np.isfinite(values).any():
        return None
    title, unit = LABELS[key]
    unit = effort_unit if key in ("effort", "command") else split.samples.units.text(unit)
    return Quantity(key, title, f"{title} [{unit}]" if unit else title, values)


def modulo(split: DataSplit, cycles: float) -> Quantity:
    """Position within one period of `cycles` periods a turn, in degrees; of a joint that slides, in mm."""
    position = split.samples.signals.position[split.samples.rows]
    if split.samples.units.slides:
        length = 2e3 * np.pi / cycles
        label = f"position modulo {length:.3g} mm"
        return Quantity(f"modulo-{cycles:.6g}", label, f"{label} [mm]", np.mod(1e3 * position, length))
    period = 360.0 / cycles
    position = np.degrees(position)
    title = f"position modulo {period:.3g}° ({cycles:.4g} a turn)"
    return Quantity(f"modulo-{cycles:.6g}", title, f"position modulo {period:.3g}° [°]", np.mod(position, period))


def _run_offsets(samples: Samples) -> FloatArray:
    """Where each run begins (R,) [s] when the runs are drawn one after the other."""
    time = samples.signals.time
    lengths = [float(time[samples.run_of_sample == k].max(initial=0.0)) for k in range(len(samples.runs))]
    return np.asarray(np.concatenate([[0.0], np.cumsum(lengths)[:-1]]))


def _time(samples: Samples, stretches: Sequence[TimeStretch]) -> Quantity:
    offsets = _run_offsets(samples)
    values = samples.signals.time[samples.rows] + offsets[samples.run]
    shaded = tuple(
        (offsets[samples.runs.index(s.run)] + s.start, offsets[samples.runs.index(s.run)] + s.end)
        for s in stretches
        if s.run in samples.runs
    )
    several = len(samples.runs) > 1
    label = "time, runs end to end [s]" if several else "time [s]"
    return Quantity("time", "time", label, np.asarray(values), tuple(float(o) for o in offsets[1:]), shaded)


MOST_POINTS = 3000
BINS = 24
LEAST_IN_BIN = 8
WIDEST = 1.5
"""Width of the widest bin, in bins of equal width."""


@dataclass(frozen=True)
class Binned:
    """Bins (B,) of a cloud: median of x, and quartiles and median of y."""

    x: FloatArray
    low: FloatArray
    middle: FloatArray
    high: FloatArray


def binned(x: FloatArray, y: FloatArray, bins: int = BINS) -> Binned:
    """Medians and quartiles of y (N,) in bins of equally many x (N,): fine where the data are dense.

    Values that are not finite take no part. A bin that is wider than `WIDEST` bins of equal width is cut at its widest
    gaps; bins with fewer than 8 points are left out; all may be. A row of NaN stands where a gap is as wide.
    """
    good = np.isfinite(x) & np.isfinite(y)
    order = np.argsort(x[good], kind="stable")
    xs, ys = x[good][order], y[good][order]
    count = min(bins, xs.size // LEAST_IN_BIN)
    if count < 1:
        return Binned(*(np.zeros(0) for _ in range(4)))
    widest = WIDEST / count * float(xs[-1] - xs[0])
    left, rows, end = np.array_split(np.arange(xs.size), count)[::-1], [np.zeros((0, 4))], np.inf
    while left:
        part = left.pop()
        if part.size >= LEAST_IN_BIN and xs[part[-1]] - xs[part[0]] > widest:
            cut = int(np.argmax(np.diff(xs[part]))) + 1
            left += [part[cut:], part[:cut]]
        elif part.size >= LEAST_IN_BIN:
            if xs[part[0]] - end > widest:
                rows.append(np.full((1, 4), np.nan))
            rows.append(np.array([[np.median(xs[part]), *np.percentile(ys[part], (25.0, 50.0, 75.0))]]))
            end = float(xs[part[-1]])
    return Binned(*np.concatenate(rows).T)


def evenly(size: int, most: int = MOST_POINTS) -> IntArray:
    """At most `most` indices spread evenly over `size` samples, ends included."""
    if size <= most:
        return np.arange(size)
    return np.linspace(0, size - 1, most).round().astype(np.int64)


def frame(y: FloatArray, floor: float = 0.0) -> tuple[float, float]:
    """Limits of an axis for y (N,) and +-`floor`: all of y, or about its 0.2 to 99.8 percentiles."""
    finite = y[np.isfinite(y)]
    if finite.size == 0:
        return -1.0, 1.0
    low, high = (float(v) for v in np.percentile(finite, (0.2, 99.8)))
    low, high = min(low, -floor), max(high, floor)
    reach = 0.35 * (high - low)
    low = max(float(finite.min()), low - reach) if float(finite.min()) < low else low
    high = min(float(finite.max()), high + reach) if float(finite.max()) > high else high
    margin = 0.06 * (high - low) or max(abs(high), 1.0) * 0.1
    return low - margin, high + margin


def extreme_samples(series: Sequence[FloatArray], most: int) -> IntArray:
    """Rising indices of the samples that a plot of the series needs, at most `most` and the two ends.

    The samples are cut into equal stretches. Of each stretch the smallest and the largest value of every series stay,
    so that no peak is lost, and all series keep the same samples, so that values at one instant belong together.
    Source: the min-max decimation of oscilloscopes; Jugel et al., M4 (2014), Section 4.

    Args:
        series: One or more (T,) on one clock; NaN takes no part.
        most: Largest number of samples in between the ends, at least two for each series.
    """
    size = series[0].size
    if size <= most:
        return np.arange(size)
    buckets = max(1, most // (2 * len(series)))
    length = -(-size // buckets)
    kept = [np.array([0, size - 1])]
    for values in series:
        padded = np.full(length * buckets, np.nan)
        padded[:size] = values
        table = padded.reshape(buckets, length)
        known = np.flatnonzero(np.isfinite(table).any(axis=1))
        for extreme in (np.nanargmin, np.nanargmax):
            kept.append(known * length + extreme(table[known], axis=1) if known.size else known)
    return np.unique(np.concatenate(kept)).astype(np.int64)
