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

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import BeforeValidator, Discriminator, Field, Tag, field_validator

from drake_tc.config.keys import FileName, Keys, Name, Number, key
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.records import validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import LogError, ParamsError
from drake_tc.logs.rig import load_rig
from tests.benchmarks.importers import IMPORTERS
from tests.benchmarks.importers.files import read_table, run_name

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


class StretchKeys(Keys):
    """A stretch of a log."""

    file: FileName = key("The log, relative to the data set.", example="run_2.csv", default=..., expected="a file")
    start: Number | None = key("Where it begins.", unit="s", example=0.0, absent="at the first sample", name="from")
    end: Number | None = key("Where it ends.", unit="s", example=7.0, absent="at the last sample", name="until")

    def check(self) -> None:
        """The stretch has a length."""
        if self.start is not None and self.end is not None and not self.start < self.end:
            raise ValueError(f"expected from < until [s], got {self.start:g} and {self.end:g}")

    def stretch(self) -> LogStretch:
        """The stretch."""
        whole = LogStretch(self.file)
        return LogStretch(
            self.file,
            whole.start if self.start is None else self.start,
            whole.end if self.end is None else self.end,
        )


Stretch = Annotated[StretchKeys, BeforeValidator(lambda value: {"file": value} if isinstance(value, str) else value)]


class DataRigKeys(Keys):
    """A rig file of the data set itself."""

    data: FileName = key("The rig file.", example="rig.yaml", default=..., expected="a file")


class CaseKeys(Keys):
    """One call of `close-loop`."""

    name: Name = key("Name of the case.", example="kp100", default=..., expected="a name")
    rig: Annotated[
        Annotated[FileName, Tag("@file")] | Annotated[DataRigKeys, Tag("@data")],
        Discriminator(lambda value: "@data" if isinstance(value, Mapping) else "@file"),
    ] = key("Rig file beside this one, or `{data: FILE}`.", example="rig.yaml", default=..., expected="a rig file")
    log: Annotated[list[Stretch], Field(min_length=1)] = key(
        "Training runs.", example=["run_1.csv"], default=..., expected="a list of logs"
    )
    holdout: Annotated[list[Stretch], Field(min_length=1)] = key(
        "Held-out runs.", example=[{"file": "run_2.csv", "until": 7.0}], default=..., expected="a list of logs"
    )
    note: str | None = key("What a reader must know.", example="The drive saturates.", absent="none")

    def case(self) -> RealLogCase:
        """The case."""
        return RealLogCase(
            name=self.name,
            rig=self.rig if isinstance(self.rig, str) else self.rig.data,
            log=tuple(each.stretch() for each in self.log),
            holdout=tuple(each.stretch() for each in self.holdout),
            rig_in_data=not isinstance(self.rig, str),
            note=self.note or "",
        )


class CasesKeys(Keys):
    """What `cases.yaml` may say."""

    cases: list[CaseKeys] | None = key("The cases.", example=[], absent="required unless `not_readable` is there")
    importer: str | None = key("What converts the set first.", example="bam", absent="nothing")
    not_readable: str | None = key("Why `close-loop` cannot read the set.", example="It has no time.", absent="it can")

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """Cases or the reason why there are none."""
        if ("cases" in value) == ("not_readable" in value):
            raise ValueError("expected one of the keys 'cases' and 'not_readable'")

    @field_validator("importer")
    @classmethod
    def _known(cls, value: str | None) -> str | None:
        if value is not None and value not in IMPORTERS:
            names = tuple(IMPORTERS)
            raise ValueError(f"expected one of {', '.join(names)}, got {quoted(value)}{did_you_mean(value, names)}")
        return value


def load_set(folder: Path) -> RealLogSet:
    """Read `cases.yaml` of one folder of rig files.

    Raises:
        ParamsError: The file cannot be read, or a key is missing, unknown or has a bad value.
    """
    path = folder / "cases.yaml"
    read = validated(CasesKeys, read_yaml(path, "list of cases"), str(path))
    if read.not_readable is not None:
        return RealLogSet(folder.name, folder, (), not_readable=read.not_readable.strip())
    cases = tuple(entry.case() for entry in read.cases or ())
    names = [case.name for case in cases]
    if repeated := next((name for name in names if names.count(name) > 1), None):
        raise ParamsError(f"{path}: case {repeated!r} is given twice")
    return RealLogSet(folder.name, folder, cases, read.importer)


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
