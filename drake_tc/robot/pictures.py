"""Meshes of a robot's links as triangles: STL and COLLADA, which Drake does not draw, are read here.

No reader of another package is used: Drake reads OBJ, glTF and VTK files alone, and trimesh needs pycollada beside it
for COLLADA, two more packages for the hundred lines below.

COLLADA's unit and the transforms of its nodes are applied; its up axis is not, as in RViz.

What is drawn of a robot: the visual geometry of its URDF, and frustums along the links that have none.
"""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh, Rgba, Shape
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from drake_tc.errors import ParamsError
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf_tree import numbers, read_urdf
from drake_tc.simulator_files.urdf import resolve
from drake_tc.types import FloatArray, IntArray

DRAWN = (".obj", ".gltf", ".glb")
"""Endings of files that Drake draws itself."""
Colour = tuple[float, float, float, float]
_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_TRIANGLES = ("triangles", "polylist")


@dataclass(frozen=True, eq=False)
class Triangles:
    """A surface: vertices (V, 3) [m], faces (F, 3) of their numbers, and its colour where the file gives one."""

    vertices: FloatArray
    faces: IntArray
    colour: Colour | None = None

    def shape(self, name: str) -> Mesh:
        """For Drake."""
        lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in self.vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (self.faces + 1).tolist()]
        return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines), ".obj", name)), 1.0)


def read_triangles(path: Path) -> list[Triangles]:
    """The surfaces of an STL or COLLADA file.

    Raises:
        ParamsError: another file, or one that cannot be read.
    """
    kind = path.suffix.lower()
    try:
        if kind == ".stl":
            return [_stl(path.read_bytes())]
        if kind == ".dae":
            return _collada(ET.fromstring(path.read_bytes()))
    except (OSError, ET.ParseError, ValueError, KeyError, IndexError, AttributeError) as error:
        raise ParamsError(f"{path}: no mesh that can be read: {error}") from None
    raise ParamsError(f"{path}: expected a mesh that ends in .stl, .dae, {', '.join(DRAWN)}")


def _stl(content: bytes) -> Triangles:
    count = int.from_bytes(content[80:84], "little")
    if len(content) == 84 + _STL.itemsize * count:
        corners = np.frombuffer(content, _STL, count, 84)["corners"].reshape(-1, 3)
    else:
        words = [line.split() for line in content.decode("ascii", "replace").splitlines()]
        corners = np.array([line[1:4] for line in words if line[:1] == ["vertex"]], dtype=float).reshape(-1, 3)
    vertices, places = np.unique(corners.astype(np.float64), axis=0, return_inverse=True)
    return Triangles(vertices, places.reshape(-1, 3))


def _collada(root: ET.Element) -> list[Triangles]:
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    known = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
    unit = root.find("asset/unit")
    scale = np.diag([*[float("1" if unit is None else unit.get("meter", "1"))] * 3, 1.0])
    return [each for scene in root.iter("visual_scene") for node in scene for each in _node(node, scale, known)]


def _node(node: ET.Element, above: FloatArray, known: dict[str, ET.Element]) -> Iterator[Triangles]:
    here = above @ _transform(node)
    for instance in node.findall("instance_geometry"):
        bound = {each.get("symbol"): each.get("target", "") for each in instance.iter("instance_material")}
        for surface in known[instance.get("url", "")].iter("mesh"):
            for primitive in (each for name in _TRIANGLES for each in surface.findall(name)):
                colour = _colour(bound.get(primitive.get("material"), ""), known)
                yield from _surface(primitive, here, known, colour)
    for child in node.findall("node"):
        yield from _node(child, here, known)


def _transform(node: ET.Element) -> FloatArray:
    total = np.eye(4)
    for element in node:
        if element.tag not in ("matrix", "translate", "rotate", "scale"):
            continue
        numbers, step = np.array((element.text or "").split(), dtype=float), np.eye(4)
        if element.tag == "matrix":
            step = numbers.reshape(4, 4)
        elif element.tag == "translate":
            step[:3, 3] = numbers
        elif element.tag == "scale":
            step[:3, :3] = np.diag(numbers)
        else:
            x, y, z = numbers[:3] / max(float(np.linalg.norm(numbers[:3])), 1e-12)
            cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            angle = np.radians(numbers[3])
            step[:3, :3] = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
        total = total @ step
    return total


def _surface(
    primitive: ET.Element, here: FloatArray, known: dict[str, ET.Element], colour: Colour | None
) -> Iterator[Triangles]:
    inputs = {each.get("semantic"): each for each in primitive.findall("input")}
    width = 1 + max(int(each.get("offset", "0")) for each in inputs.values())
    numbers = np.array((primitive.findtext("p") or "").split(), dtype=np.int64)
    if not numbers.size:
        return
    corners = numbers.reshape(-1, width)[:, int(inputs["VERTEX"].get("offset", "0"))]
    source = known[inputs["VERTEX"].get("source", "")].find("input[@semantic='POSITION']").get("source")  # type: ignore[union-attr]
    values = np.array(known[str(source)].findtext("float_array", "").split(), dtype=float).reshape(-1, 3)
    counts = np.array((primitive.findtext("vcount") or "").split(), dtype=np.int64)
    if counts.size:
        ends = np.cumsum(counts)
        fans = [corners[[a, i, i + 1]] for a, b in zip(ends - counts, ends, strict=True) for i in range(a + 1, b - 1)]
        corners = np.concatenate(fans) if fans else corners[:0]
    yield Triangles(values @ here[:3, :3].T + here[:3, 3], corners.reshape(-1, 3), colour)


def _colour(material: str, known: dict[str, ET.Element]) -> Colour | None:
    """Of an effect with a plain diffuse colour."""
    effect = None if material not in known else known[material].find("instance_effect")
    named = None if effect is None else known.get(effect.get("url", ""))
    text = None if named is None else named.findtext(".//diffuse/color")
    numbers = [float(each) for each in (text or "").split()]
    return (numbers[0], numbers[1], numbers[2], 1.0) if len(numbers) >= 3 else None


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
