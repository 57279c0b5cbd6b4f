"""Parquet files of LeRobot data sets: columns of lists, whose members `meta/info.json` names."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drake_tc.errors import LogError

INFO = Path("meta") / "info.json"
"""Of a data set, relative to its folder."""


def without_lists(table: pd.DataFrame, path: Path) -> pd.DataFrame:
    """The table with each column of lists (n a row) as n columns `name/MEMBER`; others stay.

    Members have the names that the data set's `meta/info.json` gives them, without them numbers. Of a file with several
    episodes only one can be a run.

    Raises:
        LogError: lists of different lengths in one column, or more than one episode.
    """
    objects = [name for name in table.columns if pd.api.types.is_object_dtype(table[name])]
    lists = [name for name in objects if table[name].map(_is_list).all() and len(table)]
    if not lists:
        return table
    if "episode_index" in table and table["episode_index"].nunique() > 1:
        first, last = table["episode_index"].min(), table["episode_index"].max()
        raise LogError(
            f"{path}: episodes {first} to {last} in one file; expected one run a file; split it by its column"
            " episode_index"
        )
    features = _features(path)
    parts: list[pd.DataFrame] = []
    for name in table.columns:
        if name not in lists:
            parts.append(table[[name]])
            continue
        lengths = table[name].map(len)
        if lengths.nunique() > 1:
            raise LogError(
                f"{path}: column {name!r} holds lists of {lengths.min()} to {lengths.max()} numbers; expected one"
                " length"
            )
        members = _members(features.get(str(name), {}).get("names"), int(lengths.iloc[0]))
        values = np.stack([np.asarray(row, dtype=np.float64) for row in table[name]])
        parts.append(pd.DataFrame(values, columns=[_name(str(name), member) for member in members], index=table.index))
    return pd.concat(parts, axis=1)


def _is_list(value: Any) -> bool:
    return isinstance(value, list | np.ndarray) and all(np.isscalar(each) for each in value)


def _name(column: str, member: str) -> str:
    """`elbow.pos` of `observation.state` is `elbow/pos`; of `action` it is `elbow/pos_command`."""
    joint, _, quantity = member.rpartition(".")
    if not joint:
        return f"{column}/{member}"
    return f"{joint}/{quantity}_command" if column == "action" else f"{joint}/{quantity}"


def _members(names: Any, size: int) -> list[str]:
    """Names of the members of a list; older data sets have them below a key such as "motors"."""
    if isinstance(names, dict):
        names = next(iter(names.values()), None)
    if isinstance(names, list) and len(names) == size and all(isinstance(name, str) for name in names):
        return list(names)
    return [str(i) for i in range(size)]


def _features(path: Path) -> dict[str, Any]:
    """Of `meta/info.json`, in one of the folders above the file; nothing where there is none."""
    for folder in path.resolve().parents:
        if (folder / INFO).is_file():
            try:
                found = json.loads((folder / INFO).read_text(encoding="utf-8")).get("features", {})
            except (OSError, ValueError, AttributeError):
                return {}
            return found if isinstance(found, dict) else {}
    return {}
