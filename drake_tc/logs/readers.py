"""Files to tables: one reader a suffix, in a registry that a user may extend."""

import csv
import gzip
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import IO

import numpy as np
import pandas as pd
import scipy.io

from drake_tc.errors import LogError
from drake_tc.logs.bags.reader import SUFFIXES, is_bag, read_bag
from drake_tc.logs.json_log import read_json, read_json_lines
from drake_tc.logs.lerobot import without_lists

Reader = Callable[[Path], pd.DataFrame]


def _separator(path: Path) -> str:
    """The character that splits the header: a comma unless there is none but a semicolon or a tab."""
    header = pd.read_csv(path, sep="\x00", header=None, nrows=1, engine="c", dtype=str)
    text = "" if header.empty else str(header.iat[0, 0])
    return next((mark for mark in (",", ";", "\t") if mark in text), ",")


def _check_names(path: Path, separator: str) -> None:
    """Refuse a header with a name that stands twice; pandas would rename the second in silence.

    Raises:
        LogError: names the column.
    """
    with _opened(path) as file:
        names = [name.strip() for name in next(csv.reader(file, delimiter=separator), [])]
    twice = next((name for name in names if name and names.count(name) > 1), None)
    if twice is not None:
        raise LogError(f"{path}: column {twice!r} stands more than once; give each column a name of its own")


def _check_cells(path: Path, separator: str, width: int) -> None:
    """Refuse single rows with more cells than the others and than the header has names; empty cells do not count.

    Where every row has a cell more than the header, the last column has no name, and is not read.

    Raises:
        LogError: names the line.
    """
    lengths: Counter[int] = Counter()
    first: dict[int, int] = {}
    with _opened(path) as file:
        for row in (rows := csv.reader(file, delimiter=separator)):
            filled = max((i + 1 for i, cell in enumerate(row) if cell.strip()), default=0)
            lengths[filled] += 1
            first.setdefault(filled, rows.line_num)
    expected = max(width, lengths.most_common(1)[0][0])
    longer = [first[length] for length in lengths if length > expected]
    if longer:
        line = min(longer)
        cells = next(length for length, at in first.items() if at == line)
        raise LogError(
            f"{path}: line {line} has {cells} cells, and the header {width} names; expected one cell a column"
            " (a decimal comma, or a separator inside a text, makes two of one)"
        )


def _opened(path: Path) -> IO[str]:
    """The text of a file, packed or not."""
    if path.name.lower().endswith(".gz"):
        return gzip.open(path, "rt", encoding="utf-8", errors="replace", newline="")
    return path.open(encoding="utf-8", errors="replace", newline="")


def _read_csv(path: Path) -> pd.DataFrame:
    separator = _separator(path)
    _check_names(path, separator)
    try:
        return pd.read_csv(path, sep=separator, engine="pyarrow")
    except (pd.errors.ParserError, ValueError):
        # rows of uneven length: the C parser drops what lies beyond the header
        width = range(pd.read_csv(path, sep=separator, nrows=0, index_col=False).shape[1])
        _check_cells(path, separator, len(width))
        return pd.read_csv(
            path, sep=separator, skipinitialspace=True, index_col=False, usecols=list(width), low_memory=False
        )


def _read_parquet(path: Path) -> pd.DataFrame:
    return without_lists(pd.read_parquet(path), path)


def _columns_of(name: str, value: np.ndarray) -> dict[str, np.ndarray]:
    """One column for a vector, `name_0, name_1, ...` for a matrix (samples first); scalars are no columns."""
    array = np.squeeze(value)
    if array.ndim == 1 and array.size > 1:
        return {name: array}
    if array.ndim == 2:
        return {f"{name}_{i}": array[:, i] for i in range(array.shape[1])}
    if value.size == 0:
        return {name: np.empty(0)}
    return {}


def _table(path: Path, columns: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """A table of columns that must be of one length; the odd ones out are named.

    Raises:
        LogError: Columns of different lengths.
    """
    if not columns:
        return pd.DataFrame()
    lengths = {name: int(column.shape[0]) for name, column in columns.items()}
    rows = lengths.get("time", max(lengths.values()))
    odd = {name: n for name, n in lengths.items() if n != rows}
    if odd:
        name, n = next(iter(odd.items()))
        raise LogError(f"{path}: array {name!r} has {n} rows where the others have {rows}; save one row a sample")
    return pd.DataFrame({name: np.ascontiguousarray(column) for name, column in columns.items()})


def _read_npz(path: Path) -> pd.DataFrame:
    columns: dict[str, np.ndarray] = {}
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            columns |= _columns_of(name, archive[name])
    return _table(path, columns)


def _flatten(prefix: str, value: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of a MATLAB value: the fields of a struct become `struct/field`, a double underscore a slash."""
    if value.dtype.names and value.size == 1:
        columns: dict[str, np.ndarray] = {}
        for field in value.dtype.names:
            inner = np.asarray(value[field].item())
            columns |= _flatten(f"{prefix}/{field}", inner)
        return columns
    return _columns_of(prefix.replace("__", "/"), value)


def _read_mat(path: Path) -> pd.DataFrame:
    try:
        content = scipy.io.loadmat(path)
    except NotImplementedError:
        raise LogError(f"{path}: MATLAB 7.3 file; save it with '-v7', or as CSV, Parquet or NPZ") from None
    columns: dict[str, np.ndarray] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            columns |= _flatten(name, np.asarray(value))
    return _table(path, columns)


READERS: Mapping[str, Reader] = MappingProxyType(
    {
        ".csv": _read_csv,
        ".csv.gz": _read_csv,
        ".parquet": _read_parquet,
        ".npz": _read_npz,
        ".mat": _read_mat,
        ".json": read_json,
        ".json.gz": read_json,
        ".jsonl": read_json_lines,
        **dict.fromkeys(SUFFIXES, read_bag),
    }
)


def run_name(path: Path, readers: Mapping[str, Reader] = READERS) -> str:
    """The file's name without the ending that names its format."""
    suffix = _suffix(path, readers)
    return path.name[: -len(suffix)] if suffix else path.stem


def _suffix(path: Path, readers: Mapping[str, Reader]) -> str:
    """The longest known ending of the file's name, or an empty string."""
    name = path.name.lower()
    return max((suffix for suffix in readers if name.endswith(suffix)), key=len, default="")


def read_table(path: Path | str, readers: Mapping[str, Reader] = READERS) -> pd.DataFrame:
    """Read a log file as it is: names, units and gaps untouched; one row a sample.

    Args:
        path: A .csv, .csv.gz, .parquet, .npz, .mat, .json, .json.gz or .jsonl file, or a ROS bag (`bags`). In NPZ and
            MAT every vector is a column, a matrix (T, n) gives `name_0 ...`; MATLAB cannot write a slash, so
            `knee__position` and the struct field `knee.position` both mean `knee/position`. `json_log` has the
            forms of a JSON log.
        readers: Readers by file suffix; pass `{**READERS, ".log": mine}` to add a format.

    Raises:
        LogError: Not a file, an unknown suffix, unreadable content, or no rows.
    """
    path = Path(path)
    if path.is_dir() and is_bag(path):
        return read_bag(path)
    if not path.is_file():
        raise LogError(f"{path}: no such log file")
    suffix = _suffix(path, readers)
    if not suffix:
        ending = "".join(path.suffixes[-2:]) or "no ending"
        raise LogError(f"{path}: unknown kind of log file ({ending}); readable: {', '.join(sorted(readers))}")
    try:
        table = readers[suffix](path)
    except LogError:
        raise
    except pd.errors.EmptyDataError:
        raise LogError(f"{path}: no rows; record at least a few seconds of motion") from None
    except (
        OSError,
        ValueError,
        EOFError,
        KeyError,
        TypeError,
        zipfile.BadZipFile,
        ArithmeticError,
        csv.Error,
    ) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise LogError(f"{path}: cannot be read as {suffix}: {reason}") from error
    if len(table) == 0:
        raise LogError(f"{path}: no rows; record at least a few seconds of motion")
    names = [str(name).strip() for name in table.columns]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise LogError(f"{path}: column {twice[0]!r} stands more than once; give each column a name of its own")
    table.columns = pd.Index(names)
    return table
