"""`Recording`: what a simulated loop leaves behind, and the files that are written of it.

One log of all recorded signals of a diagram, as every log costs its share of a tick.

Advancing a simulation piece by piece, watched.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Multiplexer, VectorLogSink

from drake_tc.config.files import whole_file, write_whole
from drake_tc.errors import LogError, SimulationError
from drake_tc.types import BoolArray, FloatArray


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

    @property
    def flags(self) -> dict[str, BoolArray]:
        """Name to (T,) whether it was up, of each flag that ever was; none without the signal "flags"."""
        if not self.flag_names or "flags" not in self.signals:
            return {}
        up = self.signals["flags"].T > 0.0
        return {name: row for name, row in zip(self.flag_names, up, strict=True) if row.any()}

    def raised_flags(self) -> list[dict[str, Any]]:
        """Each flag that was up: its name, and when first [s]."""
        return [{"name": name, "first": float(self.time[int(np.argmax(row))])} for name, row in self.flags.items()]


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


class NamedSink(VectorLogSink):
    """A log that knows the names of its rows."""

    def __init__(self, rows: Mapping[str, slice], period: float) -> None:
        """Declare the log.

        Args:
            rows: Signal to its rows, one below the other.
            period: [s].
        """
        super().__init__(max(part.stop for part in rows.values()), period)
        self.rows = dict(rows)

    def names(self) -> list[str]:
        """Of each row."""
        return [f"{name}[{i}]" for name, part in self.rows.items() for i in range(part.stop - part.start)]


@dataclass(frozen=True, eq=False)
class SignalLog:
    """A log of signals, one below the other.

    Attributes:
        sink: The log.
        rows: Signal name to where it stands in it.
    """

    sink: VectorLogSink
    rows: Mapping[str, slice]

    def recorded(self, context: Context) -> tuple[FloatArray, dict[str, FloatArray]]:
        """What was logged in a run of the diagram: times (T,) [s], and the signals by name, (T, width) each."""
        log = self.sink.FindLog(context)
        data = np.asarray(log.data())
        return np.array(log.sample_times()), {name: data[rows].T.copy() for name, rows in self.rows.items()}


def add_log(builder: DiagramBuilder, signals: Mapping[str, OutputPort], period: float) -> SignalLog:
    """Log the signals every `period` [s]: a system `signals` that joins them, and `log`."""
    ends = np.cumsum([0, *(port.size() for port in signals.values())]).tolist()
    joined: Any = builder.AddNamedSystem("signals", Multiplexer([b - a for a, b in pairwise(ends)]))
    for index, port in enumerate(signals.values()):
        builder.Connect(port, joined.get_input_port(index))
    rows = {name: slice(a, b) for name, (a, b) in zip(signals, pairwise(ends), strict=True)}
    sink = NamedSink(rows, period)
    builder.AddNamedSystem("log", sink)
    builder.Connect(joined.get_output_port(), sink.get_input_port())
    return SignalLog(sink, rows)


Progress = Callable[[str, float], None]
CHUNK = 0.02
"""Simulated time between two looks at the state [s]."""


def advance(
    simulator: Simulator,
    duration: float,
    goes_on: Callable[[float], bool],
    *,
    plant_step: float,
    progress: Progress | None = None,
) -> None:
    """Initialize, then advance to `duration` [s] in pieces of `CHUNK`, as long as what is watched goes on.

    Args:
        simulator: At the start.
        duration: Where it ends.
        goes_on: Looks at the state after a piece, at its time [s]; False ends the run there.
        plant_step: Of the plant [s], for the message.
        progress: Told what is done and which share.

    Raises:
        SimulationError: a system failed; says when, and what to try. What `goes_on` raises is passed on.
    """
    chunks = math.ceil(duration / CHUNK - 1e-9)
    try:
        simulator.Initialize()
        for number in range(1, chunks + 1):
            now = duration if number == chunks else number * CHUNK
            simulator.AdvanceTo(now)
            if not goes_on(now):
                return
            if progress:
                progress(f"{now:.1f} of {duration:g} s", now / duration)
    except RuntimeError as error:
        raise SimulationError(
            f"the simulation failed at t = {simulator.get_context().get_time():.4f} s: {' '.join(str(error).split())};"
            f" try a smaller plant_step than {plant_step:g} s"
        ) from error
