"""Damaged logs: a table of columns with odd content, in every format, and then with odd bytes."""

import gzip
import io
import json
import zipfile
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pandas as pd
import scipy.io

from .odd import NAMES, damage_bytes

FORMATS = (".csv", ".csv.gz", ".parquet", ".feather", ".npz", ".mat", ".json", ".json.gz", ".jsonl")
CELLS = (
    "overload",
    "",
    "é",
    "1,5",
    "1e400",
    "nan",
    "-",
    "0x10",
    "2001-99-99",
    "9" * 400,
    "true",
    "\x00",
    "1 2",
    "None",
)

Columns = dict[str, Any]


def damaged_log(columns: Columns, folder: Path, rng: Random, stem: str = "run") -> Path:
    """A log of the columns, of which something is odd in two cases of three; sound otherwise."""
    changed: Columns = dict(columns)
    for _ in range(rng.choice((0, 1, 1, 1, 2))):
        _change(changed, rng)
    suffix = rng.choice(FORMATS)
    path = folder / f"{stem}{suffix}"
    content = _written(changed, suffix, rng)
    path.write_bytes(damage_bytes(content, rng) if rng.random() < 0.35 else content)
    return path


def _change(columns: Columns, rng: Random) -> None:
    """Change one thing of a table."""
    if not columns:
        return
    name = rng.choice(list(columns))
    values = np.array(columns[name])
    if values.dtype.kind in "bi":  # an earlier change made it so
        values = values.astype(np.float64)
    rows, at = values.shape[0], rng.randrange(max(1, values.shape[0]))
    how = rng.randrange(17)
    if values.dtype.kind != "f" or values.ndim != 1 or rows < 3 or how == 0:
        del columns[name]
    elif how == 1:
        columns[rng.choice(NAMES)] = columns.pop(name)
    elif how == 2:
        with np.errstate(over="ignore"):
            columns[name] = values * rng.choice((0.0, -1.0, 1e3, 1e6, 1e9, 1e300, 57.3, 1e-300))
    elif how == 3:
        values[at : at + rng.choice((1, 3, 50, rows))] = rng.choice((np.nan, np.inf, -np.inf, 1e308, 1e20, 0.0, 6.28))
        columns[name] = values
    elif how == 4:
        values[at:] += rng.choice((2.0 * np.pi, -1.0, 1e-6, 1e6))
        columns[name] = values
    elif how == 5:
        cells = values.astype(object)
        cells[at] = rng.choice(CELLS)
        columns[name] = cells
    elif how == 6:
        columns[name] = np.full(rows, rng.choice((0.0, 1.0, np.nan, 1e308)))
    elif how == 7:
        other = rng.choice(list(columns))
        columns[name], columns[other] = columns[other], columns[name]
    elif how == 8:
        for each in columns:
            columns[each] = np.asarray(columns[each])[: rng.choice((0, 1, 2, 19, 25, 60))]
    elif how == 9:
        columns[name] = values[: rng.randrange(rows)]
    elif how == 10:
        columns[name] = values[::-1]
    elif how == 11:
        columns[name] = values + 1j
    elif how == 12:
        columns[name] = rng.choice((values > 0, values.astype(np.int64), values.astype(np.float16), values.astype(str)))
    elif how == 13:
        columns[name] = np.stack([values] * rng.choice((1, 2, 3)), axis=1)
    elif how == 14:
        for each in columns:
            part = np.asarray(columns[each])
            columns[each] = np.concatenate([part[:at], part[at + rng.choice((1, 5, 100)) :]])
    elif how == 15:
        columns[name] = np.round(values, rng.choice((0, 1, 2)))
    else:
        columns |= {f"extra_{i}": np.zeros(rows) for i in range(rng.choice((1, 300)))}


def _written(columns: Columns, suffix: str, rng: Random) -> bytes:
    """The file's content; columns of different lengths stay so where the format can hold them."""
    if suffix in (".csv", ".csv.gz"):
        return _packed(_csv(columns, rng), suffix)
    if suffix in (".json", ".json.gz"):
        return _packed(_json(columns, rng), suffix)
    if suffix == ".jsonl":
        return "\n".join(_dumped(record) for record in _records(columns)).encode()
    if suffix == ".npz":
        return _npz(columns, rng)
    if suffix == ".mat":
        return _mat(columns, rng)
    write = pd.DataFrame.to_parquet if suffix == ".parquet" else pd.DataFrame.to_feather
    buffer = io.BytesIO()
    try:
        write(_frame(columns), buffer)
    except Exception:  # what Arrow cannot hold
        buffer = io.BytesIO()
        write(_frame({f"c{i}": np.asarray(v).astype(str) for i, v in enumerate(columns.values())}), buffer)
    return buffer.getvalue()


def _packed(text: str, suffix: str) -> bytes:
    content = text.encode("utf-8", errors="replace")
    return gzip.compress(content, mtime=0) if suffix.endswith(".gz") else content


def _frame(columns: Columns) -> pd.DataFrame:
    flat = {name: np.asarray(values) for name, values in columns.items()}
    return pd.DataFrame({name: pd.Series(v if v.ndim == 1 else list(v)) for name, v in flat.items()})


def _csv(columns: Columns, rng: Random) -> str:
    text: str = _frame(columns).to_csv(index=False, sep=rng.choice((",", ",", ",", ";", "\t")))
    if rng.random() < 0.25:
        lines = text.splitlines()
        at = rng.randrange(len(lines))
        lines[at] = rng.choice((lines[at] + ",7", lines[at] + lines[at], "", "#" + lines[at], lines[at][:-3], '"'))
        text = "\n".join(lines)
    return text


def _plain(values: Any) -> list[Any]:
    array = np.asarray(values)
    return [str(v) if isinstance(v, complex) else v for v in array.tolist()]


def _records(columns: Columns) -> list[dict[str, Any]]:
    lists = {name: _plain(values) for name, values in columns.items()}
    rows = max(map(len, lists.values()), default=0)
    return [{name: values[i] for name, values in lists.items() if i < len(values)} for i in range(rows)]


def _dumped(value: Any) -> str:
    return json.dumps(value, default=str)


def _json(columns: Columns, rng: Random) -> str:
    lists: Any = {name: _plain(values) for name, values in columns.items()}
    how = rng.randrange(8)
    if how == 0:
        return _dumped(_records(columns))
    if how == 1:
        return _dumped({"mass": 1, "entries": _records(columns)})
    if how == 2:
        return rng.choice(
            ("[" * 100_000, "{}", "[]", "[[]]", "null", "3", '"x"', "[1, 2]", '{"time": 3}', '{"time": [{}]}')
        )
    if how == 3:
        return _dumped({"time": lists.pop("time", []), "nested": {"deep": lists}})
    return _dumped(lists)


def _npz(columns: Columns, rng: Random) -> bytes:
    buffer = io.BytesIO()
    odd = rng.random()
    if odd < 0.1:
        with zipfile.ZipFile(buffer, "w") as archive:
            archive.writestr(
                rng.choice(("time.npy", "time", "a/b.npy")), rng.choice((b"", b"no array", b"\x93NUMPY\x01"))
            )
        return buffer.getvalue()
    if odd < 0.15:
        np.savez(buffer, **{f"x{i}": np.array([{}, None], dtype=object) for i in range(2)})
        return buffer.getvalue()
    safe = {name.replace("\x00", "_") or "_": np.asarray(v) for name, v in columns.items()}
    (np.savez if rng.random() < 0.5 else np.savez_compressed)(buffer, **safe)
    return buffer.getvalue()


def _mat(columns: Columns, rng: Random) -> bytes:
    buffer = io.BytesIO()
    named = {name.replace("/", "__")[:30] or "x": np.asarray(v) for name, v in columns.items()}
    named = {name if name.isidentifier() else f"x{i}": v for i, (name, v) in enumerate(named.items())}
    if rng.random() < 0.1:
        named = {"s": {"time": named.get("time", 1.0), "c": np.array([["a", [1, 2]]], dtype=object)}}
    try:
        scipy.io.savemat(buffer, named, do_compression=rng.random() < 0.5, format=rng.choice(("5", "5", "4")))
    except Exception:  # what MATLAB cannot hold
        scipy.io.savemat(buffer, {"time": np.arange(3.0)})
    return buffer.getvalue()
