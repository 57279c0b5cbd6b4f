"""What is drawn of a robot: meshes of its URDF, frustums for links without any; their volumes are known."""

import logging
import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_tc.errors import ParamsError
from drake_tc.robot.pictures import frustum, read_triangles
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import load_robot
from tests.robot_files import joint_tag, urdf, write_robot

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
"""A tetrahedron of volume 1."""


def volume(surface):
    """Enclosed by triangles, by the divergence theorem."""
    a, b, c = surface.vertices[surface.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def binary():
    rows = [struct.pack("<12fH", 0, 0, 0, *CORNERS[face].ravel(), 0) for face in FACES]
    return b"solid by name only".ljust(80) + struct.pack("<I", len(rows)) + b"".join(rows)


def ascii_text():
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x:g} {y:g} {z:g}\n" for x, y, z in CORNERS[face])
        + "endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid t\n{facets}endsolid t\n".encode()


def collada(primitive="triangles"):
    numbers = " ".join(map(str, FACES.ravel()))
    counts = "<vcount>3 3 3 3</vcount>" if primitive == "polylist" else ""
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_effects><effect id="red"><profile_COMMON><technique sid="c"><lambert><diffuse>
<color>0.8 0.1 0.1 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="paint"><instance_effect url="#red"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="f" count="12">
{" ".join(map(str, CORNERS.ravel()))}</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<{primitive} material="m" count="4"><input semantic="VERTEX" source="#v" offset="0"/>{counts}
<p>{numbers}</p></{primitive}>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>100 0 0</translate><rotate>0 0 1 90</rotate>
<node><scale>2 1 1</scale><instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="m" target="#paint"/></technique_common></bind_material></instance_geometry></node></node>
</visual_scene></library_visual_scenes></COLLADA>""".encode()


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.stl", binary(), 1.0),
        ("b.STL", ascii_text(), 1.0),
        ("c.dae", collada(), 2.0e-6),
        ("d.dae", collada("polylist"), 2.0e-6),
    ],
)
def test_meshes_are_read_with_units_and_transforms(tmp_path, name, content, expected):
    (path := tmp_path / name).write_bytes(content)
    (surface,) = read_triangles(path)
    assert surface.faces.shape == (4, 3)
    assert_allclose(volume(surface), expected, rtol=1e-6)
    if path.suffix == ".dae":
        assert surface.colour == (0.8, 0.1, 0.1, 1.0)
        # scaled by 2 along x, turned by 90 degrees about z, moved by 1 m
        assert_allclose(surface.vertices, [[1, 0, 0], [1, 0.02, 0], [0.98, 0, 0], [1, 0, 0.03]], atol=1e-12)


@pytest.mark.parametrize("content", [b"<COLLADA><library", b"", collada().replace(b'url="#g"', b'url="#lost"')])
def test_a_broken_mesh_is_one_line(tmp_path, content):
    (path := tmp_path / "x.dae").write_bytes(content)
    with pytest.raises(ParamsError, match=r"x\.dae: no mesh that can be read"):
        read_triangles(path)


def test_a_frustum_has_its_volume():
    """h/3 (A + A' + sqrt(A A')) of a regular polygon of 16 sides."""
    surface = frustum(np.array([0.3, -0.2, 0.6]), 0.1)
    length = 0.7
    wide = 0.14 * length
    area = 8.0 * np.sin(2.0 * np.pi / 16) * wide**2
    assert_allclose(volume(surface), length / 3.0 * area * (1.0 + 0.36 + 0.6), rtol=1e-9)


def test_every_link_is_drawn_and_what_cannot_be_read_is_told(tmp_path, caplog):
    (tmp_path / "part.stl").write_bytes(binary())
    shape = '<visual><origin xyz="0 0 1"/><geometry><mesh filename="{}" scale="0.1 0.1 0.1"/></geometry></visual>'
    links = {"upper": shape.format("part.stl"), "fore": shape.format("package://nowhere/lost.stl"), "hand": ""}
    mass = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    text = urdf(
        *(f'<link name="{name}">{mass}{inside}</link>' for name, inside in links.items()),
        joint_tag("a", "base", "upper", axis=(0, 1, 0), xyz=(0, 0, 0.4)),
        joint_tag("b", "upper", "fore", axis=(0, 1, 0), xyz=(0, 0, 0.3)),
        joint_tag("c", "fore", "hand", axis=(0, 1, 0), xyz=(0, 0, 0.3)),
    )
    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, 1e-3)
    with caplog.at_level(logging.WARNING):
        add_robot(plant, load_robot(write_robot(tmp_path, text, ["a", "b", "c"])), visuals=True)
    assert "link fore: a mesh is not drawn" in caplog.text
    inspector = scene.model_inspector()
    names = {}
    for link in ("base", "upper", "fore", "hand"):
        (geometry,) = plant.GetVisualGeometriesForBody(plant.GetBodyByName(link))
        names[link] = inspector.GetName(geometry)
        assert inspector.GetIllustrationProperties(geometry) is not None
    assert names["upper"] == "arm::upper_mesh_0"
    plant.Finalize()
    diagram = builder.Build()
    assert diagram.CreateDefaultContext() is not None
