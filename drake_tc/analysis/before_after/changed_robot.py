"""A robot's file with its base held, or with other link masses: what a loop before and after needs of it."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import yaml

from drake_tc.errors import ParamsError
from drake_tc.robot.robot import Robot
from drake_tc.yaml_file import read_yaml


def write_welded_robot(robot: Robot, folder: Path) -> Path:
    """Write `welded.yaml`: the robot with `fixed_base: true`, for one of which nothing says what carries it.

    Returns:
        The file.

    Raises:
        ParamsError: the robot's file cannot be read.
    """
    return _write(robot, folder / "welded.yaml", {"fixed_base": True})


def mass_factors(robot: Robot, more: Mapping[str, float]) -> dict[str, float]:
    """Link to the factor on its mass, from what each link weighs more than the URDF says [kg].

    Raises:
        ParamsError: a link without mass, or one that would weigh nothing.
    """
    known = {link.get("name"): link.find("inertial/mass") for link in ElementTree.parse(robot.urdf).iter("link")}
    factors = {}
    for name, kilograms in more.items():
        entry = known.get(name)
        mass = 0.0 if entry is None else float(entry.get("value", "0"))
        if mass <= 0.0 or mass + kilograms <= 0.0:
            raise ParamsError(f"{robot.source}: link {name!r} of {mass:g} kg cannot weigh {kilograms:g} kg more")
        factors[name] = (mass + kilograms) / mass
    return factors


def write_robot_of_masses(robot: Robot, folder: Path, factors: Mapping[str, float]) -> Path:
    """Write `masses.yaml` and its URDF: the same links, their mass and inertia multiplied by a factor each.

    Returns:
        The robot file.

    Raises:
        ParamsError: the robot's file cannot be read.
    """
    tree = ElementTree.parse(robot.urdf)
    for link in tree.iter("link"):
        factor = factors.get(link.get("name", ""))
        if factor is None:
            continue
        for entry in (*link.iterfind("inertial/mass"), *link.iterfind("inertial/inertia")):
            for key, value in entry.attrib.items():
                entry.set(key, repr(factor * float(value)))
    urdf = folder / "masses.urdf"
    tree.write(urdf)
    return _write(robot, folder / "masses.yaml", {"urdf": str(urdf)})


def _write(robot: Robot, path: Path, changes: Mapping[str, object]) -> Path:
    """The robot's file with some fields changed, its files named from the root."""
    document = read_yaml(robot.source, "robot file") | {"urdf": str(robot.urdf.resolve())}
    if robot.actuators is not None:
        document["actuators"] = str(robot.actuators.resolve())
    path.write_text(yaml.safe_dump(document | dict(changes), sort_keys=False, allow_unicode=True), encoding="utf-8")
    return path
