"""What is drawn of a robot: the visual geometry of its URDF, and frustums along the links that have none."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from pydrake.geometry import Mesh, Rgba, Shape
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from drake_tc.errors import ParamsError
from drake_tc.robot.mesh_files import DRAWN, Triangles, read_triangles
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf_checks import numbers
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.simulator_files.urdf import resolve
from drake_tc.types import FloatArray

_LOG = logging.getLogger(__name__)
GREY = Rgba(0.7, 0.72, 0.75, 1.0)
SIDES = 16
"""Of a frustum."""
SLENDER = 0.14
"""Radius of a frustum at its wide end over its length."""
STUB = 0.35
"""Length of a link without a joint beyond it, over the mean length of the others."""


@dataclass(frozen=True, eq=False)
class Picture:
    """One shape of a link: X_LG, what it is, and its colour."""

    pose: RigidTransform
    shape: Shape
    colour: Rgba


def add_pictures(plant: MultibodyPlant, robot: Robot, model: ModelInstanceIndex) -> None:
    """Register what is drawn with a plant that is not finalized and has a SceneGraph.

    Shapes that Drake's parser has drawn already, boxes, cylinders, spheres and capsules, are left to it. A mesh that
    cannot be read logs a warning and is left out.

    Args:
        plant: Holds the robot.
        robot: From `load_robot`.
        model: Its instance.
    """
    tree = read_urdf(robot.urdf, robot.splits)
    colours = {tag.get("name"): tag for tag in tree.root.findall("material")}
    bare: list[str] = []
    for link in tree.root.findall("link"):
        name = str(link.get("name"))
        if name not in tree.links:
            continue
        body: Any = plant.GetBodyByName(name, model)
        drawn = len(plant.GetVisualGeometriesForBody(body))
        for number, each in enumerate(_meshes(link, robot, colours)):
            shape: Any = each.shape
            plant.RegisterVisualGeometry(body, each.pose, shape, f"{name}_mesh_{number}", each.colour.rgba)
            drawn += 1
        bare += [] if drawn else [name]
    ends: dict[str, list[FloatArray]] = {name: [] for name in tree.links}
    for joint in tree.joints.values():
        ends[joint.parent].append(np.asarray(joint.origin.transform.translation()))
    for name, each in frustums(ends, bare):
        plant.RegisterVisualGeometry(
            plant.GetBodyByName(name, model), each.pose, each.shape, f"{name}_{id(each)}", each.colour.rgba
        )


def _meshes(link: ET.Element, robot: Robot, colours: dict[str | None, ET.Element]) -> Iterator[Picture]:
    for visual in link.findall("visual"):
        tag = visual.find("geometry/mesh")
        if tag is None:
            continue
        where = f"{robot.urdf}: link {link.get('name')}"
        try:
            path = resolve(str(tag.get("filename")).removeprefix("file://"), robot.urdf.parent)
            origin = visual.find("origin")
            pose = _pose(where, origin)
            scale: Any = np.array(numbers(where, tag.get("scale", "1 1 1"), 3))
            colour = _material(visual.find("material"), colours)
            if path.suffix.lower() in DRAWN:
                yield Picture(pose, Mesh(path, scale), colour or GREY)
                continue
            for part in read_triangles(path):
                own = GREY if part.colour is None else Rgba(*part.colour)
                scaled = Triangles(part.vertices * scale, part.faces)
                yield Picture(pose, scaled.shape(path.name), colour or own)
        except (ParamsError, RuntimeError) as error:
            _LOG.warning("%s: a mesh is not drawn: %s", where, " ".join(str(error).split()))


def _pose(where: str, origin: ET.Element | None) -> RigidTransform:
    xyz, rpy = ("0 0 0" if origin is None else origin.get(name, "0 0 0") for name in ("xyz", "rpy"))
    place: Any = np.array(numbers(where, xyz, 3))
    return RigidTransform(RollPitchYaw(*numbers(where, rpy, 3)), place)


def _material(tag: ET.Element | None, colours: dict[str | None, ET.Element]) -> Rgba | None:
    if tag is None:
        return None
    colour = tag.find("color")
    if colour is None and tag.get("name") in colours:
        colour = colours[tag.get("name")].find("color")
    return None if colour is None else Rgba(*(float(part) for part in colour.get("rgba", "0.7 0.7 0.7 1").split()))


def frustums(ends: Mapping[str, list[FloatArray]], links: Sequence[str]) -> Iterator[tuple[str, Picture]]:
    """(link, frustum) from a link's origin to each joint beyond it; a stub where there is none.

    Args:
        ends: Link to the origins (3,) of the joints beyond it, in its frame [m].
        links: Those to draw.
    """
    lengths = [length for each in ends.values() for end in each if (length := float(np.linalg.norm(end))) > 1e-3]
    mean = float(np.mean(lengths)) if lengths else 0.1
    for link in links:
        targets = [end for end in ends[link] if np.linalg.norm(end) > 1e-3]
        for end in targets or [np.array([0.0, 0.0, -STUB * mean])]:
            yield link, Picture(RigidTransform(), frustum(end, mean).shape(link), GREY)


def frustum(end: FloatArray, mean: float) -> Triangles:
    """A frustum from the origin to `end` (3,) [m]; short links are no thinner than half the mean length asks for."""
    length = float(np.linalg.norm(end))
    axis = end / length
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    around = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    ring = np.cos(around)[:, None] * across + np.sin(around)[:, None] * np.cross(axis, across)
    wide = SLENDER * max(length, 0.5 * mean)
    vertices = np.vstack([wide * ring, end + 0.6 * wide * ring, np.zeros(3), end])
    here = np.arange(SIDES)
    after = (here + 1) % SIDES
    side = [(here, after, here + SIDES), (after, after + SIDES, here + SIDES)]
    caps = [(after, here, np.full(SIDES, 2 * SIDES)), (here + SIDES, after + SIDES, np.full(SIDES, 2 * SIDES + 1))]
    return Triangles(vertices, np.concatenate([np.stack(each, axis=1) for each in (*side, *caps)]))
