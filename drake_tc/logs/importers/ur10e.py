"""UR10e: excitation, joint-wise and point-to-point runs of a six-joint arm (Innopolis University), motor currents.

The gains are the controller's own: its torque over its current, both predicted by its rigid model, at standstill.
Joints 2 to 5 show them; joint 1 has the drive of joint 2, joint 6 that of joint 5. One run, `exc_0131_load`, carries a
load: `rig_load.yaml` reads the same logs and names that run as one with an unknown payload.
"""

from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.logs.importers.files import (
    find,
    floats,
    read_table,
    read_text,
    run_name,
    write_log,
    write_rig,
    write_robot,
)

TORQUE_PER_AMPERE = {
    "shoulder_pan_joint": 11.976,
    "shoulder_lift_joint": 11.976,
    "elbow_joint": 9.839,
    "wrist_1_joint": 10.763,
    "wrist_2_joint": 10.763,
    "wrist_3_joint": 10.763,
}
"""Joints in the order of the columns, and the controller's own constants at the joint [N m/A]."""
LOADED_RUN = "exc_0131_load"
CHANNELS = {"q": "position", "qd": "velocity", "current": "current"}


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one log a run, the robot, `rig.yaml` and, where the loaded run is there, `rig_load.yaml`.

    Raises:
        LogError: No runs or no URDF in `src`, or a file with other columns.
    """
    urdf = read_text(find(src, "ur10e.urdf*")[0])
    names = []
    for path in find(src, "*.csv*"):
        table = read_table(path)
        columns: dict[str, np.ndarray] = {"time": floats(table, "time", path)}
        for number, joint in enumerate(TORQUE_PER_AMPERE, start=1):
            columns |= {f"{joint}/{name}": floats(table, f"{key}_{number}", path) for key, name in CHANNELS.items()}
        names.append(run_name(path))
        write_log(columns, out / f"{names[-1]}.parquet")
    write_robot(urdf, "ur10e", "base_link", tuple(TORQUE_PER_AMPERE), out)
    document: dict[str, Any] = {
        "robot": "robot.yaml",
        "drive": "current",
        "load": {"robot": "fitted"},
        "units": {"position": "rad"},
        "declared": ["rotor_inertia", "asymmetric_friction"],
        "drive_gain": {joint: round(1.0 / constant, 6) for joint, constant in TORQUE_PER_AMPERE.items()},
    }
    head = "Six-joint arm, motor currents\ndrive_gain [A/(N m)]: the controller's own torque over current at standstill"
    rigs = [write_rig(document, out / "rig.yaml", head)]
    if LOADED_RUN in names:
        loaded = document | {"load": {"robot": "fitted", "unknown_payload": [LOADED_RUN]}}
        rigs.append(write_rig(loaded, out / "rig_load.yaml", f"{head}\n{LOADED_RUN} carries a load at the flange"))
    return tuple(rigs)
