"""TIAGo: torso and seven arm joints at 100 Hz, one identification run in three files on one clock.

The effort of the arm joints is a motor current [A]; the torso's position is in metres and its effort a force-like
value in the drive's own unit.

Joints 6 and 7 are a differential: two motors turn with q6 + q7 and q6 - q7. Their currents are reported at the same
instants with equal or opposite values, so e6 + e7 and e6 - e7 are two motors' reports, which are almost never other
than zero together. `wrist/wrist.parquet` has joint 5 and these two motors: q_m = R q, and by power balance
tau_m = R'^-1 tau.
"""

from pathlib import Path

import numpy as np

from drake_tc.errors import LogError
from tests.benchmarks.importers.files import find, floats, read_table, write_log, write_rig

CHANNELS = {"position": "position", "velocity": "velocity", "effort": "current"}
WRIST = ("arm_5_joint", "arm_6_joint", "arm_7_joint")
MOTORS = ("motor_5", "motor_6_plus_7", "motor_6_minus_7")
MOTOR_TURNS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, -1.0]])
"""R, by motor and joint."""
TORQUE_PER_AMPERE = -0.0613 * 336.0
"""Torque constant [N m/A] and gear ratio of the wrist; a positive current turns it backwards."""


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write `identification.parquet` and `rig.yaml`; those of the wrist by motor go to `wrist/`.

    Raises:
        LogError: One of the three files is not in `src`, has other columns, or another clock.
    """
    columns: dict[str, np.ndarray] = {}
    joints: list[str] = []
    for file_name, suffix in CHANNELS.items():
        path = find(src, f"tiago_{file_name}.csv*")[0]
        table = read_table(path)
        time = floats(table, "t", path)
        if "time" in columns and not np.array_equal(columns["time"], time):
            raise LogError(f"{path}: its times differ from those of the other files; expected three files of one run")
        columns["time"] = time
        for name in table.columns:
            if name.endswith(f"_{file_name}"):
                joint = name.removeprefix("-").strip().removesuffix(f"_{file_name}")
                columns[f"{joint}/{suffix}"] = floats(table, name, path)
                joints += [joint] if joint not in joints else []
    if not joints:
        raise LogError(f"{src}: no column ends in _position, _velocity or _effort; expected the TIAGo files")
    write_log(columns, out / "identification.parquet")
    document = {"joints": joints, "drive": "current", "load": "unknown", "units": {"position": "rad"}}
    comment = "TIAGo torso and arm\ncurrent [A] as reported; the torso's position is in m and its effort force-like"
    rigs = [write_rig(document, out / "rig.yaml", comment)]
    if set(WRIST) <= set(joints):
        write_log(_motors(columns), out / "wrist" / "wrist.parquet")
        rigs.append(write_rig(_WRIST_RIG, out / "wrist" / "rig.yaml", _WRIST_COMMENT))
    return tuple(rigs)


_WRIST_RIG = {
    "joints": list(MOTORS),
    "drive": "current",
    "drive_gain": round(-1.0 / TORQUE_PER_AMPERE, 6),
    "load": {"unknown": "smooth"},
    "units": {"position": "rad"},
}
_WRIST_COMMENT = (
    "TIAGo wrist, by motor\nThe current's sign is turned, so that a positive one drives forwards. No robot model comes "
    "with the logs: each motor's load is a smooth function of its own angle."
)


def _motors(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Angles, velocities and currents of the wrist's motors, in joint units."""
    carries = -np.linalg.inv(MOTOR_TURNS).T
    out = {"time": columns["time"]}
    for channel, rows in (("position", MOTOR_TURNS), ("velocity", MOTOR_TURNS), ("current", carries)):
        joints = np.column_stack([columns[f"{joint}/{channel}"] for joint in WRIST])
        out |= {f"{motor}/{channel}": joints @ row for motor, row in zip(MOTORS, rows, strict=True)}
    return out
