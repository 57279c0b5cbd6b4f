"""Robots of the comparison: the pendulum that stands for a joint, and a robot with changed parts.

A robot file of joints that stand by themselves, each with a pendulum or a sliding mass: for rigs without a robot.

A robot's file with its base held, for one of which nothing says what carries it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import yaml

from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError
from drake_tc.logs.loads import Pendulum
from drake_tc.robot.robot import Robot
from drake_tc.types import GRAVITY, FloatArray

WEIGHT_MARGIN = 1.05
"""Over the weight that a mass can have, for the error of the fit."""
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


@dataclass(frozen=True)
class Slide:
    """force = mass qddot + weight, of a joint that slides: [kg], [N] along its axis, |weight| <= mass g."""

    mass: float
    weight: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 < self.mass < math.inf and abs(self.weight) <= GRAVITY * self.mass):
            raise ParamsError(f"sliding mass: expected mass > 0 and a weight of at most mass g, got {self}")


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


def fitted_slide(velocity: FloatArray, acceleration: FloatArray, force: FloatArray) -> tuple[Slide, float] | None:
    """The mass with its weight that is nearest to a measured load of a joint that slides, and the share it explains.

    What the load loses with its speed, beyond the sensor, is fitted beside it and counts as explained.

    Args:
        velocity: (T,) [m/s].
        acceleration: (T,) [m/s^2].
        force: (T,) link side [N].

    Returns:
        None where no mass explains `LEAST_EXPLAINED` of the load, or where the constant force is no weight of it.
    """
    columns = np.stack([acceleration, np.ones(force.size), velocity], axis=1)
    found = np.linalg.lstsq(columns, force, rcond=None)[0]
    spread = float(np.sum((force - force.mean()) ** 2))
    share = 1.0 - float(np.sum((force - columns @ found) ** 2)) / max(spread, 1e-300)
    mass, weight = float(found[0]), float(found[1])
    if mass <= 0.0 or share < LEAST_EXPLAINED or abs(weight) > WEIGHT_MARGIN * GRAVITY * mass:
        return None
    return Slide(mass, float(np.clip(weight, -GRAVITY * mass, GRAVITY * mass))), share


def write_pendulum_robot(swings: Mapping[str, Swing | Slide], folder: Path) -> Path:
    """Write `pendulums.urdf` and `pendulums.yaml`: one joint beside the other on a fixed base.

    Of each link only inertia and weight matter. The axis of a pendulum is level, and its centre of mass lies where at
    least half the inertia is about it. The axis of a joint that slides rises at the slope at which the mass has its
    weight along it.

    Returns:
        The robot file.
    """
    parts = ['<link name="base"/>']
    for i, (joint, swing) in enumerate(swings.items()):
        if isinstance(swing, Slide):
            parts.append(_slide_parts(i, joint, swing))
            continue
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


def _slide_parts(number: int, joint: str, slide: Slide) -> str:
    rise = slide.weight / (GRAVITY * slide.mass)
    axis = f"{math.sqrt(1.0 - rise**2)!r} 0 {rise!r}"
    return (
        f'<link name="link_{number}"><inertial><mass value="{slide.mass!r}"/>'
        f'<inertia ixx="{slide.mass!r}" iyy="{slide.mass!r}" izz="{slide.mass!r}" ixy="0" ixz="0" iyz="0"/>'
        f'</inertial></link><joint name={quoteattr(joint)} type="prismatic"><parent link="base"/>'
        f'<child link="link_{number}"/><origin xyz="0 {2.0 * number!r} 0"/><axis xyz="{axis}"/>'
        f'<limit effort="{EFFORT!r}" velocity="1000.0" lower="-1000.0" upper="1000.0"/></joint>'
    )


def write_welded_robot(robot: Robot, folder: Path) -> Path:
    """Write `welded.yaml`: the robot with `fixed_base: true`, for one of which nothing says what carries it.

    Returns:
        The file.

    Raises:
        ParamsError: the robot's file cannot be read.
    """
    return _write(robot, folder / "welded.yaml", {"fixed_base": True})


def _write(robot: Robot, path: Path, changes: Mapping[str, object]) -> Path:
    """The robot's file with some fields changed, its files named from the root."""
    document = read_yaml(robot.source, "robot file") | {"urdf": str(robot.urdf.resolve())}
    if robot.actuators is not None:
        document["actuators"] = str(robot.actuators.resolve())
    path.write_text(yaml.safe_dump(document | dict(changes), sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path
