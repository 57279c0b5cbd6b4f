"""Files to tables: one reader a suffix, in a registry that a user may extend."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
import pyarrow.parquet  # type: ignore[import-untyped]

from drake_tc.config.is_file import is_file, is_folder
from drake_tc.config.utf8_names import utf8_text
from drake_tc.errors import LogError
from drake_tc.logs.bags.reader import SUFFIXES, is_bag, read_bag
from drake_tc.logs.csv_file import read_csv, refuse_repeated, with_texts
from drake_tc.logs.json_log import read_json, read_json_lines
from drake_tc.logs.lerobot import without_lists
from drake_tc.logs.mat_file import Value, read_mat
from drake_tc.logs.npz_file import read_arrays
from drake_tc.logs.sizes import check_size

Reader = Callable[[Path], pd.DataFrame]


def _read_parquet(path: Path) -> pd.DataFrame:
    with path.open("rb") as file:  # Arrow opens no file whose name is not UTF-8
        about = pyarrow.parquet.read_metadata(file)
        check_size(path, path.stat().st_size, 8.0 * about.num_rows * about.num_columns)
        file.seek(0)
        return with_texts(without_lists(pd.read_parquet(file), path))


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
    """A table of columns that must be of one length; the odd ones out are named, and texts among them left out.

    Raises:
        LogError: Columns of different lengths.
    """
    if not columns:
        return pd.DataFrame()
    lengths = {name: int(column.shape[0]) for name, column in columns.items()}
    rows = lengths.get("time", max(lengths.values()))
    texts = [name for name, n in lengths.items() if n != rows and columns[name].dtype.kind in "US"]
    columns = {name: column for name, column in columns.items() if name not in texts}
    odd = {name: n for name, n in lengths.items() if n != rows and name not in texts}
    if odd:
        name, n = next(iter(odd.items()))
        raise LogError(f"{path}: array {name!r} has {n} rows where the others have {rows}; save one row a sample")
    table = pd.DataFrame({name: np.ascontiguousarray(column) for name, column in columns.items()})
    if texts:
        table.attrs["notes"] = [f"The texts {', '.join(map(repr, texts))} are no columns and were left out."]
    return table


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
        ".csv": read_csv,
        ".csv.gz": read_csv,
        ".tsv": read_csv,
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


def read_table(path: Path | str, readers: Mapping[str, Reader] = READERS, needed: Collection[str] = ()) -> pd.DataFrame:
    """Read a log file as it is: names, units and gaps untouched; one row a sample.

    Args:
        path: A .csv, .csv.gz, .tsv, .parquet, .npz, .mat, .json, .json.gz or .jsonl file, or a ROS bag (`bags`). In NPZ
            and MAT every vector is a column, a matrix (T, n) gives `name_0 ...`; MATLAB cannot write a slash, so
            `knee__position` and the struct field `knee.position` both mean `knee/position`. `json_log` has the
            forms of a JSON log.
        readers: Readers by file suffix; pass `{**READERS, ".log": mine}` to add a format.
        needed: Columns that the caller uses. In a bag, the topic with their positions gives the rows.

    Raises:
        LogError: Not a file, an unknown suffix, unreadable content, or no rows.
    """
    path = Path(path)
    if is_folder(path) and is_bag(path):
        return read_bag(path, needed)
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
        read = readers[suffix]
        table = read_bag(path, needed) if read is read_bag else read(path)
    if len(table) == 0:
        raise LogError(f"{path}: no rows; record at least a few seconds of motion")
    names = [str(name).strip() for name in table.columns]
    refuse_repeated(path, names)
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
