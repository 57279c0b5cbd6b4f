"""Backlash stand for UART servos (Robonine): STS3215/STS3250 pulled left and right by rubber bands, 10 Hz.

Per servo id: target and position [counts, 4096 a turn], speed [counts/s, +32768 negative], load [per mille of duty,
+1024 negative], current [6.5 mA a count, unsigned]. The sign bit of the load means "towards larger counts"
(the servo drives against its error), so the voltage written here is minus the decoded load times 12 V.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.errors import LogError
from drake_tc.types import FloatArray
from tests.benchmarks.importers.files import find, floats, read_table, run_name, write_log, write_rig

COUNT = 2.0 * np.pi / 4096.0
ZERO = 2047.0
SUPPLY = 12.0
AMPERES_PER_COUNT = 6.5e-3


def decode_sign(register: FloatArray, bit: float) -> FloatArray:
    """Signed values (T,) of a register that adds `bit` to the magnitude of negative ones."""
    return np.where(register >= bit, bit - register, register)


def _servo(table: pd.DataFrame, servo: str, path: Path) -> dict[str, FloatArray]:
    """Canonical columns of one servo; empty when it never answered."""
    raw = {
        key: floats(table, f"{key} ({servo})", path)
        for key in ("target pos", "pos", "speed", "load", "current", "temp")
    }
    if np.isnan(raw["pos"]).all():
        return {}
    duty = -decode_sign(raw["load"], 1024.0) / 1000.0
    joint = f"servo_{servo}"
    return {
        f"{joint}/position": (raw["pos"] - ZERO) * COUNT,
        f"{joint}/position_command": (raw["target pos"] - ZERO) * COUNT,
        f"{joint}/velocity": decode_sign(raw["speed"], 32768.0) * COUNT,
        f"{joint}/voltage": duty * SUPPLY,
        f"{joint}/current": np.sign(duty) * raw["current"] * AMPERES_PER_COUNT,
        f"{joint}/temperature": raw["temp"],
    }


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one folder a file: `<name>/run.parquet` and `<name>/rig.yaml`, a joint a servo id.

    Raises:
        LogError: No such files in `src`, or one with other columns.
    """
    rigs = []
    for path in find(src, "motor_telemetry_*.csv*"):
        table = read_table(path)
        if "timestamp" not in table.columns:
            raise LogError(f"{path}: no column 'timestamp', so not a file of this data set")
        stamps = pd.to_datetime(table["timestamp"], utc=True)
        seconds = (stamps - stamps.iloc[0]).dt.total_seconds()
        columns: dict[str, FloatArray] = {"time": np.asarray(seconds, dtype=np.float64)}
        servos = [name.split("(")[1].rstrip(")") for name in table.columns if name.startswith("pos (")]
        for servo in servos:
            columns |= _servo(table, servo, path)
        joints = [name.removesuffix("/position") for name in columns if name.endswith("/position")]
        folder = out / run_name(path).removeprefix("motor_telemetry_")
        write_log(columns, folder / "run.parquet")
        document = {"joints": joints, "drive": "position_servo", "load": "unknown", "units": {"position": "rad"}}
        comment = "UART servos on a backlash stand\nvoltage = duty * 12 V; 0 rad is count 2047, the lever's rest"
        rigs.append(write_rig(document, folder / "rig.yaml", comment))
    return tuple(rigs)
