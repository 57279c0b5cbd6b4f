"""Vectors in tables of messages: lists in the cells of a text file, and names of the joints in columns of their own.

time, name, position                     time, hip/position, knee/position
0.0, "['hip', 'knee']", "(0.1, 0.2)"  ->  0.0, 0.1, 0.2
time, name0, name1, position0, position1     as `rostopic echo -p` writes them
"""

import re

import numpy as np
import pandas as pd

from drake_tc.logs.names import meaning, names_joints

VECTOR = re.compile(r"\s*(?:array\(\s*(?:'d',)?\s*)?[\[(]([^\[\]()]*)[\])][^\[\]()]*\)?\s*")
"""A list, a tuple or an array as Python or NumPy print them."""
NUMBERED = re.compile(r"(.*?)[_.\[]?(\d+)\]?")


def with_named_vectors(table: pd.DataFrame) -> pd.DataFrame:
    """The table with a column for each member of a vector, called by its joint where the table names them."""
    texts = [name for name in table.columns if pd.api.types.is_string_dtype(table[name]) and table[name].notna().all()]
    joints: dict[str, list[str]] = {}  # by what stands before `name` in the name of the column
    parts, taken = dict[str, pd.Series](), set[str]()
    for name in texts:
        first = str(table[name].iloc[0])
        found = VECTOR.fullmatch(first)
        if found is None:
            continue
        if names_joints(name) and table[name].nunique() == 1:
            joints[_stem(name)] = [each.strip(" '\"") for each in re.split(r"[,\s]+", found[1].strip())]
            taken.add(name)
        elif (values := _numbers(table[name])) is not None:
            taken.add(name)
            parts |= {f"{name}_{i}": pd.Series(column, index=table.index) for i, column in enumerate(values.T)}
    numbered = [(found[1], int(found[2]), name) for name in texts if (found := NUMBERED.fullmatch(name))]
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
    found = NUMBERED.fullmatch(name)
    return found[1] if found else name


def _named(name: str, joints: dict[str, list[str]]) -> str:
    """`hip/position` for `position_0` where the joints beside it are hip, knee, ...; other names as they are."""
    found = NUMBERED.fullmatch(name)
    if found is None or (own := joints.get(_stem(found[1]))) is None or int(found[2]) >= len(own):
        return name
    quantity = found[1][len(_stem(found[1])) :]
    told = meaning(quantity)
    return name if told is None or told.joint else f"{own[int(found[2])]}/{quantity}"


def _numbers(cells: pd.Series) -> np.ndarray | None:
    """(T, n) numbers of vectors as texts; None where a cell is none, or of another length."""
    inside = cells.astype("string").str.extract(f"^{VECTOR.pattern}$", expand=False)
    rows = inside.str.replace(",", " ").str.split()
    if rows.isna().any() or rows.map(len).nunique() != 1:
        return None
    try:
        return np.array(rows.tolist(), dtype=np.float64)
    except ValueError:
        return None
