"""LeRobot SO-101: six Feetech STS3215 position servos, commanded and measured positions at 50 Hz.

The firmware's loop is proportional (P 16, I 0), so the position error tells the duty: 0.164 of it per unit of P and
rad, measured by others on this servo, times a stall torque of 2.9 N m gives 7.7 N m/rad. The current register has no
sign and its velocity register no resolution: neither is read. The jaw is a fraction of an unknown range: locked.

In about half of the runs the gripper comes down on the table: where the URDF puts its tip more than 25 mm below the
plane of the base, the efforts of joints 2 to 4 change by up to 0.15 rad, whatever the direction; above -20 mm they
depend on the direction alone. The column `tip_height` has that height, and `rig_free.yaml` leaves out the rows below
`TABLE` by its key `valid`.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from drake_tc.errors import LogError
from drake_tc.types import FloatArray
from tests.benchmarks.importers.files import FITTED_ROBOT, find, read_logs, read_text, write_log, write_rig, write_robot

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
"""Joints of the URDF in the order of the columns."""
JAW = "gripper"
DRIVE_GAIN = 0.13
"""Error for one newton metre by the proportional law [rad/(N m)]: 1 / (0.164 * 16 * 2.9)."""
TIP = "gripper_frame_link"
TABLE = -0.02
"""Height of the tip in the frame of the base [m] below which the gripper may touch the table."""
CHANNELS = {"pos": "position", "cmd": "position_command"}


def convert(src: Path, out: Path) -> tuple[Path, ...]:
    """Write one log a run, the robot and `rig.yaml`.

    Raises:
        LogError: No runs or no URDF in `src`, a file with other columns, or another robot's URDF.
    """
    model = find(src, "so101*.urdf*")[0]
    urdf = read_text(model)
    names = {
        f"{joint}/{name}": f"{key}_{number}"
        for number, joint in enumerate(JOINTS, start=1)
        for key, name in CHANNELS.items()
    }
    for run, columns in read_logs(src, "*.csv*", names):
        angles = {joint: columns[f"{joint}/position"] for joint in JOINTS}
        columns["tip_height"] = tip_height(urdf, angles, str(model))
        write_log(columns, out / f"{run}.parquet")
    write_robot(urdf, "so101", "base_link", JOINTS, out, locked={JAW: 0.0})
    document = {
        **FITTED_ROBOT,
        "drive": "position_servo",
        "declared": ["rotor_inertia", "asymmetric_friction"],
        "drive_gain": DRIVE_GAIN,
    }
    comment = "SO-101 follower arm, the jaw locked\ndrive_gain [rad/(N m)]: proportional law of the STS3215 at P 16"
    free = f"{comment}\nrows in which the gripper may touch the table are left out"
    return (
        write_rig(document, out / "rig.yaml", comment),
        write_rig(document | {"valid": f"tip_height > {TABLE}"}, out / "rig_free.yaml", free),
    )


def tip_height(urdf: str, positions: Mapping[str, FloatArray], source: str) -> FloatArray:
    """Height of `TIP` in the frame of the URDF's root (T,) [m].

    Args:
        urdf: Text of the URDF.
        positions: (T,) of the joints that turn [rad]; all others are at 0.
        source: Named in errors.

    Raises:
        LogError: The URDF has no such link.
    """
    above = {_link(joint, "child"): joint for joint in ET.fromstring(urdf).findall("joint")}
    if TIP not in above:
        raise LogError(f"{source}: no link {TIP!r}; expected the URDF of the SO-101")
    point = np.zeros((len(next(iter(positions.values()))), 3))
    link = TIP
    while link in above:
        joint = above[link]
        name = joint.get("name", "")
        if name in positions:
            axis = _numbers(joint.find("axis"), "xyz")
            point = Rotation.from_rotvec(np.outer(positions[name], axis)).apply(point)
        origin = joint.find("origin")
        point = Rotation.from_euler("xyz", _numbers(origin, "rpy")).apply(point) + _numbers(origin, "xyz")
        link = _link(joint, "parent")
    return np.asarray(point[:, 2])


def _link(joint: ET.Element, end: str) -> str:
    found = joint.find(end)
    return "" if found is None else found.get("link", "")


def _numbers(element: ET.Element | None, name: str) -> FloatArray:
    text = "0 0 0" if element is None else element.get(name, "0 0 0")
    return np.array([float(part) for part in text.split()])
