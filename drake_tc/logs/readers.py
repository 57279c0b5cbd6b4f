"""Files to tables: one reader a suffix, in a registry that a user may extend."""

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import IO

import numpy as np
import pandas as pd
import pyarrow.parquet  # type: ignore[import-untyped]

from drake_tc.config.is_file import is_file, is_folder
from drake_tc.config.quoted import quoted
from drake_tc.config.utf8_names import utf8_text
from drake_tc.errors import LogError
from drake_tc.logs.bags.reader import SUFFIXES, is_bag, read_bag
from drake_tc.logs.csv_header import check_encoding, check_names_are_words
from drake_tc.logs.decimal_comma import with_decimal_points
from drake_tc.logs.json_log import read_json, read_json_lines
from drake_tc.logs.lerobot import without_lists
from drake_tc.logs.mat_file import Value, read_mat
from drake_tc.logs.npz_file import read_arrays
from drake_tc.logs.sizes import check_size, unpacked_gzip

Reader = Callable[[Path], pd.DataFrame]
Opener = Callable[[], IO[bytes]]

LONGEST_HEADER = 2**24
"""Of the first line of a CSV file [bytes]."""


def _separator(opened: Opener) -> str:
    """The character that splits the header: a comma unless there is none but a semicolon or a tab."""
    with opened() as file:
        header = file.readline(LONGEST_HEADER).decode("utf-8", errors="replace")
    return next((mark for mark in (",", ";", "\t") if mark in header), ",")


def _check_names(path: Path, opened: Opener, separator: str) -> None:
    """Refuse a header of numbers, and one with a name that stands twice, which pandas would rename in silence.

    Raises:
        LogError: names the column, or the number.
    """
    with opened() as file:
        names = [name.strip() for name in next(csv.reader(_lines(file), delimiter=separator), [])]
    check_names_are_words(path, names)
    _refuse_repeated(path, [name for name in names if name])


def _refuse_repeated(path: Path, names: list[str]) -> None:
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise LogError(f"{path}: column {quoted(twice)} stands more than once; give each column a name of its own")


def _check_cells(path: Path, opened: Opener, separator: str, width: int) -> None:
    """Refuse single rows with more cells than the others and than the header has names; empty cells do not count.

    Where every row has a cell more than the header, the last column has no name, and is not read.

    Raises:
        LogError: names the line.
    """
    lengths: Counter[int] = Counter()
    first: dict[int, int] = {}
    with opened() as file:
        for row in (rows := csv.reader(_lines(file), delimiter=separator)):
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


def _lines(file: IO[bytes]) -> IO[str]:
    return io.TextIOWrapper(file, encoding="utf-8", errors="replace", newline="")


def _opener(path: Path) -> Opener:
    """Opens the content of a file, unpacked where it is packed."""
    if not path.name.lower().endswith(".gz"):
        return lambda: path.open("rb")
    content = unpacked_gzip(path)
    return lambda: io.BytesIO(content)


def _read_csv(path: Path) -> pd.DataFrame:
    opened = _opener(path)
    with opened() as file:
        check_encoding(path, file.read(4))
    separator = _separator(opened)
    return with_decimal_points(_cells(path, opened, separator), separator)


def _cells(path: Path, opened: Opener, separator: str) -> pd.DataFrame:
    _check_names(path, opened, separator)
    try:
        with opened() as file:
            return _with_texts(pd.read_csv(file, sep=separator, engine="pyarrow"))
    except (pd.errors.ParserError, ValueError):
        # rows of uneven length, or bytes that are not UTF-8: the C parser drops what lies beyond the header
        with opened() as file:
            width = pd.read_csv(file, sep=separator, nrows=0, index_col=False, encoding_errors="replace").shape[1]
        _check_cells(path, opened, separator, width)
        columns = list(range(width))
        with opened() as file:
            return pd.read_csv(
                file,
                sep=separator,
                skipinitialspace=True,
                index_col=False,
                usecols=columns,
                low_memory=False,
                encoding_errors="replace",
            )


def _with_texts(table: pd.DataFrame) -> pd.DataFrame:
    """The table with texts in place of bytes, which Arrow keeps where they are not UTF-8.

    Raises:
        ArrowException: Texts that are declared as UTF-8 and are not.
    """
    for name in table.columns[[pd.api.types.is_string_dtype(kind) for kind in table.dtypes]]:
        table[name] = table[name].to_numpy(dtype=object)
    for name in table.columns[[pd.api.types.is_object_dtype(kind) for kind in table.dtypes]]:
        table[name] = [c.decode("utf-8", errors="replace") if isinstance(c, bytes) else c for c in table[name]]
    return table


def _read_parquet(path: Path) -> pd.DataFrame:
    with path.open("rb") as file:  # Arrow opens no file whose name is not UTF-8
        about = pyarrow.parquet.read_metadata(file)
        check_size(path, path.stat().st_size, 8.0 * about.num_rows * about.num_columns)
        file.seek(0)
        return _with_texts(without_lists(pd.read_parquet(file), path))


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
    for name, values in read_arrays(path).items():
        columns |= _columns_of(name, values)
    return _table(path, columns)


def _flatten(prefix: str, value: Value) -> Iterator[tuple[str, np.ndarray]]:
    """Columns of a MATLAB value: the fields of a struct become `struct/field`, a double underscore a slash."""
    if isinstance(value, dict):
        for field, inner in value.items():
            yield from _flatten(f"{prefix}/{field}", inner)
    else:
        yield from _columns_of(prefix.replace("__", "/"), value).items()


def _read_mat(path: Path) -> pd.DataFrame:
    found = read_mat(path).items()
    return _table(path, dict(pair for name, value in found for pair in _flatten(name, value)))


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
    """The file's name without the ending that names its format; what is not UTF-8 in it is replaced by U+FFFD."""
    suffix = _suffix(path, readers)
    name = path.name[: -len(suffix)] if suffix else path.stem
    return utf8_text(name)


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
    if is_folder(path) and is_bag(path):
        return read_bag(path)
    if is_folder(path):
        files = ", ".join(sorted(each.name for each in path.iterdir() if is_bag(each)))
        what = f"give the file of a bag in it ({files})" if files else "expected a log file or the folder of a ROS bag"
        raise LogError(f"{path}: a folder without metadata.yaml; {what}")
    if not is_file(path):
        raise LogError(f"{path}: no such log file")
    suffix = _suffix(path, readers)
    if not suffix:
        ending = "".join(path.suffixes[-2:]) or "no ending"
        raise LogError(f"{path}: unknown kind of log file ({ending}); readable: {', '.join(sorted(readers))}")
    with _refused(path, suffix):
        table = readers[suffix](path)
    if len(table) == 0:
        raise LogError(f"{path}: no rows; record at least a few seconds of motion")
    names = [str(name).strip() for name in table.columns]
    _refuse_repeated(path, names)
    table.columns = pd.Index(names)
    return table


@contextmanager
def _refused(path: Path, suffix: str) -> Iterator[None]:
    """Whatever the reader of a format says against a file, as one line.

    Parsers raise errors of any kind for a damaged file; none of them is a defect of what called them.

    Raises:
        LogError: the file cannot be read.
    """
    try:
        yield
    except LogError:
        raise
    except pd.errors.EmptyDataError:
        raise LogError(f"{path}: no rows; record at least a few seconds of motion") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read as {suffix}: {_reason(error.strerror or str(error))}") from None
    except UnicodeDecodeError as error:
        raise LogError(
            f"{path}: cannot be read as {suffix}: byte {error.start} is not UTF-8; save the file in UTF-8"
        ) from None
    except MemoryError:
        raise LogError(f"{path}: cannot be read as {suffix}: it does not fit into the memory") from None
    except Exception as error:
        raise LogError(f"{path}: cannot be read as {suffix}: {_reason(str(error))}") from error


def _reason(text: str) -> str:
    """The first line of another library's message."""
    return next((line.strip() for line in text.splitlines() if line.strip()), "it is damaged")
