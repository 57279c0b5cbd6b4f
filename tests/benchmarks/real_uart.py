"""`bench real-uart`: spans, play and dead zone of UART servos on the backlash stand, beside the published spans."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.logs.files.readers import read_table
from drake_tc.logs.record import Run
from tests.benchmarks.backlash_bench import BacklashReport, Interval, analyse_backlash
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.importers.uart_backlash import convert

DATA_SET = "uart-servo-backlash"
ENCODER_STEP = 360.0 / 4096.0
WITHIN = 0.10


@dataclass(frozen=True)
class ServoStand:
    """One file of the set: the joints that hold, those that pull, and the published spans [deg] (loaded, unloaded)."""

    folder: str
    held: tuple[str, ...]
    pullers: tuple[str, str]
    published: tuple[tuple[float, float], ...]


STANDS = (
    ServoStand("single", ("servo_5",), ("servo_3", "servo_4"), ((1.25, 0.62),)),
    ServoStand("single_3250", ("servo_4",), ("servo_1", "servo_2"), ((0.37, 0.15),)),
    ServoStand("nocomp2", ("servo_1", "servo_2"), ("servo_3", "servo_4"), ((0.62, 0.47), (0.67, 0.46))),
    ServoStand("pgain_zero_db", ("servo_1", "servo_2"), ("servo_3", "servo_4"), ((0.24, 0.055), (0.24, 0.055))),
    ServoStand("comp2", ("servo_1", "servo_2"), ("servo_3", "servo_4"), ((0.075, 0.015), (0.075, 0.015))),
)
"""The last two give ranges (0.22-0.26 and 0.01-0.10; 0.02-0.13 and 0.01-0.02): their middles stand here."""


def stand_reports(data: Path, stands: Sequence[ServoStand] = STANDS) -> dict[str, BacklashReport]:
    """Analyse every held joint: `<folder>/<joint>` to its report.

    Args:
        data: Folder of public data sets.
        stands: Which files.

    Raises:
        LogError: the set is not in `data`.
        IdentificationError: a file without pulls.
    """
    reports = {}
    with TemporaryDirectory() as scratch:
        convert(data / DATA_SET, Path(scratch))
        for stand in stands:
            table = read_table(Path(scratch) / stand.folder / "run.parquet")
            columns = {name: table[name].to_numpy(dtype=np.float64) for name in table.columns if name != "time"}
            time = table["time"].to_numpy(dtype=np.float64)
            whole = np.zeros(time.size, dtype=np.int64)
            run = Run(stand.folder, None, time, float(np.median(np.diff(time))), columns, whole)
            for joint in stand.held:
                reports[f"{stand.folder}/{joint}"] = analyse_backlash(run, joint, stand.pullers)
    return reports


def _told(interval: Interval) -> str:
    low, high = np.degrees([interval.low, interval.high])
    return f"95 % interval {low:.2f} to {high:.2f}, {interval.counts} pulls"


def rows(data: Path) -> list[BenchmarkRow]:
    """The table: spans against the published ones, then what they are made of; angles in degrees.

    A published span has to be met within 10 %, or within half a step of the encoder (0.044 deg) where that is more.
    """
    reports = stand_reports(data)
    out = []
    for stand in STANDS:
        for joint, (loaded, unloaded) in zip(stand.held, stand.published, strict=True):
            name = f"{stand.folder}/{joint}"
            report = reports[name]
            for what, span, expected in (
                ("loaded_span", report.loaded_span, loaded),
                ("unloaded_span", report.unloaded_span, unloaded),
            ):
                tolerance = max(WITHIN * expected, 0.5 * ENCODER_STEP)
                value = float(np.degrees(span.value))
                out.append(BenchmarkRow(f"{name}/{what}", value, "deg", expected, "within", tolerance, _told(span)))
            out += _causes(name, report)
    return out


def _causes(name: str, report: BacklashReport) -> list[BenchmarkRow]:
    law = report.drive
    bound = "; the servo drove against the pulls: a lower bound" if report.lower_bound else ""
    bracket = f"between {np.degrees(law.low):.2f} and {np.degrees(law.high):.2f} by the encoder's steps"
    per_degree = law.gain * np.pi / 180.0
    causes = [
        BenchmarkRow(f"{name}/play", float(np.degrees(report.play.value)), "deg", note=_told(report.play) + bound),
        BenchmarkRow(f"{name}/wind_up", float(np.degrees(report.wind_up.value)), "deg", note=_told(report.wind_up)),
        BenchmarkRow(f"{name}/dead_zone_half_width", float(np.degrees(law.dead_zone)), "deg", note=bracket),
        BenchmarkRow(f"{name}/drive_gain", per_degree, "V/deg", note=f"starting effort {law.start:+.2f} V"),
    ]
    if report.servo_band is not None:
        band = report.servo_band
        causes.append(BenchmarkRow(f"{name}/servo_band", float(np.degrees(band.value)), "deg", note=_told(band)))
    return causes
