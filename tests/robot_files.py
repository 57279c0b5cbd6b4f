"""URDF and robot file of a small robot, written as text."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml


def link_tag(name: str, com: Sequence[float], mass: float, inertia: Sequence[float]) -> str:
    """A link; inertia (3,) or (6,) [kg m^2] about its centre of mass: xx, yy, zz, and xy, xz, yz where not zero."""
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    values = " ".join(f'{key}="{value}"' for key, value in zip(keys, (*inertia, 0, 0, 0)[:6], strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz="{_text(com)}"/><mass value="{mass}"/><inertia {values}/>'
        "</inertial></link>"
    )


def joint_tag(
    name: str,
    parent: str,
    child: str,
    *,
    axis: Sequence[float],
    xyz: Sequence[float] = (0, 0, 0),
    rpy: Sequence[float] = (0, 0, 0),
    kind: str = "revolute",
) -> str:
    """A joint with wide limits."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/><axis xyz="{_text(axis)}"/>'
        '<limit lower="-3" upper="3" effort="50" velocity="5"/></joint>'
    )


def urdf(*parts: str, name: str = "arm", base: str = "base") -> str:
    """A robot of a base without mass and the given links and joints."""
    return f'<robot name="{name}"><link name="{base}"/>{"".join(parts)}</robot>'


def write_robot(folder: Path, text: str, joints: Sequence[str], **changes: Any) -> Path:
    """The robot file for the URDF `text` in `folder`; a change to None takes the key away."""
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    document: dict[str, Any] = {
        "name": "arm",
        "urdf": "arm.urdf",
        "base": "base",
        "fixed_base": True,
        "joints": list(joints),
        **changes,
    }
    path = folder / "arm.yaml"
    written = yaml.safe_dump({key: value for key, value in document.items() if value is not None}, sort_keys=False)
    path.write_text(written, encoding="utf-8")
    return path


def _text(values: Sequence[float]) -> str:
    return " ".join(map(str, values))
