"""BAM: hobby servos on a gravity pendulum (Rhoban; XL330 and STS3250), JSON runs at firmware P gains.

The firmware's position loop is proportional, so the runs of one gain are one rig: a position servo (error in, duty
out). The XL330 also reports its duty after clipping; duty times the supply is the voltage that the motor saw, and the
same logs make a second rig with a voltage drive. The supply is the median over the run: single readings catch the
ripple of the bridge's pulses (6 to 8.5 V at half duty), which the motor averages.

A point mass m at the length l and a uniform arm of mass a and the same length are the pendulum of mass m + a, whose
centre of mass is at l (m + a/2) / (m + a), and whose inertia is l^2 (m + a/3).
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drake_tc.config.files import file_name, is_folder, unpacked_gzip
from drake_tc.config.quoted import quoted
from drake_tc.errors import LogError
from drake_tc.logs.rig import parse_rig, save_rig

JOINT = "servo"
FULL_DUTY = 885.0
LARGEST = 1e12
"""No number of a run is as large; nan is not below it."""
POSITION_LOOPS = {"xl330": 4096.0 / (2.0 * np.pi) / (256.0 * FULL_DUTY)}
"""Duty for one unit of the firmware's P gain and one rad of position error, by motor (README of the data set)."""


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


def write_log(columns: Mapping[str, np.ndarray], path: Path) -> Path:
    """Write canonical columns (T,) as a Parquet log, making the folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(dict(columns)).to_parquet(path, index=False)
    return path


def write_rig(document: Mapping[str, Any], path: Path, comment: str) -> Path:
    """Write a rig file; the robot file that `document` may name lies beside it."""
    return save_rig(parse_rig(dict(document), path), path, comment)


def _load(path: Path) -> dict[str, Any]:
    try:
        run = json.loads(read_text(path))
    except (ValueError, RecursionError):
        raise LogError(f"{path}: not a BAM run: not valid JSON") from None
    if not isinstance(run, dict):
        raise LogError(f"{path}: not a BAM run: expected a mapping, got {quoted(run)}")
    if missing := {"mass", "length", "kp", "motor", "entries"} - set(run):
        raise LogError(f"{path}: not a BAM run; missing: {', '.join(sorted(missing))}")
    for key in ("mass", "length", "kp", *({"arm_mass", "vin"} & set(run))):
        if not _is_number(run[key]):
            raise LogError(f"{path}: {key}: expected a number, got {quoted(run[key])}")
    for key in ("mass", "arm_mass"):
        if run.get(key, 0.0) < 0.0:
            raise LogError(f"{path}: {key}: expected a mass [kg] of 0 or more, got {quoted(run[key])}")
    if run["length"] <= 0.0:
        raise LogError(f"{path}: length: expected a positive length [m], got {quoted(run['length'])}")
    entries = run["entries"]
    if not (isinstance(entries, list) and entries and all(isinstance(entry, dict) for entry in entries)):
        raise LogError(f"{path}: entries: expected a list of mappings, one a sample")
    return run


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) < LARGEST


def applied_duty(register: np.ndarray) -> np.ndarray:
    """Duty in [-1, 1] (T,) from the present-PWM register: 16-bit two's complement, 885 counts full scale."""
    counts = np.asarray(register, dtype=np.float64)
    return np.where(counts > 32767, counts - 65536.0, counts) / FULL_DUTY


NEEDED = {"timestamp": "time", "position": f"{JOINT}/position", "goal_position": f"{JOINT}/position_command"}
OPTIONAL = {"speed": f"{JOINT}/velocity", "temp": f"{JOINT}/temperature", "torque_enable": "enabled"}
"""Key of an entry to canonical column; not every servo reports the optional ones."""
OF_ENTRIES = {*NEEDED, *OPTIONAL, "load", "input_volts"}
OF_RUNS = {"mass", "arm_mass", "length", "kp", "motor", "trajectory", "vin", "entries"}


def _not_used(runs: Sequence[Mapping[str, Any]]) -> str:
    """What runs have beside what is read, for the comment of their rig file."""
    names = {name for run in runs for name in {*run} - OF_RUNS | {*run["entries"][0]} - OF_ENTRIES}
    return f"; not used: {', '.join(sorted(names))}" if names else ""


def _columns(path: Path, run: dict[str, Any]) -> dict[str, np.ndarray]:
    """Canonical columns of one run; the voltage only where the load register was read."""
    entries = run["entries"]
    for number, entry in enumerate(entries, start=1):
        odd = next((key for key in entries[0] if not _is_number(entry.get(key))), None)
        if odd is not None:
            what = quoted(entry[odd]) if odd in entry else "nothing"
            raise LogError(
                f"{path}: entries: expected the same keys with numbers in each; entry {number} has {what} as"
                f" {quoted(odd)}"
            )
    series = {key: np.array([entry[key] for entry in entries], dtype=np.float64) for key in entries[0]}
    if missing := sorted(set(NEEDED) - set(series)):
        raise LogError(f"{path}: entries: missing {', '.join(missing)}; present: {', '.join(sorted(series))}")
    columns = {column: series[key] for key, column in (NEEDED | OPTIONAL).items() if key in series}
    supply = float(np.median(series["input_volts"])) if "input_volts" in series else float(run.get("vin", 0.0))
    if np.any(series.get("load", 0.0)) and supply > 0.0:
        columns[f"{JOINT}/voltage"] = applied_duty(series["load"]) * supply
        if str(run["motor"]) in POSITION_LOOPS:
            gain = float(run["kp"]) * POSITION_LOOPS[str(run["motor"])] * supply
            columns[f"{JOINT}/position_gain"] = np.full(len(entries), gain)
    return columns


def _pendulum(run: Mapping[str, Any]) -> dict[str, float]:
    """Mass, length and inertia of the pendulum of one run; the inertia only where it is not that of a point mass."""
    mass, arm, length = float(run["mass"]), float(run.get("arm_mass", 0.0)), float(run["length"])
    if arm == 0.0:
        return {"mass": mass, "length": length}
    centre = length * (mass + arm / 2.0) / (mass + arm)
    return {"mass": mass + arm, "length": centre, "inertia": length**2 * (mass + arm / 3.0)}


def _load_of(runs: Mapping[str, Mapping[str, Any]]) -> object:
    """The rig file's `load`: one pendulum for all runs, or each run's by its name."""
    found = {name: _pendulum(run) for name, run in runs.items()}
    if any(each["mass"] == 0.0 for each in found.values()):
        return "unknown"
    first = next(iter(found.values()))
    if all(each == first for each in found.values()):
        return {"pendulum": first}
    keys = ("mass", "length", "inertia") if any("inertia" in each for each in found.values()) else ("mass", "length")
    for each in found.values():
        each.setdefault("inertia", each["mass"] * each["length"] ** 2)
    return {"pendulum": {key: {name: each[key] for name, each in found.items()} for key in keys}}


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one folder a motor and gain: its runs, `rig.yaml`, and `rig_servo.yaml` where both drives can be had.

    Runs without any mass on the shaft have a folder of their own, whose load is unknown.

    Raises:
        LogError: No BAM runs in `src`, or one that is damaged.
    """
    groups: dict[str, list[tuple[Path, dict[str, Any]]]] = {}
    for path in find(src, "*.json.gz", "*.json"):
        run = _load(path)
        bare = "" if _pendulum(run)["mass"] > 0.0 else "_no_load"
        groups.setdefault(file_name(f"{run['motor']}_kp{run['kp']}{bare}"), []).append((path, run))
    rigs: list[Path] = []
    for name, members in sorted(groups.items()):
        folder, voltage, enabled = out / name, True, True
        runs = [file_name(run.get("trajectory", path.name.split(".")[0])) for path, run in members]
        if len(set(runs)) < len(runs):
            runs = [file_name(path.name.split(".")[0]) for path, _ in members]
        for (path, run), run_name in zip(members, runs, strict=True):
            columns = _columns(path, run)
            voltage &= f"{JOINT}/voltage" in columns
            enabled &= "enabled" in columns
            write_log(columns, folder / f"{run_name}.parquet")
        first = members[0][1]
        base = {
            "joint": JOINT,
            "load": _load_of(dict(zip(runs, (run for _, run in members), strict=True))),
            "units": {"position": "rad"},
        }
        if enabled:
            base["enabled"] = "enabled"
        head = f"{first['motor']} servo on a pendulum, firmware P gain {first['kp']}"
        rest = _not_used([run for _, run in members])
        servo_name = "rig_servo.yaml" if voltage else "rig.yaml"
        if voltage:
            comment = f"{head}; voltage = applied duty times supply{rest}"
            rigs.append(write_rig({**base, "drive": "voltage"}, folder / "rig.yaml", comment))
        comment = f"{head}; its position loop taken as the drive{rest}"
        rigs.append(write_rig({**base, "drive": "position_servo"}, folder / servo_name, comment))
    return tuple(rigs)
