"""Meshes of a robot's links as triangles: STL and COLLADA, which Drake does not draw, are read here.

COLLADA's unit and the transforms of its nodes are applied; its up axis is not, as in RViz.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from drake_tc.errors import ParamsError
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
        """For Drake.

        Args:
            name: For messages.
        """
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
