"""CSV files in which each channel has a time column of its own, as oscilloscopes and drive tools write them.

position [rad],,current [A],,          Time [s],position,Time [s],current
X,Y,X,Y,                       or      0.000,0.10,0.0000,0.5
0.000,0.10,0.0000,0.5
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from drake_tc.logs.inspection.names import meaning

X_NAMES = ("x", "t", "time")
"""Small letters of what a line below the names calls the times."""


class Pairs(NamedTuple):
    """Where the channels of such a file are.

    Attributes:
        time: Name of the time.
        channels: By channel, its name, the place of its times, and its own place.
        lines: Lines above the first row of data.
    """

    time: str
    channels: tuple[tuple[str, int, int], ...]
    lines: int


def pairs_of(rows: Sequence[Sequence[str]]) -> Pairs | None:
    """Where the channels are, if each has times of its own; None for other files.

    Args:
        rows: The cells of the first lines.
    """
    if not rows:
        return None
    return _with_a_line_of_axes(rows) or _with_repeated_times(rows[0])


def _with_a_line_of_axes(rows: Sequence[Sequence[str]]) -> Pairs | None:
    """Names over every second column, and below them `X, Y, X, Y`."""
    if len(rows) < 2:
        return None
    axes = [cell.lower() for cell in rows[1]]
    while axes and not axes[-1]:
        axes.pop()
    x, y = (axes[0], axes[1]) if len(axes) > 1 else ("", "")
    if len(axes) % 2 or x not in X_NAMES or x == y or axes != [x, y] * (len(axes) // 2):
        return None
    names = [*rows[0], *[""] * (len(axes) - len(rows[0]))]
    named = [names[i] or names[i + 1] for i in range(0, len(axes), 2)]
    channels = tuple((name, 2 * i, 2 * i + 1) for i, name in enumerate(named) if name)
    return Pairs("time", channels, 2) if channels else None


def _with_repeated_times(names: Sequence[str]) -> Pairs | None:
    """One name that is called like a time stands before each channel, or before several of one clock."""
    repeated = {name for name, count in Counter(names).items() if name and count > 1}
    if len(repeated) != 1 or names[0] not in repeated:
        return None
    (time,) = repeated
    told = meaning(time)
    if time.lower() not in X_NAMES and (told is None or told.quantity != "time"):
        return None
    at, channels = 0, []
    for place, name in enumerate(names):
        if name == time:
            at = place
        elif name:
            channels.append((name, at, place))
    return Pairs(time, tuple(channels), 1)


def of_pairs(cells: pd.DataFrame, pairs: Pairs) -> pd.DataFrame:
    """One row for each time of any channel; where a channel has no value at this time, there is NaN.

    Args:
        cells: (T, 2n) numbers below the names.
        pairs: Where the channels are.
    """
    series = []
    for name, x, y in pairs.channels:
        times = pd.to_numeric(cells.iloc[:, x], errors="coerce").to_numpy(dtype=np.float64)
        own = pd.Series(cells.iloc[:, y].to_numpy(), index=times, name=name)
        own = own[np.isfinite(times)]
        series.append(own[~own.index.duplicated(keep="last")])
    if all(each.index.equals(series[0].index) for each in series):
        table = pd.DataFrame({each.name: each.to_numpy() for each in series})
        table.insert(0, pairs.time, series[0].index.to_numpy())
    else:
        joined = pd.concat(series, axis=1, sort=True)
        table = joined.reset_index(names=pairs.time)
    table.attrs["notes"] = [
        f"Each of the {len(series)} channels has its own time column; the rows are the times of all channels."
    ]
    return table
