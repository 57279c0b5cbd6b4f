"""Staubli TX40: one exciting trajectory of six joints at 5 kHz, motor angles and motor torques.

q = R^-1 q_motor and tau = T tau_motor, with the gear ratios on both diagonals, R[6,5] = T[5,6] = 32 for the
coupling of the wrist, and the offsets of joints 2 and 3. The motor torque is the drive's effort (current times its
constant): `<joint>/current` holds the ideal joint torque T tau_motor, in N m at the joint instead of A.
"""

from pathlib import Path

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.importers.files import find, floats, read_table, write_log
from drake_tc.logs.rig import parse_rig, save_rig

PERIOD = 2e-4
RATIOS = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
COUPLING = 32.0
OFFSETS = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
JOINTS = tuple(f"joint_{i}" for i in range(1, 7))


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write `trajectory.parquet` and `rig.yaml`.

    Raises:
        LogError: The two files are not in `src`, have other columns, or differ in length.
    """
    motor = []
    for name in ("pos_read_data", "curr_data"):
        path = find(src, f"{name}.csv*")[0]
        table = read_table(path)
        motor.append(np.column_stack([floats(table, f"Joint_{i}", path) for i in range(1, 7)]))
    angles, torques = motor
    if angles.shape != torques.shape:
        raise LogError(f"{src}: {len(angles)} rows of positions and {len(torques)} of torques; wanted as many of each")
    to_motor, to_joint = RATIOS.copy(), RATIOS.copy()
    to_motor[5, 4] = COUPLING
    to_joint[4, 5] = COUPLING
    position = np.linalg.solve(to_motor, angles.T).T + OFFSETS
    effort = torques @ to_joint.T
    columns = {"time": np.arange(len(position)) * PERIOD}
    for i, joint in enumerate(JOINTS):
        columns |= {f"{joint}/position": position[:, i], f"{joint}/current": effort[:, i]}
    write_log(columns, out / "trajectory.parquet")
    document = {"joints": list(JOINTS), "drive": "current", "load": "unknown", "units": {"position": "rad"}}
    comment = "Staubli TX40\ncurrent is the motor torque times the gear ratio: N m at the joint, not A"
    return (save_rig(parse_rig(document), out / "rig.yaml", comment),)
