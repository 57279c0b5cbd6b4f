"""TIAGo: torso and seven arm joints at 100 Hz, one identification run in three files on one clock.

The effort of the arm joints is a motor current [A]; the torso's position is in metres and its effort a force-like
value in the drive's own unit.
"""

from pathlib import Path

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.importers.files import find, floats, read_table, write_log, write_rig

CHANNELS = {"position": "position", "velocity": "velocity", "effort": "current"}


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write `identification.parquet` and `rig.yaml`.

    Raises:
        LogError: One of the three files is not in `src`, has other columns, or another clock.
    """
    columns: dict[str, np.ndarray] = {}
    joints: list[str] = []
    for file_name, suffix in CHANNELS.items():
        path = find(src, f"tiago_{file_name}.csv*")[0]
        table = read_table(path)
        time = floats(table, "t", path)
        if "time" in columns and not np.array_equal(columns["time"], time):
            raise LogError(f"{path}: its times differ from those of the other files; wanted three files of one run")
        columns["time"] = time
        for name in table.columns:
            if name.endswith(f"_{file_name}"):
                joint = name.removeprefix("-").strip().removesuffix(f"_{file_name}")
                columns[f"{joint}/{suffix}"] = floats(table, name, path)
                joints += [joint] if joint not in joints else []
    if not joints:
        raise LogError(f"{src}: no column ends in _position, _velocity or _effort; wanted the TIAGo files")
    write_log(columns, out / "identification.parquet")
    document = {"joints": joints, "drive": "current", "load": "unknown", "units": {"position": "rad"}}
    comment = "TIAGo torso and arm\ncurrent [A] as reported; the torso's position is in m and its effort force-like"
    return (write_rig(document, out / "rig.yaml", comment),)
