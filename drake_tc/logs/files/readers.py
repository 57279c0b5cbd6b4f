"""Logs to tables: files by one reader a suffix, in a registry that a user may extend, and tables in memory."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.ipc  # type: ignore[import-untyped]
import pyarrow.parquet  # type: ignore[import-untyped]

from drake_tc.config.files import check_size, is_file, is_folder, utf8_text
from drake_tc.config.quoted import quoted
from drake_tc.errors import LogError
from drake_tc.logs.checks.clock import stated_period, with_counters_unwrapped, with_times, with_whole_stamps
from drake_tc.logs.files.array_files import read_array, read_arrays, read_mat
from drake_tc.logs.files.bag import SUFFIXES, is_bag, read_bag
from drake_tc.logs.files.csv_file import read_csv, refuse_repeated, with_texts
from drake_tc.logs.files.episodes import (
    Source,
    episodes_of_arrays,
    is_data_set,
    read_data_set,
    source_of,
    with_episodes_apart,
    with_times_told,
    without_lists,
)
from drake_tc.logs.files.json_log import read_json, read_json_lines
from drake_tc.logs.files.mcap_messages import is_without_ros, read_messages
from drake_tc.logs.files.table_forms import (
    with_channels_apart,
    with_common_times,
    with_dates,
    with_index,
    with_named_vectors,
    without_structs,
)
from drake_tc.logs.names import member, names_joints, time_among
from drake_tc.logs.record import MIN_ROWS

Reader = Callable[[Path], pd.DataFrame]


@dataclass(frozen=True, eq=False)
class LogTable:
    """A log in memory.

    Attributes:
        name: What messages and results call it.
        table: One row a sample, with the columns that a CSV log has: `time` and `joint/quantity`, or the names that the
            rig maps.
    """

    name: str
    table: pd.DataFrame

    def __str__(self) -> str:
        return self.name


def named_logs(logs: Sequence[Path | str | pd.DataFrame | LogTable], name: str = "log") -> list[Path | LogTable]:
    """Paths as they are; tables called "log 1", "log 2" and so on by their places among all logs.

    Args:
        logs: Files, and tables in memory.
        name: What to call a table, before its number.

    Raises:
        LogError: No list, or an entry of another type; says what came.

    Example:
        >>> import pandas as pd
        >>> [str(log) for log in named_logs(["swing.csv", pd.DataFrame({"time": [0.0]})])]
        ['swing.csv', 'log 2']
    """
    expected = "a path (str or Path) or a DataFrame"
    if isinstance(logs, Path | str | pd.DataFrame | LogTable) or not isinstance(logs, Sequence):
        raise LogError(f"{name}: expected a list, each entry {expected}, got {_described(logs)}")
    found: list[Path | LogTable] = []
    for number, log in enumerate(logs, 1):
        if isinstance(log, pd.DataFrame):
            found.append(LogTable(f"{name} {number}", log))
        elif isinstance(log, LogTable):
            found.append(log)
        elif isinstance(log, Path | str):
            found.append(Path(log))
        else:
            raise LogError(f"{name} {number}: expected {expected}, got {_described(log)}")
    return found


def _described(value: object) -> str:
    """The type of a value that cannot be used, and the value where it is short."""
    kind = f"a {type(value).__name__}"
    return f"{kind} ({quoted(str(value))})" if isinstance(value, str | Path) else kind


def _read_parquet(path: Path, episode: int | None = None) -> pd.DataFrame:
    with path.open("rb") as file:  # Arrow opens no file whose name is not UTF-8
        about = pyarrow.parquet.read_metadata(file)
        check_size(path, path.stat().st_size, 8.0 * about.num_rows * about.num_columns)
        file.seek(0)
        table = pd.read_parquet(file)
        file.seek(0)
        return _of_arrow(table, pyarrow.parquet.read_schema(file), Source(path, episode))


def _read_feather(path: Path, episode: int | None = None) -> pd.DataFrame:
    """An Arrow file: Feather version 2."""
    with path.open("rb") as file:
        arrow, size = pyarrow.ipc.open_file(file), 0.0
        for number in range(arrow.num_record_batches):
            size += arrow.get_batch(number).nbytes
            check_size(path, path.stat().st_size, size)
        file.seek(0)
        return _of_arrow(pd.read_feather(file), arrow.schema, Source(path, episode))


def _of_arrow(table: pd.DataFrame, schema: Any, source: Source) -> pd.DataFrame:
    """The table of a file of Arrow's, with the units in the metadata of its columns."""
    table = with_texts(without_lists(without_structs(with_index(table)), source))
    fields = {field.name: field.metadata or {} for field in schema}
    units = {name: about[key].decode() for name, about in fields.items() for key in (b"unit", b"units") if key in about}
    if units:
        table.attrs |= {"units": units, "units_by": "the metadata of the file"}
    return table


def _columns_of(name: str, value: np.ndarray, rows: int, joints: Sequence[str]) -> dict[str, np.ndarray]:
    """One column for a vector, `name_0, name_1, ...` for a matrix of (rows, n) or (n, rows); scalars are no columns.

    Where the file names n joints, those of a matrix of a joint's quantity are `JOINT/name`.
    """
    array = np.squeeze(value)
    if array.ndim == 1 and array.size > 1:
        return {name: array}
    if array.ndim == 2 and rows in array.shape:
        array = array if array.shape[0] == rows else array.T
        return {member(name, i, array.shape[1], joints): column for i, column in enumerate(array.T)}
    if value.size == 0 and value.dtype.kind != "U":
        return {name: np.empty(0)}
    return {}


def _rows_of(arrays: Mapping[str, np.ndarray]) -> int:
    """Samples: values of a vector that is called like a time, else the longest first axis, or second of few rows."""
    shapes = {name: np.squeeze(value).shape for name, value in arrays.items() if value.size > 1}
    vectors = {name: shape[0] for name, shape in shapes.items() if len(shape) == 1}
    if (time := time_among(vectors)) is not None:
        return int(vectors[time])
    longest = max((shape[0] for shape in shapes.values() if len(shape) in (1, 2)), default=0)
    return longest if longest >= MIN_ROWS else max((max(s) for s in shapes.values() if len(s) in (1, 2)), default=0)


def _joints_of(arrays: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """The texts of an array `joint_names` or `joints`; none where there is none, or a name is there twice."""
    found = [value.ravel().tolist() for name, value in arrays.items() if names_joints(name)]
    names = tuple(map(str, found[0])) if found and all(isinstance(each, str) for each in found[0]) else ()
    return names if len(set(names)) == len(names) else ()


SHOWN = 8
"""Single values in one note."""


def _of_arrays(path: Path, arrays: Mapping[str, np.ndarray], episode: int | None = None) -> pd.DataFrame:
    """A table of the arrays of a file, with a time from the rate that a single number states where there is none.

    The fields of a structured array are arrays of their own. Arrays of several episodes give one log with gaps.
    """
    source = Source(path, episode)
    if episodes := episodes_of_arrays(arrays):
        tables = [_of_arrays(path, each) for each in episodes]
        of_each = tables[0].attrs
        for table in tables:
            table.attrs = {}
        whole = with_times_told(tables, source, "an array of times, or a single number such as dt")
        whole.attrs = {**of_each, "notes": [*whole.attrs.get("notes", ()), *of_each.get("notes", ())]}
        return whole
    if episode is not None:
        return with_episodes_apart(_of_arrays(path, arrays), source)
    unread = [name for name, value in arrays.items() if value.dtype.kind == "O"]
    arrays, notes = with_common_times({name: value for name, value in arrays.items() if name not in unread})
    if unread:
        kinds = "objects, cells, sparse matrices" if path.suffix.lower() == ".mat" else "Python objects"
        notes.append(f"What cannot be read ({kinds}) was left out: {', '.join(unread[:SHOWN])}.")
    fields = {name: value.dtype.names or () for name, value in arrays.items()}
    arrays = {name: value for name, value in arrays.items() if not fields[name]} | {
        field: arrays[name][field] for name, of in fields.items() for field in of
    }
    rows, joints = _rows_of(arrays), _joints_of(arrays)
    columns: dict[str, np.ndarray] = {}
    left_out = []
    for name, value in arrays.items():
        if joints and names_joints(name):
            continue
        own = _columns_of(name, value, rows, joints)
        columns |= own
        if not own and value.size > 1:
            left_out.append(f"{name} {np.squeeze(value).shape}".replace(",)", ")"))
    table = _table(path, columns)
    if left_out:
        notes.append(f"Arrays that have neither {rows} rows nor {rows} columns were left out: {', '.join(left_out)}.")
    single = {name: value.item() for name, value in arrays.items() if value.size == 1}
    if single:
        told = ", ".join(f"{name} = {quoted(value)}" for name, value in list(single.items())[:SHOWN])
        notes.append(f"Single values are no columns: {told}.")
    table.attrs["notes"] = [*table.attrs.get("notes", ()), *notes]
    if units := _units_beside(single, [str(name) for name in table.columns]):
        table.attrs |= {"units": units, "units_by": "a text of the file"}
    values = {name: each for name, each in single.items() if type(each) in (int, float)}
    return with_times(table, stated_period(values))


def _units_beside(single: Mapping[str, object], columns: Sequence[str]) -> dict[str, str]:
    """By column, the texts of the file that state units: `units/q`, `q/unit` or `q_units` of `q`, `q_0`, `q_1`, ..."""
    found: dict[str, str] = {}
    for name, text in single.items():
        parts = [part for part in re.split("[/_]", name) if part.lower() not in ("unit", "units")]
        if isinstance(text, str) and len(parts) < len(re.split("[/_]", name)):
            own = re.compile(rf"(.*/)?{re.escape('_'.join(parts))}(_\d+)?")
            found |= {
                column: text for column in columns if own.fullmatch(column.replace("/", "_")) or own.fullmatch(column)
            }
    return found


def _table(path: Path, columns: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """A table of columns that must be of one length; the odd ones out are named, and texts among them left out."""
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


def _read_npz(path: Path, episode: int | None = None) -> pd.DataFrame:
    return _of_arrays(path, read_arrays(path), episode)


def _read_npy(path: Path, episode: int | None = None) -> pd.DataFrame:
    return _of_arrays(path, read_array(path), episode)


def _read_mat(path: Path, episode: int | None = None) -> pd.DataFrame:
    """As `read_mat`; a double underscore in a name stands for a slash."""
    return _of_arrays(path, {name.replace("__", "/"): value for name, value in read_mat(path).items()}, episode)


READERS: Mapping[str, Reader] = MappingProxyType(
    {
        ".csv": read_csv,
        ".csv.gz": read_csv,
        ".tsv": read_csv,
        ".txt": read_csv,
        ".parquet": _read_parquet,
        ".feather": _read_feather,
        ".arrow": _read_feather,
        ".npz": _read_npz,
        ".npy": _read_npy,
        ".mat": _read_mat,
        ".json": read_json,
        ".json.gz": read_json,
        ".jsonl": read_json_lines,
        **dict.fromkeys(SUFFIXES, read_bag),
    }
)


OF_EPISODES: Mapping[Reader, Callable[[Path, int], pd.DataFrame]] = MappingProxyType(
    {each: each for each in (_read_parquet, _read_feather, _read_npz, _read_npy, _read_mat, read_json)}
)
"""Readers of files that may hold several episodes."""


def run_name(path: Path) -> str:
    """The file's name without the ending that names its format; what is not UTF-8 in it is replaced by U+FFFD."""
    path, episode = source_of(path)
    suffix = _suffix(path)
    name = path.name[: -len(suffix)] if suffix else path.stem
    return utf8_text(name if episode is None else f"{name}#{episode}")


def _suffix(path: Path) -> str:
    """The longest known ending of the file's name, or an empty string."""
    name = path.name.lower()
    return max((suffix for suffix in READERS if name.endswith(suffix)), key=len, default="")


def read_table(path: Path | str | LogTable, needed: Collection[str] = ()) -> pd.DataFrame:
    """Read a log as it is: names, units and gaps untouched; one row a sample.

    Args:
        path: A log in memory, or a .csv, .csv.gz, .tsv, .txt, .parquet, .feather, .arrow, .npz, .npy, .mat, .json,
            .json.gz or .jsonl file, a ROS bag (`bags`), or the folder of a LeRobot data set. `FILE#2` is episode 2 of a
            file of several. In NPZ and MAT every vector is a column, a matrix (T, n) gives `name_0 ...`, and arrays
            (E, T, n) are episodes; MATLAB cannot write a slash, so `knee__position` and the struct field
            `knee.position` both mean `knee/position`. `json_log` has the forms of a JSON log.
        needed: Columns that the caller uses. In a bag, the topic with their positions gives the rows.

    Raises:
        LogError: Not a file, an unknown suffix, unreadable content, or no rows.
    """
    if isinstance(path, LogTable):
        where = Path(path.name)
        table = with_index(path.table)
        table.attrs = {}  # those of the owner are not those of the readers
    else:
        source = source_of(Path(path))
        where, table = source.path, _table_of(source, needed)
    if len(table) == 0:
        told = "".join(f" ({note})" for note in table.attrs.get("notes", ()))
        raise LogError(
            f"{where}: no rows{told}; record at least a few seconds of motion, as columns or arrays of numbers"
        )
    names = [str(name).strip() for name in table.columns]
    refuse_repeated(where, names)
    table.columns = pd.Index(names)
    table = with_counters_unwrapped(with_whole_stamps(with_named_vectors(with_dates(table))))
    return with_channels_apart(table)


def _table_of(source: Source, needed: Collection[str]) -> pd.DataFrame:
    """The table of a file or folder, by what it is."""
    path, episode = source
    if is_data_set(path):
        with _refused(path, "a LeRobot data set"):
            return with_texts(read_data_set(source))
    if is_folder(path) and is_bag(path):
        return read_bag(path, needed)
    if is_folder(path):
        files = ", ".join(sorted(each.name for each in path.iterdir() if is_bag(each)))
        raise LogError(
            f"{path}: expected a log file, the folder of a ROS bag (with metadata.yaml) or of a LeRobot data set (with"
            f" meta/info.json), got another folder{f'; it holds {files}: give one of these files' if files else ''}"
        )
    if not is_file(path):
        raise LogError(f"{path}: no such log file")
    suffix = _suffix(path)
    if not suffix:
        ending = "".join(path.suffixes[-2:]) or "no ending"
        raise LogError(
            f"{path}: unknown kind of log file ({ending}); write its columns as CSV or its arrays with numpy.savez;"
            f" readable: {', '.join(sorted(READERS))}"
        )
    read = READERS[suffix]
    with _refused(path, suffix):
        if read is read_bag:
            return read_messages(path) if is_without_ros(path) else read_bag(path, needed)
        if read in OF_EPISODES and episode is not None:
            return OF_EPISODES[read](path, episode)
        return with_episodes_apart(read(path), source)


@contextmanager
def _refused(path: Path, suffix: str) -> Iterator[None]:
    """Whatever the reader of a format says against a file, as one line.

    Parsers raise errors of any kind for a damaged file; none of them is a defect of what called them.
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
