"""Tables and arrays whose times are not a column: an index of times, and series that have times of their own."""

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from drake_tc.logs.units import is_unit

UNITS = ("units", "unit")


def with_index(table: pd.DataFrame) -> pd.DataFrame:
    """The table with an index of names or times as columns; row numbers and labels without a name are left out.

    A column below several names, as those of a `MultiIndex`, is called `hip/position`; dates and times without a name
    are the time. Durations are in seconds.
    """
    index = table.index
    named = any(name is not None for name in index.names)
    of_times = isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex)
    if of_times and not named:
        table = table.rename_axis("time")
    names = [name if isinstance(name, tuple) else (name,) for name in table.columns]
    table = table.set_axis(["/".join(str(each) for each in name if str(each)) for name in names], axis=1)
    table = table.reset_index(drop=not (named or of_times))
    table.attrs = {}  # those of the owner are not those of the readers
    for name in table.columns[[pd.api.types.is_timedelta64_dtype(kind) for kind in table.dtypes]]:
        table[name] = table[name].dt.total_seconds()
    return table


def without_structs(table: pd.DataFrame) -> pd.DataFrame:
    """The table with `state/position` in place of a column `state` of mappings."""
    parts = []
    for name in table.columns:
        cells = table[name]
        if pd.api.types.is_object_dtype(cells) and len(cells) and cells.map(lambda cell: isinstance(cell, dict)).all():
            parts.append(pd.json_normalize(cells.tolist(), sep="/").add_prefix(f"{name}/").set_axis(table.index))
        else:
            parts.append(table[[name]])
    return pd.concat(parts, axis=1) if parts else table


CLOCK = re.compile(
    r"(.*[\sT_-])?(\d{1,2}:\d{2}:\d{2}([.,]\d+)?)(\s*[ap]m)?(\s*(Z|UTC|[+-]\d{2}:?\d{2}))?", re.IGNORECASE
)
"""A time of day, perhaps behind a date."""
DAY = 86400.0


def with_dates(table: pd.DataFrame) -> pd.DataFrame:
    """The table with dates in place of their texts, whatever their form; a time of day alone is in seconds.

    After midnight a time of day goes on.
    """
    for name in table.columns[[pd.api.types.is_string_dtype(kind) for kind in table.dtypes]]:
        first = next((cell for cell in table[name].head(MOST_EMPTY) if isinstance(cell, str) and cell.strip()), "")
        found = CLOCK.fullmatch(first.strip())
        if found is None or (found[1] is None and (found[4] or found[5])):
            continue
        texts = table[name].astype("string").str.strip().str.replace(",", ".")
        if found[1] is None:
            seconds = pd.to_timedelta(texts, errors="coerce").dt.total_seconds().to_numpy(dtype=np.float64)
            days = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -0.5 * DAY)
            read: pd.Series = pd.Series(seconds + DAY * days, index=table.index)
        else:
            read = pd.to_datetime(texts, errors="coerce", utc=True, format="ISO8601")
            if not read.notna().any():
                read = pd.to_datetime(texts, errors="coerce", utc=True, format="mixed")
            read = read.dt.tz_localize(None)
        if read.notna().equals(texts.notna()):
            table[name] = read
    return table


MOST_EMPTY = 1000
"""Rows at the beginning among which a first text is looked for."""


def of_series(series: Sequence[pd.Series], time: str) -> pd.DataFrame:
    """One row for each time of any series, which are indexed by times; where a series has no value, there is NaN.

    Of several values at one time the last one counts.
    """
    series = [each[~each.index.duplicated(keep="last")] for each in series]
    if all(each.index.equals(series[0].index) for each in series):
        table = pd.DataFrame({each.name: each.to_numpy() for each in series})
        table.insert(0, time, series[0].index.to_numpy())
        return table
    joined: pd.DataFrame = pd.concat(series, axis=1, sort=True)
    return joined.reset_index(names=time)


def with_common_times(arrays: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """The arrays, where `NAME/Time` and `NAME/Data` of a series are `time` and `NAME`, and notes on it.

    This is how MATLAB writes a `timeseries` as a struct, and a scope of Simulink its signals (`values` in place of
    `Data`). A text `NAME/Units` or `NAME/DataInfo/Units` is the unit. Series of different times get the rows of all.
    """
    parts = {name: name.rpartition("/") for name in arrays}
    owners = {owner: name for name, (owner, _, last) in parts.items() if owner and last.lower() in ("data", "values")}
    shortest = {owner: owner.rpartition("/")[2] for owner in owners}
    unique = len(set(shortest.values())) == len(owners)
    times = {owner: name for name, (owner, _, last) in parts.items() if owner in owners and last.lower() == "time"}
    found, series, used = dict(arrays), list[pd.Series](), set[str]()
    for owner, name in owners.items():
        texts = [each for each in arrays if each.startswith(f"{owner}/") and arrays[each].dtype.kind == "U"]
        unit = next((str(arrays[each].item()) for each in texts if parts[each][2].lower() in UNITS), "")
        called = (shortest[owner] if unique else owner) + (f" [{unit}]" if is_unit(unit) or len(unit) == 1 else "")
        value, stamps = np.squeeze(arrays[name]), np.squeeze(arrays[times[owner]]) if owner in times else None
        used |= {name, *(each for each in arrays if each.startswith(f"{owner}/") and arrays[each].size < 2)}
        if stamps is None or stamps.ndim != 1 or stamps.size not in value.shape:
            found[called] = value
            continue
        used.add(times[owner])
        value = value if value.shape[0] == stamps.size else np.moveaxis(value, -1, 0)
        columns = value.reshape(stamps.size, -1).T
        names = [called] if len(columns) == 1 else [f"{called}_{number}" for number in range(len(columns))]
        series += [pd.Series(each, index=stamps, name=n) for each, n in zip(columns, names, strict=True)]
    found = {name: value for name, value in found.items() if name not in used}
    if not series:
        return found, []
    table = of_series(series, "time")
    same = len(table) == len(series[0])
    note = f"The rows are the times of all {len(series)} series, which differ." if not same else ""
    return {str(name): table[name].to_numpy() for name in table.columns} | found, [note] if note else []
