"""Unitree Go2 hanging by its trunk (IIT-DLSLab): twelve leg joints under a known PD law, positions at 200 Hz.

The drives run torque = Kp (q_cmd - q) - Kd qdot with Kp = 20 N m/rad and Kd = 1.5 N m s/rad: position servos with a
gain of 1/Kp whose damping shows up as viscous friction. The set has an MJCF; its URDF is made from it.
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
from drake_tc.logs.importers.mjcf import urdf_of_mjcf

STIFFNESS = 20.0
"""Kp [N m/rad]."""


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write the log, the robot and `rig.yaml`.

    Raises:
        LogError: No run or no MJCF in `src`, a file with other columns, or a model without a hinge.
    """
    model = find(src, "go2.xml*")[0]
    urdf, base, hinges = urdf_of_mjcf(read_text(model), str(model))
    joints = [hinge.removesuffix("_joint") for hinge in hinges]
    for hinge, joint in zip(hinges, joints, strict=True):
        urdf = urdf.replace(f'<joint name="{hinge}"', f'<joint name="{joint}"')
    for path in find(src, "traj_*.csv*"):
        table = read_table(path)
        columns: dict[str, np.ndarray] = {"time": floats(table, "time", path)}
        for joint in joints:
            columns[f"{joint}/position"] = floats(table, f"q_{joint}", path)
            columns[f"{joint}/position_command"] = floats(table, f"q_cmd_{joint}", path)
        write_log(columns, out / f"{run_name(path)}.parquet")
    write_robot(urdf, "go2", base, joints, out)
    document = {
        "robot": "robot.yaml",
        "drive": "position_servo",
        "load": {"robot": "fitted"},
        "units": {"position": "rad"},
        "declared": ["rotor_inertia", "asymmetric_friction"],
        "drive_gain": 1.0 / STIFFNESS,
    }
    comment = "Go2 hanging by its trunk, taken as level\ndrive_gain [rad/(N m)]: 1/Kp; Kd shows as viscous friction"
    return (write_rig(document, out / "rig.yaml", comment),)
