"""A robot file of joints that stand by themselves, each carrying a pendulum: for rigs that name no robot."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import yaml

from drake_tc.errors import ParamsError
from drake_tc.logs.loads import GRAVITY, Pendulum
from drake_tc.types import FloatArray

LEAST_EXPLAINED = 0.9
"""Share of the load torque's variance that a pendulum must explain before a measured load counts as one."""
EFFORT = 1e5
"""Torque limit of a joint whose rig knows none [N m]."""


@dataclass(frozen=True)
class Swing:
    """tau = inertia qddot + weight sin(q - zero): [kg m^2], [N m], [rad]."""

    inertia: float
    weight: float
    zero: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 < self.inertia < math.inf and 0.0 <= self.weight < math.inf and math.isfinite(self.zero)):
            raise ParamsError(f"pendulum: expected inertia > 0, weight >= 0 and a finite zero, got {self}")


def swing_of(pendulum: Pendulum) -> Swing:
    """The pendulum that a rig file gives."""
    return Swing(pendulum.inertia, pendulum.weight, pendulum.zero)


def fitted_swing(
    position: FloatArray, velocity: FloatArray, acceleration: FloatArray, torque: FloatArray
) -> tuple[Swing, float] | None:
    """The pendulum nearest to a measured load, and the share of its variance that it explains.

    What the load loses with its speed, beyond the sensor, is fitted beside it and counts as explained.

    Args:
        position: (T,) [rad].
        velocity: (T,) [rad/s].
        acceleration: (T,) [rad/s^2].
        torque: (T,) link side [N m].

    Returns:
        None where no pendulum explains `LEAST_EXPLAINED` of the load.
    """
    columns = np.stack([acceleration, np.sin(position), np.cos(position), velocity], axis=1)
    found = np.linalg.lstsq(columns, torque, rcond=None)[0]
    spread = float(np.sum((torque - torque.mean()) ** 2))
    share = 1.0 - float(np.sum((torque - columns @ found) ** 2)) / max(spread, 1e-300)
    inertia, sine, cosine = (float(value) for value in found[:3])
    if inertia <= 0.0 or share < LEAST_EXPLAINED:
        return None
    return Swing(inertia, math.hypot(sine, cosine), math.atan2(-cosine, sine)), share


def write_pendulum_robot(swings: Mapping[str, Swing], folder: Path) -> Path:
    """Write `pendulums.urdf` and `pendulums.yaml`: one joint beside the other on a fixed base, axes level.

    Of each link only inertia and weight matter; its centre of mass lies where at least half the inertia is about it.

    Returns:
        The robot file.
    """
    parts = ['<link name="base"/>']
    for i, (joint, swing) in enumerate(swings.items()):
        length = min(0.5 * GRAVITY * swing.inertia / swing.weight, 1.0) if swing.weight > 0.0 else 0.0
        mass = swing.weight / (GRAVITY * length) if length > 0.0 else 1.0
        about = swing.inertia - mass * length**2
        x, z = length * math.sin(swing.zero), -length * math.cos(swing.zero)
        parts.append(
            f'<link name="link_{i}"><inertial><origin xyz="{x!r} 0 {z!r}"/><mass value="{mass!r}"/>'
            f'<inertia ixx="{about!r}" iyy="{about!r}" izz="{about!r}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name={quoteattr(joint)} type="revolute"><parent link="base"/><child link="link_{i}"/>'
            f'<origin xyz="0 {2.0 * i!r} 0"/><axis xyz="0 1 0"/>'
            f'<limit effort="{EFFORT!r}" velocity="1000.0" lower="-1000.0" upper="1000.0"/></joint>'
        )
    (folder / "pendulums.urdf").write_text(f'<robot name="pendulums">{"".join(parts)}</robot>\n', encoding="utf-8")
    robot = {
        "name": "pendulums",
        "urdf": "pendulums.urdf",
        "base": "base",
        "fixed_base": True,
        "joints": list(swings),
    }
    path = folder / "pendulums.yaml"
    path.write_text(yaml.safe_dump(robot, sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path
