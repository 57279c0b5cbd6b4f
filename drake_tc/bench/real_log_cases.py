"""Cases of `bench real-logs`: which rig file reads which logs of a public data set, and which of them are held out.

Each folder of `bench/rigs` is named as its data set and holds rig files and `cases.yaml`:

    importer: bam                         # optional; converts the set first (`drake-tc import`)
    cases:
      - name: kp100
        rig: rig.yaml                     # beside cases.yaml; or {data: FILE}, a rig file of the data set itself
        log: [run_1.csv, ...]             # relative to the data set, or to what the importer wrote
        holdout: [{file: run_2.csv, from: 0, until: 7}]     # a stretch of a log [s since its start]
        note: One sentence.               # optional

A set that `close-loop` cannot read has the key `not_readable` with the reason instead.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import LogError, ParamsError
from drake_tc.logs.importers import IMPORTERS
from drake_tc.logs.importers.files import read_table, run_name
from drake_tc.logs.rig import load_rig

RIGS = Path(__file__).parent / "rigs"


@dataclass(frozen=True)
class LogStretch:
    """One log, or a stretch of it.

    Attributes:
        file: Relative to the data set, or to what its importer wrote.
        start, end: Stretch [s since the first sample]; the whole log by default.
    """

    file: str
    start: float = -np.inf
    end: float = np.inf

    @property
    def whole(self) -> bool:
        """Whether nothing is cut off."""
        return self.start == -np.inf and self.end == np.inf


@dataclass(frozen=True)
class RealLogCase:
    """One call of `close-loop`.

    Attributes:
        name: Unique in its set.
        rig: Rig file; `rig_in_data` says whether it belongs to the data set.
        log, holdout: Training runs and held-out runs.
        note: What a reader must know, in one sentence.
    """

    name: str
    rig: str
    log: tuple[LogStretch, ...]
    holdout: tuple[LogStretch, ...]
    rig_in_data: bool = False
    note: str = ""


@dataclass(frozen=True)
class RealLogSet:
    """The cases of one data set.

    Attributes:
        name: Folder of the set.
        folder: Where its rig files are.
        cases: In the order of the file; empty where the set cannot be read.
        importer: Key of `IMPORTERS`, or None.
        not_readable: Why `close-loop` cannot read the set; empty where it can.
    """

    name: str
    folder: Path
    cases: tuple[RealLogCase, ...]
    importer: str | None = None
    not_readable: str = ""


def _checked(where: str, value: object, required: Sequence[str], optional: Sequence[str]) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ParamsError(f"{where}: expected a mapping with {', '.join(required)}; got {value!r}")
    unknown = [str(key) for key in value if key not in (*required, *optional)]
    missing = [key for key in required if key not in value]
    if unknown or missing:
        problem = f"unknown key {unknown[0]!r}" if unknown else f"missing key {missing[0]!r}"
        raise ParamsError(f"{where}: {problem}; possible: {', '.join((*required, *optional))}")
    return value


def _stretch(where: str, value: object) -> LogStretch:
    if isinstance(value, str):
        return LogStretch(value)
    entry = _checked(where, value, ("file",), ("from", "until"))
    times = (entry.get("from", -np.inf), entry.get("until", np.inf))
    if any(isinstance(t, bool) or not isinstance(t, int | float) for t in times) or not times[0] < times[1]:
        raise ParamsError(f"{where}: from and until: expected two increasing times [s]; got {times[0]!r}, {times[1]!r}")
    return LogStretch(str(entry["file"]), float(times[0]), float(times[1]))


def _stretches(where: str, value: object) -> tuple[LogStretch, ...]:
    if not isinstance(value, list) or not value:
        raise ParamsError(f"{where}: expected a list of at least one log; got {value!r}")
    return tuple(_stretch(f"{where}[{k}]", entry) for k, entry in enumerate(value))


def _case(where: str, value: object) -> RealLogCase:
    entry = _checked(where, value, ("name", "rig", "log", "holdout"), ("note",))
    rig = entry["rig"]
    in_data = isinstance(rig, Mapping)
    return RealLogCase(
        name=str(entry["name"]),
        rig=str(_checked(f"{where}: rig", rig, ("data",), ())["data"] if in_data else rig),
        log=_stretches(f"{where}: log", entry["log"]),
        holdout=_stretches(f"{where}: holdout", entry["holdout"]),
        rig_in_data=in_data,
        note=str(entry.get("note", "")),
    )


def load_set(folder: Path) -> RealLogSet:
    """Read `cases.yaml` of one folder of rig files.

    Raises:
        ParamsError: The file cannot be read, or a key is missing, unknown or has a bad value.
    """
    path = folder / "cases.yaml"
    document = read_yaml(path, "list of cases")
    if isinstance(document, Mapping) and "not_readable" in document:
        entry = _checked(str(path), document, ("not_readable",), ())
        return RealLogSet(folder.name, folder, (), not_readable=str(entry["not_readable"]).strip())
    entry = _checked(str(path), document, ("cases",), ("importer",))
    importer = entry.get("importer")
    if importer is not None and importer not in IMPORTERS:
        raise ParamsError(f"{path}: importer: no importer {importer!r}; possible: {', '.join(IMPORTERS)}")
    if not isinstance(entry["cases"], list):
        raise ParamsError(f"{path}: cases: expected a list; got {entry['cases']!r}")
    cases = tuple(_case(f"{path}: cases[{k}]", value) for k, value in enumerate(entry["cases"]))
    names = [case.name for case in cases]
    if repeated := next((name for name in names if names.count(name) > 1), None):
        raise ParamsError(f"{path}: case {repeated!r} is given twice")
    return RealLogSet(folder.name, folder, cases, importer)


def load_sets(root: Path = RIGS) -> dict[str, RealLogSet]:
    """All sets below `root`, by name.

    Raises:
        ParamsError: See `load_set`.
    """
    return {folder.name: load_set(folder) for folder in sorted(root.iterdir()) if (folder / "cases.yaml").is_file()}


@dataclass(frozen=True)
class CaseFiles:
    """Files that `close-loop` is given: rig, training logs, held-out logs."""

    rig: Path
    log: tuple[Path, ...]
    holdout: tuple[Path, ...]


def import_set(chosen: RealLogSet, data: Path, scratch: Path) -> Path:
    """The folder that the cases' logs are relative to; converts the set into `scratch` where it has an importer.

    Raises:
        LogError: The set is not in `data`, or the importer cannot read it.
    """
    source = data if data.name == chosen.name else data / chosen.name
    if not source.is_dir():
        raise LogError(f"{source}: no such folder; --data names the folder that holds the public data sets")
    if chosen.importer is None:
        return source
    IMPORTERS[chosen.importer](source, scratch)
    return scratch


def case_files(chosen: RealLogSet, case: RealLogCase, logs: Path, scratch: Path) -> CaseFiles:
    """The files of one case; stretches of logs are written to `scratch` as Parquet.

    Raises:
        LogError: A log that cannot be read, or a stretch that has no sample.
        RigError: The rig file cannot be read.
    """
    rig = (logs if case.rig_in_data else chosen.folder) / case.rig
    columns = load_rig(rig).columns
    clock = columns.get("time", "time")

    def path_of(stretch: LogStretch) -> Path:
        source = logs / stretch.file
        return source if stretch.whole else _cut(source, clock, stretch, scratch / "cut")

    return CaseFiles(rig, tuple(map(path_of, case.log)), tuple(map(path_of, case.holdout)))


def _cut(source: Path, clock: str, stretch: LogStretch, folder: Path) -> Path:
    table = read_table(source)
    if clock not in table.columns:
        raise LogError(f"{source}: no column {clock!r}; columns here: {', '.join(map(str, table.columns[:12]))}")
    since = table[clock] - table[clock].iloc[0]
    seconds = since.dt.total_seconds() if pd.api.types.is_timedelta64_dtype(since) else since
    elapsed = seconds.to_numpy(dtype=np.float64)
    inside = (elapsed >= stretch.start) & (elapsed < stretch.end)
    if not inside.any():
        raise LogError(f"{source}: no sample between {stretch.start:g} and {stretch.end:g} s")
    folder.mkdir(parents=True, exist_ok=True)
    start, end = max(stretch.start, 0.0), min(stretch.end, float(elapsed[-1]))
    path = folder / f"{run_name(source)}_{start:g}-{end:.0f}s.parquet"
    table[inside].to_parquet(path, index=False)
    return path
