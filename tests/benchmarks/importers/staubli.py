"""Staubli TX40: one exciting trajectory of six joints at 5 kHz, motor angles and motor torques.

q = R^-1 q_motor, with the gear ratios on the diagonal, R[6,5] = 32 for the coupling of the wrist, and the offsets of
joints 2 and 3. The motor torque is the drive's effort (current times its constant): `<joint>/torque_command` holds it
times the motor's gear ratio, in N m at the output. Five samples are averaged to one, which leaves 1 kHz.
"""

from pathlib import Path

import numpy as np

from drake_tc.errors import LogError
from drake_tc.types import FloatArray
from tests.benchmarks.importers.files import (
    FITTED_ROBOT,
    find,
    floats,
    read_table,
    read_text,
    write_log,
    write_rig,
    write_robot,
)

PERIOD = 2e-4
AVERAGED = 5
RATIOS = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
COUPLING = 32.0
OFFSETS = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
JOINTS = tuple(f"joint_{i}" for i in range(1, 7))


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write `trajectory.parquet`, the robot and `rig.yaml`.

    Raises:
        LogError: The two files or the URDF are not in `src`, have other columns, or differ in length.
    """
    urdf = read_text(find(src, "*.urdf*")[0])
    motor = []
    for name in ("pos_read_data", "curr_data"):
        path = find(src, f"{name}.csv*")[0]
        table = read_table(path)
        motor.append(np.column_stack([floats(table, f"Joint_{i}", path) for i in range(1, 7)]))
    angles, torques = motor
    if angles.shape != torques.shape:
        raise LogError(
            f"{src}: {len(angles)} rows of positions and {len(torques)} of torques; expected as many of each"
        )
    to_motor = RATIOS.copy()
    to_motor[5, 4] = COUPLING
    position = _averaged(np.linalg.solve(to_motor, angles.T).T + OFFSETS)
    effort = _averaged(torques @ RATIOS)
    columns = {"time": np.arange(len(position)) * AVERAGED * PERIOD}
    for i, joint in enumerate(JOINTS):
        columns |= {f"{joint}/position": position[:, i], f"{joint}/torque_command": effort[:, i]}
    write_log(columns, out / "trajectory.parquet")
    write_robot(urdf, "arm", "base_link", JOINTS, out)
    document = {
        **FITTED_ROBOT,
        "drive": "torque",
        "drive_gain": 1.0,
        "coupled": {JOINTS[5]: {JOINTS[4]: COUPLING / RATIOS[5, 5]}},
        "declared": ["rotor_inertia", "asymmetric_friction"],
    }
    comment = "Staubli TX40\ntorque_command is the motor torque times the gear ratio"
    return (write_rig(document, out / "rig.yaml", comment),)


def _averaged(samples: FloatArray) -> FloatArray:
    """(T // 5, n) means of five neighbours each."""
    size = len(samples) // AVERAGED * AVERAGED
    return np.asarray(samples[:size].reshape(-1, AVERAGED, samples.shape[1]).mean(axis=1))
