"""Tables of other forms than one column a channel and one row an instant, brought into this form.

An index of times, and series and arrays that have times of their own (`with_index`, `with_common_times`). Long tables,
whose rows of one joint or signal each are put beside each other (`with_channels_apart`). Vectors in tables of messages,
as lists in the cells of a text file, and names of the joints in columns of their own (`with_named_vectors`):

    time, name, position                     time, hip/position, knee/position
    0.0, "['hip', 'knee']", "(0.1, 0.2)"  ->  0.0, 0.1, 0.2
    time, name0, name1, position0, position1     as `rostopic echo -p` writes them
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from drake_tc.logs.names import meaning, names_joints, time_among, words
from drake_tc.logs.record import MIN_ROWS
from drake_tc.logs.units import is_unit

UNITS = ("units", "unit")
MISSING = re.compile(r"[+-]?(nan(\(\w*\))?|\d\.#\w+|#?n/?a|null|none|missing|-*|\?)", re.IGNORECASE)
"""What programs write in place of a number that they do not have."""


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


OWNERS = (
    *("joint", "motor", "servo", "actuator", "axis", "robot", "arm", "leg", "hand", "side", "name", "node", "device"),
    *("link", "topic", "signal", "variable", "channel", "field", "key"),
)
"""Last words of a column that says of which joint, robot or signal a row is."""
NUMBERED = ("id", "index", "idx", "number", "nr", "no")
"""Words behind one of `OWNERS` where the column holds numbers, as in `motor_id`."""
MOST_OWNERS = 128
"""Different values of such a column."""
VALUES = ("value", "values", "data")
"""Names of a quantity that says nothing: the owner is the whole name of the signal."""


def with_channels_apart(table: pd.DataFrame) -> pd.DataFrame:
    """The table, where rows that are of one joint each, as a column of names says, are put beside each other.

    time, joint, position        time, hip/position, knee/position
    0.00, hip, 0.1          ->   0.00, 0.1, 0.5
    0.00, knee, 0.5
    """
    time = time_among(table.columns) or ""
    keys = [name for name in table.columns if name != time and _is_owner(name, table[name])]
    if not time or not keys or len(table) < 2 * MIN_ROWS:
        return table
    stamps = table[time]
    texts = pd.DataFrame({name: _names_of(table[name]) for name in keys}).agg("/".join, axis=1)
    owners = list(dict.fromkeys(texts.dropna()))
    if len(owners) < 2 or texts.value_counts().min() < MIN_ROWS:
        return table
    if not (stamps[texts == owners[0]].is_monotonic_increasing and stamps[texts == owners[1]].is_monotonic_increasing):
        return table
    spans = [(stamps[texts == owner].min(), stamps[texts == owner].max()) for owner in owners]
    if max(first for first, _ in spans) >= min(last for _, last in spans):
        return table  # one after the other, as the phases of one run
    rest = [name for name in table.columns if name not in (time, *keys)]
    rows = [table[texts == owner] for owner in owners]
    rows = [each[~each[time].duplicated(keep="last")] for each in rows]
    whole = len(rest) == 1 and rest[0].lower() in VALUES
    columns: dict[str, np.ndarray] = {time: rows[0][time].to_numpy()}
    for owner, own in zip(owners, rows, strict=True):
        for name in rest:
            columns[owner if whole else f"{owner}/{name}"] = _at(columns[time], own[time].to_numpy(), own[name])
    apart = pd.DataFrame(columns).dropna(axis=1, how="all")
    apart.attrs = dict(table.attrs)
    if units := table.attrs.get("units"):
        apart.attrs["units"] = {f"{owner}/{name}": unit for owner in owners for name, unit in units.items()} | units
    same = all(np.array_equal(each[time], rows[0][time]) for each in rows)
    note = (
        f"Each row of the file is of one of {len(owners)} owners ({', '.join(owners[:8])}), which"
        f" {' and '.join(map(repr, keys))} names; they were put beside each other"
        + (
            ", at the same times."
            if same
            else f", at the times of {owners[0]}: commands were held, others interpolated."
        )
    )
    apart.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return apart


def _at(times: np.ndarray, own: np.ndarray, values: pd.Series) -> np.ndarray:
    """(T,) values (S,) of the times `own` at other times: the last one of a command or a text, else interpolated."""
    if np.array_equal(times, own):
        return values.to_numpy()
    told = meaning(str(values.name))
    numbers = pd.to_numeric(values, errors="coerce").to_numpy(dtype=np.float64)
    wanted, known = (each.astype("int64" if each.dtype.kind == "M" else np.float64) for each in (times, own))
    inside = (wanted >= known[0]) & (wanted <= known[-1])
    if not np.isfinite(numbers).all() or (told is not None and "command" in told.quantity):
        held = values.to_numpy()[np.maximum(np.searchsorted(known, wanted, side="right") - 1, 0)]
        return np.asarray(pd.Series(held).where(inside))
    return np.where(inside, np.interp(wanted, known, numbers), np.nan)


def _names_of(values: pd.Series) -> pd.Series:
    """The texts of a column; `motor_1` for the number 1 in `motor_id`."""
    texts = values.astype("string")
    if not pd.api.types.is_integer_dtype(values):
        return texts
    return f"{words(str(values.name))[-2].lower()}_" + texts


def _is_owner(name: str, values: pd.Series) -> bool:
    """Whether a column says of which joint, robot or signal each row is."""
    said = [word.lower() for word in words(name)]
    numbered = len(said) > 1 and said[-1] in NUMBERED and said[-2] in OWNERS
    of_numbers = pd.api.types.is_integer_dtype(values) and numbered
    of_texts = (pd.api.types.is_object_dtype(values) or pd.api.types.is_string_dtype(values)) and bool(said)
    of_texts = of_texts and (numbered or said[-1] in OWNERS)
    if not (of_numbers or of_texts):
        return False
    different = values.nunique()
    letters = of_numbers or values.dropna().map(
        lambda each: isinstance(each, str) and bool(re.search("[A-Za-z]", each))
    )
    return bool(1 < different <= MOST_OWNERS and np.all(letters))


VECTOR = re.compile(r"\s*(?:array\(\s*(?:'d',)?\s*)?[\[(]([^\[\]()]*)[\])][^\[\]()]*\)?\s*")
"""A list, a tuple or an array as Python or NumPy print them."""
OF_NUMPY = re.compile(r"np\.\w+\(([^()]*)\)")
"""A number in such a list, as NumPy 2 prints it."""
NUMBERED_NAME = re.compile(r"(.*?)[_.\[]?(\d+)\]?")


def with_named_vectors(table: pd.DataFrame) -> pd.DataFrame:
    """The table with a column for each member of a vector, called by its joint where the table names them."""
    texts = {name: first for name in table.columns if (first := _first_text(table[name]))}
    joints: dict[str, list[str]] = {}  # by what stands before `name` in the name of the column
    parts, taken = dict[str, pd.Series](), set[str]()
    for name, first in texts.items():
        found = VECTOR.fullmatch(first)
        if found is None:
            continue
        if names_joints(name) and table[name].nunique() == 1:
            joints[_stem(name)] = [each.strip(" '\"") for each in re.split(r"[,\s]+", found[1].strip())]
            taken.add(name)
        elif (values := _numbers(table[name])) is not None:
            taken.add(name)
            parts |= {f"{name}_{i}": pd.Series(column, index=table.index) for i, column in enumerate(values.T)}
    numbered = [(found[1], int(found[2]), name) for name in texts if (found := NUMBERED_NAME.fullmatch(name))]
    for owner in dict.fromkeys(owner for owner, _, _ in numbered if names_joints(owner)):
        own = {number: name for each, number, name in numbered if each == owner and table[name].nunique() == 1}
        if sorted(own) == list(range(len(own))):
            joints[_stem(owner)] = [str(table[own[i]].iloc[0]) for i in range(len(own))]
            taken |= set(own.values())
    mixed = [name for name in texts if names_joints(_without_number(name)) and table[name].nunique() > 1]
    if mixed and any(_without_number(name) != name for name in table.columns if name not in mixed):
        told = (
            f"The names in {mixed[0]!r} change from row to row: the vectors beside it are of other joints in each row."
        )
        table.attrs["hints"] = [*table.attrs.get("hints", ()), told]
    if not taken:
        return table
    columns = {name: table[name] for name in table.columns if name not in taken} | parts
    named = {name: _named(name, joints) for name in columns}
    if len(set(named.values())) < len(named):
        return table
    out = pd.DataFrame({named[name]: column for name, column in columns.items()})
    out.attrs = dict(table.attrs)
    if units := table.attrs.get("units"):
        out.attrs["units"] = {named.get(name, name): unit for name, unit in units.items()}
    return out


def _stem(name: str) -> str:
    """What stands before `name` or `joint_names`."""
    return name[: len(name) - len(re.split("[/.]", name)[-1])]


def _without_number(name: str) -> str:
    found = NUMBERED_NAME.fullmatch(name)
    return found[1] if found else name


def _named(name: str, joints: dict[str, list[str]]) -> str:
    """`hip/position` for `position_0` where the joints beside it are hip, knee, ...; other names as they are."""
    found = NUMBERED_NAME.fullmatch(name)
    if found is None or (own := joints.get(_stem(found[1]))) is None or int(found[2]) >= len(own):
        return name
    quantity = found[1][len(_stem(found[1])) :]
    told = meaning(quantity)
    return name if told is None or told.joint else f"{own[int(found[2])]}/{quantity}"


def _first_text(cells: pd.Series) -> str:
    """The first cell that is not missing, if it is a text; else an empty one."""
    if pd.api.types.is_numeric_dtype(cells) or pd.api.types.is_datetime64_any_dtype(cells):
        return ""
    known = (cell for cell in cells if isinstance(cell, str) and not MISSING.fullmatch(cell.strip()))
    return OF_NUMPY.sub(r"\1", next(known, ""))


def _numbers(cells: pd.Series) -> np.ndarray | None:
    """(T, n) numbers of vectors as texts, NaN where a cell is missing; None where one is no vector, or of another n."""
    texts = cells.astype("string").str.replace(OF_NUMPY, r"\1", regex=True)
    known = ~(texts.isna() | texts.str.fullmatch(MISSING)).to_numpy(bool)
    inside = texts[known].str.extract(f"^{VECTOR.pattern}$", expand=False)
    rows = inside.str.replace(",", " ").str.split()
    if rows.isna().any() or rows.map(len).nunique() != 1:
        return None
    values = np.full((len(cells), len(rows.iloc[0])), np.nan)
    try:
        values[known] = rows.tolist()
    except ValueError:
        return None
    return values
