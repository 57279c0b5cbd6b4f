"""What every importer does with files: find the set's, read a table, write a canonical log."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.errors import LogError
from drake_tc.logs.readers import read_table, run_name
from drake_tc.types import FloatArray

__all__ = ["find", "floats", "read_table", "run_name", "write_log"]


def find(src: Path, *patterns: str) -> list[Path]:
    """The set's files in the folder `src` that match any of the patterns, sorted.

    Raises:
        LogError: Not a folder, or nothing in it matches.
    """
    if not src.is_dir():
        raise LogError(f"{src}: wanted the folder of a data set, and there is none")
    found = sorted({path for pattern in patterns for path in src.glob(pattern)})
    if not found:
        raise LogError(f"{src}: none of the set's files is here; wanted {' or '.join(patterns)}")
    return found


def floats(table: pd.DataFrame, name: str, path: Path) -> FloatArray:
    """One column (T,) as floats.

    Raises:
        LogError: No such column, or not numbers: then it is another data set.
    """
    if name not in table.columns:
        have = ", ".join(map(str, table.columns[:12]))
        raise LogError(f"{path}: no column {name!r}, so not a file of this data set; columns here: {have}")
    try:
        return table[name].to_numpy(dtype=np.float64, na_value=np.nan)
    except (TypeError, ValueError):
        raise LogError(f"{path}: column {name!r} is not numeric") from None


def write_log(columns: Mapping[str, np.ndarray], path: Path) -> Path:
    """Write canonical columns (T,) as a Parquet log, making the folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(dict(columns)).to_parquet(path, index=False)
    return path
