"""What every importer does with files: find the set's, read a table, write a canonical log or a robot's rig files."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drake_tc.config.is_file import is_folder
from drake_tc.errors import LogError
from drake_tc.logs.readers import read_table, run_name
from drake_tc.logs.rig import parse_rig
from drake_tc.logs.rig_writing import save_rig
from drake_tc.logs.sizes import unpacked_gzip
from drake_tc.types import FloatArray

__all__ = [
    "FITTED_ROBOT",
    "find",
    "floats",
    "read_logs",
    "read_table",
    "read_text",
    "run_name",
    "write_log",
    "write_rig",
    "write_robot",
]

FITTED_ROBOT: Mapping[str, Any] = {
    "robot": "robot.yaml",
    "load": {"robot": "fitted"},
    "units": {"position": "rad"},
}
"""Keys of the rig file of a robot that `write_robot` wrote and whose links are fitted."""


def find(src: Path, *patterns: str) -> list[Path]:
    """The set's files in the folder `src` that match any of the patterns, sorted.

    Raises:
        LogError: Not a folder, or nothing in it matches.
    """
    if not is_folder(src):
        raise LogError(f"{src}: expected the folder of a data set, and there is none")
    found = sorted({path for pattern in patterns for path in src.glob(pattern)})
    if not found:
        raise LogError(f"{src}: none of the set's files is here; expected {' or '.join(patterns)}")
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


def read_logs(src: Path, pattern: str, names: Mapping[str, str]) -> Iterator[tuple[str, dict[str, FloatArray]]]:
    """Yield each run of a set whose files have the same columns: its name, and the canonical columns (T,) by name.

    Args:
        src: Folder of the set.
        pattern: Of the runs' files in it.
        names: Canonical column to the column of the files, `time` left out: it has this name in both.

    Raises:
        LogError: No such files in `src`, or one with other columns.
    """
    for path in find(src, pattern):
        table = read_table(path)
        yield run_name(path), {name: floats(table, own, path) for name, own in {"time": "time", **names}.items()}


def write_log(columns: Mapping[str, np.ndarray], path: Path) -> Path:
    """Write canonical columns (T,) as a Parquet log, making the folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(dict(columns)).to_parquet(path, index=False)
    return path


def read_text(path: Path) -> str:
    """The text of a file, unpacked where its name ends in `.gz`.

    Raises:
        LogError: It cannot be read as text.
    """
    try:
        return (unpacked_gzip(path) if path.suffix == ".gz" else path.read_bytes()).decode("utf-8")
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise LogError(f"{path}: byte {error.start} is not UTF-8; save the file in UTF-8") from None


def write_robot(urdf: str, name: str, base: str, joints: Sequence[str], out: Path, **more: object) -> Path:
    """Write `NAME.urdf` and `robot.yaml` of a robot with a fixed base into the folder `out`.

    Args:
        urdf: Text of the URDF.
        name: Of the robot.
        base: Link that is welded to the world.
        joints: Driven joints.
        out: Made if need be.
        **more: Further keys of the robot file (models/README.md).

    Returns:
        The robot file.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / f"{name}.urdf").write_text(urdf, encoding="utf-8")
    document = {"name": name, "urdf": f"{name}.urdf", "base": base, "fixed_base": True, "joints": list(joints), **more}
    path = out / "robot.yaml"
    path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
    return path


def write_rig(document: Mapping[str, Any], path: Path, comment: str) -> Path:
    """Write a rig file; the robot file that `document` may name lies beside it."""
    return save_rig(parse_rig(dict(document), path), path, comment)
