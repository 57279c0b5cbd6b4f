"""A small arm for the tests of shared causes: three joints, one of which slides, F/T sensor, IMU, floating base."""

from pathlib import Path

import numpy as np

LINK = """<link name="{name}"><inertial><origin xyz="{com}" rpy="0 0 0"/><mass value="{mass}"/>
<inertia ixx="{i}" iyy="{j}" izz="{k}" ixy="0.001" ixz="-0.0005" iyz="0.0008"/></inertial></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="100" velocity="10"/></joint>"""
LINKS = {
    "body": (6.0, (0.0, 0.01, 0.1), (0.06, 0.07, 0.05)),
    "upper": (2.0, (0.02, 0.01, -0.1), (0.02, 0.03, 0.015)),
    "slide": (1.5, (0.05, -0.02, -0.05), (0.01, 0.012, 0.015)),
    "lower": (1.2, (0.01, 0.03, -0.12), (0.01, 0.011, 0.006)),
    "hand": (0.7, (0.02, 0.0, -0.04), (0.004, 0.005, 0.003)),
}
JOINTS = (
    ("turn", "revolute", "body", "upper", "0.05 0 -0.1", "0.1 0.2 0", "0 1 0"),
    ("push", "prismatic", "upper", "slide", "0 0 -0.2", "0 0.3 0", "0 0 1"),
    ("bend", "revolute", "slide", "lower", "0.02 0.05 -0.1", "0 0 0.4", "1 0 0"),
    ("wrist", "fixed", "lower", "hand", "0 0 -0.25", "0 0 0", "1 0 0"),
)
ROBOT = """name: small_arm
urdf: arm.urdf
base: body
fixed_base: false
joints: [turn, push, bend]
imu: {chest: {link: body, xyz: [0.02, 0.01, 0.15], rpy: [0.1, -0.2, 0.3]}}
force_torque: {wrist: {joint: wrist, xyz: [0.0, 0.01, -0.01], rpy: [0.2, 0.0, 0.1]}}
"""


def write_robot(
    folder: Path, masses: dict[str, float] | None = None, coms: dict[str, np.ndarray] | None = None
) -> Path:
    """The robot's files in `folder`, with other masses (and inertias along) or centres of mass where given."""
    text = ['<robot name="small_arm">']
    for name, (mass, com, inertia) in LINKS.items():
        weight = (masses or {}).get(name, mass)
        centre = (coms or {}).get(name, np.array(com))
        moments = np.array(inertia) * weight / mass
        products = weight / mass
        axes = dict(zip("ijk", moments, strict=True))
        tag = LINK.format(name=name, com=" ".join(repr(float(c)) for c in centre), mass=weight, **axes)
        for key, value in (("ixy", 0.001), ("ixz", -0.0005), ("iyz", 0.0008)):
            tag = tag.replace(f'{key}="{value}"', f'{key}="{value * products!r}"')
        text.append(tag)
    keys = ("name", "kind", "parent", "child", "xyz", "rpy", "axis")
    text += [JOINT.format(**dict(zip(keys, joint, strict=True))) for joint in JOINTS]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text("\n".join([*text, "</robot>"]), encoding="utf-8")
    (folder / "arm.yaml").write_text(ROBOT, encoding="utf-8")
    return folder / "arm.yaml"
