"""Masses and inertias of links that were found are in the written file, as its reader has it, or named as lost."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.exchange.links import NAMES, consistent, with_links

URDF = """<robot name="r"><link name="base"/>
<link name="arm"><inertial><origin xyz="0.1 0 -0.2" rpy="0.3 0 0"/><mass value="2"/>
<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.015"/></inertial></link>
<link name="tool"><inertial><origin xyz="0 0 0.1"/><mass value="0.5"/>
<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
<joint name="a" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
<joint name="t" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.3 0 0" rpy="0 0.4 0"/></joint>
</robot>
"""
SDF = """<sdf version="1.9"><model name="r"><link name="base"/><link name="arm"><inertial>
<pose>0.1 0 -0.2 0 0 0</pose><mass>2</mass><inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.015</izz></inertia>
</inertial></link>
<joint name="a" type="revolute"><parent>base</parent><child>arm</child><axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>
"""
MJCF = """<mujoco><compiler angle="radian"/><worldbody><body name="arm"><joint name="a" axis="0 1 0"/>
<geom type="box" size="0.05 0.04 0.1" pos="0.1 0 -0.2" euler="0.3 0 0" mass="2"/>
<body name="tool" pos="0.3 0 0" euler="0 0.4 0"><geom type="box" size="0.02 0.03 0.04" mass="0.5"/></body>
</body></worldbody></mujoco>
"""
MASS = {"effect": "link_mass", "where": "arm", "mass": 0.7, "ci95": {"mass": [0.6, 0.8]}}


def whole_of_drake(text, kind):
    """(10,) of the arm with all that is welded to it."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, kind)
    plant.Finalize()
    body = plant.GetBodyByName("arm")
    spatial = plant.CalcSpatialInertia(
        plant.CreateDefaultContext(), body.body_frame(), [each.index() for each in plant.GetBodiesWeldedTo(body)]
    )
    inertia = spatial.CalcRotationalInertia().CopyToFullMatrix3()
    moment = spatial.get_mass() * spatial.get_com()
    return np.array([spatial.get_mass(), *moment, *inertia[np.triu_indices(3)]])


def whole_of_mujoco(text):
    """Mass, weight's moment and inertia about the joint's axis of the arm and its tool."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return np.array([model.body_subtreemass[1], data.qfrc_bias[0], data.qM[0] if hasattr(data, "qM") else data.M[0]])


@pytest.mark.parametrize(("kind", "text"), [("urdf", URDF), ("sdf", SDF)])
def test_a_mass_scales_the_link_with_what_is_welded_to_it(tmp_path, kind, text):
    path = tmp_path / f"robot.{kind}"
    written, (told,) = with_links(text, kind, path, [MASS], {})
    before = whole_of_drake(text, kind)
    assert_allclose(whole_of_drake(written, kind), before * (1.0 + 0.7 / before[0]), rtol=1e-8, atol=1e-10)
    assert told.startswith("arm: link mass (mass +0.7) was written; the mass of the link is now 2.7 kg instead of 2 kg")


def test_a_mass_scales_the_body_of_an_mjcf_file(tmp_path):
    before, path = whole_of_mujoco(MJCF), tmp_path / "robot.xml"
    written, _ = with_links(MJCF, "mjcf", path, [MASS], {})
    assert_allclose(whole_of_mujoco(written), before * (1.0 + 0.7 / 2.5), rtol=1e-6)


def test_a_centre_of_mass_moves_and_fitted_parameters_replace_those_of_the_file(tmp_path):
    path = tmp_path / "robot.urdf"
    shift = {"effect": "link_com", "where": "arm", "com_x": 0.02, "com_y": -0.01, "com_z": 0.03}
    written, _ = with_links(URDF, "urdf", path, [shift], {})
    before, after = whole_of_drake(URDF, "urdf"), whole_of_drake(written, "urdf")
    assert_allclose(after[:4], before[:4] + before[0] * np.array([0.0, 0.02, -0.01, 0.03]), atol=1e-9)
    fitted = dict(zip(NAMES, (before * 1.1).tolist(), strict=True))
    written, (told,) = with_links(URDF, "urdf", path, [], {"arm": fitted})
    assert_allclose(whole_of_drake(written, "urdf"), 1.1 * before, rtol=1e-8, atol=1e-10)
    assert "fitted inertial parameters were written" in told and "no rigid body" not in told


def test_parameters_of_no_body_become_those_of_the_nearest_one_and_the_loss_is_told(tmp_path):
    wrong = dict(zip(NAMES, [0.4, 0.5, 0.0, 0.0, 0.01, 0.0, 0.0, 0.02, 0.0, 0.02], strict=True))
    written, (told,) = with_links(URDF, "urdf", tmp_path / "robot.urdf", [], {"arm": wrong})
    assert "no rigid body has these parameters, and the written ones differ by up to" in told
    after = consistent(whole_of_drake(written, "urdf"))
    assert_allclose(after, whole_of_drake(written, "urdf"), rtol=1e-9)
    possible = np.array([2.0, 0.2, 0.0, 0.1, 0.1, 0.0, 0.0, 0.1, 0.0, 0.1])
    assert_allclose(consistent(possible), possible)


@pytest.mark.parametrize(
    ("target", "into", "where", "why"),
    [
        ("mjcf", False, "arm", "a bench has no links"),
        ("isaaclab", True, "arm", "the target has actuators only"),
        ("urdf", True, "leg", "robot.urdf has no link, or several links, of this name"),
        ("urdf", True, "base", "it cannot be applied to a link of 0 kg"),
    ],
)
def test_what_is_not_written_is_named(tmp_path, target, into, where, why):
    path = tmp_path / "robot.urdf" if into else None
    text, (told,) = with_links(URDF, target, path, [MASS | {"where": where}], {})
    assert text.endswith(URDF) and told.startswith(f"{where}: link mass (mass +0.7) was not written: {why}")
    bias = {"effect": "ft_bias", "where": "foot", "fx": 1.0}
    assert "an error of the sensor" in with_links(URDF, "urdf", path, [bias], {})[1][0]


@pytest.mark.parametrize("where", ["arm", "tool"])
def test_bodies_that_mujoco_fuses_have_their_masses_once(tmp_path, where):
    text = MJCF.replace('angle="radian"', 'angle="radian" fusestatic="true"')
    written, _ = with_links(text, "mjcf", tmp_path / "robot.xml", [MASS | {"where": where}], {})
    assert whole_of_mujoco(written)[0] == pytest.approx(3.2)


def test_a_link_that_a_plugin_names_is_not_the_link(tmp_path):
    plugin = '<gazebo><plugin name="p"><link name="arm"/></plugin></gazebo></robot>'
    written, _ = with_links(URDF.replace("</robot>", plugin), "urdf", tmp_path / "robot.urdf", [MASS], {})
    assert whole_of_drake(written, "urdf")[0] == pytest.approx(3.2)


def test_what_no_link_or_several_have_by_name_is_not_written(tmp_path):
    two = SDF.replace('<model name="r">', '<world name="w"><model name="r">').replace("</model></sdf>", "</model>")
    two += SDF.split(">", 1)[1].replace('"r"', '"s"').replace("</sdf>", "</world></sdf>")
    (told,) = with_links(two, "sdf", tmp_path / "two.sdf", [MASS], {})[1]
    assert "was not written: two.sdf has no link, or several links, of this name" in told
    many = MJCF.replace('<body name="arm">', '<replicate count="2" offset="1 0 0"><body name="arm">')
    many = many.replace("</body></worldbody>", "</body></replicate></worldbody>")
    (told,) = with_links(many, "mjcf", tmp_path / "many.xml", [MASS], {})[1]
    assert "was not written: many.xml has no link, or several links, of this name" in told


def test_links_of_a_file_whose_joints_form_a_loop_are_not_written(tmp_path):
    loop = (
        '<joint name="b" type="revolute"><parent link="tool"/><child link="base"/><axis xyz="0 1 0"/></joint></robot>'
    )
    (told,) = with_links(URDF.replace("</robot>", loop), "urdf", tmp_path / "robot.urdf", [MASS], {})[1]
    assert (
        "was not written: Drake refuses the file: The bodies and joints of this system form one or more loops" in told
    )


def test_a_mass_that_would_be_negative_is_not_written(tmp_path):
    written, (told,) = with_links(URDF, "urdf", tmp_path / "robot.urdf", [MASS | {"mass": -5.0}], {})
    assert written.endswith(URDF) and "was not written: it cannot be applied to a link of 2.5 kg" in told


def test_a_payload_on_a_flange_without_mass_is_a_body_that_mujoco_loads(tmp_path):
    flange = '<body name="flange"/></body></worldbody>'
    load = {"effect": "payload", "where": "flange", "mass": 0.5, "com_x": 0.0, "com_y": 0.0, "com_z": 0.1}
    text = MJCF.replace("</body></worldbody>", flange)
    written, (told,) = with_links(text, "mjcf", tmp_path / "robot.xml", [load], {})
    assert whole_of_mujoco(written)[0] == pytest.approx(3.0, rel=1e-5)
    assert "payload" in told and "was written" in told
