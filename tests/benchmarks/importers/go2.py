"""Unitree Go2 hanging by its trunk (IIT-DLSLab): twelve leg joints under a known PD law, positions at 200 Hz.

The drives run torque = Kp (q_cmd - q) - Kd qdot with Kp = 20 N m/rad and Kd = 1.5 N m s/rad: position servos with a
gain of 1/Kp whose damping shows up as viscous friction. The set has an MJCF; its URDF is made from it.
"""

from pathlib import Path

from tests.benchmarks.importers.files import FITTED_ROBOT, find, read_logs, read_text, write_log, write_rig, write_robot
from tests.benchmarks.importers.mjcf import urdf_of_mjcf

STIFFNESS = 20.0
"""Kp [N m/rad]."""
CHANNELS = {"q": "position", "q_cmd": "position_command"}


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
    names = {f"{joint}/{name}": f"{key}_{joint}" for joint in joints for key, name in CHANNELS.items()}
    for run, columns in read_logs(src, "traj_*.csv*", names):
        write_log(columns, out / f"{run}.parquet")
    write_robot(urdf, "go2", base, joints, out)
    document = {
        **FITTED_ROBOT,
        "drive": "position_servo",
        "declared": ["rotor_inertia", "asymmetric_friction"],
        "drive_gain": 1.0 / STIFFNESS,
    }
    comment = "Go2 hanging by its trunk, taken as level\ndrive_gain [rad/(N m)]: 1/Kp; Kd shows as viscous friction"
    return (write_rig(document, out / "rig.yaml", comment),)
