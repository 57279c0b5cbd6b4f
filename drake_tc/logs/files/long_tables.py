"""Long tables: rows of one joint or signal each, which a column names, are put beside each other."""

import re

import numpy as np
import pandas as pd

from drake_tc.logs.checks.clock import MIN_ROWS
from drake_tc.logs.names import meaning, words

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
    time = next((name for name in table.columns if (told := meaning(name)) is not None and told.quantity == "time"), "")
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
