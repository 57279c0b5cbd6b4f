"""DFKI underactuated lab: a simple pendulum and a double pendulum on AK80-6 quasi-direct drives.

The drives report torque from their current, tau = kt N i with kt = 0.091 N m/A at the rotor and N = 6; so the
report is the drive's effort and no measurement of the load: current = tau / (kt N) is written.
"""

from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.importers.files import find, floats, read_table, run_name, write_log, write_rig

TORQUE_PER_AMPERE = 0.091 * 6.0
SIMPLE_JOINT = "pendulum"
DOUBLE_JOINTS = ("shoulder", "elbow")
_SIMPLE = {"mass": 0.676, "length": 0.45, "inertia": 0.154}
_KG = 1.0  # the variant's name gives its point mass, on the same rod of 0.5 m and 0.13 kg (centre at 0.24 m)
_ONE_KG = {"mass": _KG + 0.13, "length": (_KG * 0.5 + 0.13 * 0.24) / (_KG + 0.13), "inertia": _KG * 0.25 + 0.13 * 0.08}


def _simple(paths: list[Path], out: Path) -> list[Path]:
    rigs = []
    for folder, pendulum, one_kg in (("simple", _SIMPLE, False), ("simple_1kg", _ONE_KG, True)):
        members = [path for path in paths if ("1kg" in path.name) == one_kg]
        for path in members:
            table = read_table(path)
            short = "position" not in table.columns  # the oldest file abbreviates
            columns = {
                "time": floats(table, "time", path),
                f"{SIMPLE_JOINT}/position": floats(table, "pos" if short else "position", path),
                f"{SIMPLE_JOINT}/velocity": floats(table, "vel" if short else "velocity", path),
                f"{SIMPLE_JOINT}/current": floats(table, "torque", path) / TORQUE_PER_AMPERE,
            }
            write_log(columns, out / folder / f"{run_name(path)}.parquet")
        if members:
            document: dict[str, Any] = {
                "joint": SIMPLE_JOINT,
                "drive": "current",
                "load": {"pendulum": pendulum},
                "units": {"position": "rad"},
                "declared": {"rotor_inertia": 0.0022},
            }
            comment = "AK80-6 on a pendulum; current = reported torque / (0.091 N m/A * 6)\n" + (
                "mass and length estimated from the variant's name"
                if one_kg
                else "some runs hold pushes by hand (energy shaping, SAC: after 7 s; gravity compensation: all of it)"
            )
            rigs.append(write_rig(document, out / folder / "rig.yaml", comment))
    return rigs


def _double(paths: list[Path], out: Path) -> list[Path]:
    groups: dict[str, list[Path]] = {}
    for path in paths:
        groups.setdefault("double_" + "_".join(path.name.split("_")[:2]), []).append(path)
    rigs = []
    for folder, members in sorted(groups.items()):
        old = False
        for path in members:
            table = read_table(path)
            old = "pos1" in table.columns
            position, velocity, torque = ("pos", "vel", "tau") if old else ("pos_meas", "vel_meas", "tau_meas")
            columns: dict[str, np.ndarray] = {"time": floats(table, "time", path)}
            for number, joint in enumerate(DOUBLE_JOINTS, start=1):
                columns[f"{joint}/position"] = floats(table, f"{position}{number}", path)
                columns[f"{joint}/velocity"] = floats(table, f"{velocity}{number}", path)
                columns[f"{joint}/current"] = floats(table, f"{torque}{number}", path) / TORQUE_PER_AMPERE
            write_log(columns, out / folder / f"{run_name(path)}.parquet")
        document = {
            "joints": list(DOUBLE_JOINTS),
            "drive": "current",
            "load": "unknown",
            "units": {"position": "rad"},
        }
        comment = "double pendulum, two AK80-6; current = torque / (0.091 N m/A * 6)\n" + (
            "the torque of these old logs is not quantised: the command, not the report"
            if old
            else "torque as reported"
        )
        rigs.append(write_rig(document, out / folder / "rig.yaml", comment))
    return rigs


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one folder a pendulum (`simple`, `simple_1kg`, `double_<design>_<day>`), whichever the files are.

    Raises:
        LogError: No such files in `src`, or one with other columns.
    """
    paths = find(src, "*measured*.csv*", "*_trajectory_*.csv*")
    double = [path for path in paths if path.name.startswith(("A0_", "C0_"))]
    return tuple(_simple([path for path in paths if path not in double], out) + _double(double, out))
