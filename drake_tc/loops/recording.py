"""`Recording`: what a simulated loop leaves behind, and the files that are written of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from drake_tc.config.files import whole_file, write_whole
from drake_tc.errors import LogError
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording:
    """Signals of one simulation, sampled every tick of the control.

    Attributes:
        time: (T,) [s].
        signals: Name to values (T, width).
        seconds: Wall time that the simulation took [s].
        flag_names: Of the signal "flags", in order; empty without one.
    """

    time: FloatArray
    signals: Mapping[str, FloatArray]
    seconds: float
    flag_names: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> FloatArray:
        """(T, width) of one signal.

        Raises:
            LogError: no such signal in this recording.
        """
        if name not in self.signals:
            raise LogError(f"no signal {name!r} recorded; recorded: {', '.join(sorted(self.signals))}")
        return self.signals[name]

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds a second of wall time."""
        return float((self.time[-1] - self.time[0]) / self.seconds)

    def raised_flags(self) -> list[dict[str, Any]]:
        """Each flag that was up: its name, and when first [s]; none without the signal "flags"."""
        if not self.flag_names or "flags" not in self.signals:
            return []
        up = self.signals["flags"] > 0.0
        return [
            {"name": name, "first": float(self.time[int(np.argmax(up[:, i]))])}
            for i, name in enumerate(self.flag_names)
            if up[:, i].any()
        ]


def write_log(columns: Mapping[str, FloatArray], path: Path) -> Path:
    """Write columns as CSV, Parquet or NPZ, by the ending of `path`.

    Raises:
        LogError: another ending, or a file that cannot be written.
    """
    table = pd.DataFrame(dict(columns))
    writers: dict[str, Callable[[Path], object]] = {
        ".csv": lambda place: table.to_csv(place, index=False, float_format="%.9g"),
        ".parquet": lambda place: table.to_parquet(place),
        ".npz": lambda place: np.savez_compressed(place, **dict(columns)),  # type: ignore[arg-type]
    }
    if path.suffix not in writers:
        raise LogError(f"{path}: expected a log that ends in {', '.join(writers)}, got {path.suffix or 'no ending'}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as scratch:
            writers[path.suffix](scratch)
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def write_rig(rig: Mapping[str, Any], path: Path) -> Path:
    """Write the rig file beside a log; its folder is made where it is not there.

    Args:
        rig: Its keys and values.
        path: Of the file.

    Raises:
        LogError: a file that cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, yaml.safe_dump(dict(rig), sort_keys=False))
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path
