"""What every importer does with files: find those of the set, read a table, write a log or a robot's rig files."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drake_tc.errors import LogError
from drake_tc.logs.files.bam_runs import find, read_text, write_log, write_rig
from drake_tc.logs.files.readers import read_table, run_name
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
