"""LeRobot SO-101: six Feetech STS3215 position servos, commanded and measured positions at 50 Hz.

The firmware's loop is proportional (P 16, I 0), so the position error tells the duty: 0.164 of it per unit of P and
rad, measured by others on this servo, times a stall torque of 2.9 N m gives 7.7 N m/rad. The current register has no
sign and its velocity register no resolution: neither is read. The jaw is a fraction of an unknown range: locked.
"""

from pathlib import Path

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

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
"""Joints of the URDF in the order of the columns."""
JAW = "gripper"
DRIVE_GAIN = 0.13
"""Error for one newton metre by the proportional law [rad/(N m)]: 1 / (0.164 * 16 * 2.9)."""
CHANNELS = {"pos": "position", "cmd": "position_command"}


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one log a run, the robot and `rig.yaml`.

    Raises:
        LogError: No runs or no URDF in `src`, or a file with other columns.
    """
    urdf = read_text(find(src, "so101*.urdf*")[0])
    for path in find(src, "*.csv*"):
        table = read_table(path)
        columns: dict[str, np.ndarray] = {"time": floats(table, "time", path)}
        for number, joint in enumerate(JOINTS, start=1):
            columns |= {f"{joint}/{name}": floats(table, f"{key}_{number}", path) for key, name in CHANNELS.items()}
        write_log(columns, out / f"{run_name(path)}.parquet")
    write_robot(urdf, "so101", "base_link", JOINTS, out, locked={JAW: 0.0})
    document = {
        "robot": "robot.yaml",
        "drive": "position_servo",
        "load": {"robot": "fitted"},
        "units": {"position": "rad"},
        "drive_gain": DRIVE_GAIN,
    }
    comment = "SO-101 follower arm, the jaw locked\ndrive_gain [rad/(N m)]: proportional law of the STS3215 at P 16"
    return (write_rig(document, out / "rig.yaml", comment),)
