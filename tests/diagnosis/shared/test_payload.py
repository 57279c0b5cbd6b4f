"""The link of a branched robot that carries an unknown load."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.diagnosis.shared.columns_of_runs import payload_of
from drake_tc.errors import RigError
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import parse_rig, rig_document
from drake_tc.robot.rigid_regressor import link_model
from drake_tc.robot.robot import load_robot

LINK = """<link name="{0}"><inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="{0}_joint" type="revolute"><parent link="{1}"/><child link="{0}"/><axis xyz="0 1 0"/>
  <limit lower="-3" upper="3" effort="50" velocity="5"/></joint>"""
TREE = (("trunk", "base"), ("left", "trunk"), ("right", "trunk"))
RIG = {"robot": "y.yaml", "drive": "current", "drive_gain": 1.0}


@pytest.fixture
def links(tmp_path):
    parts = "".join(LINK.format(*names) for names in TREE)
    (tmp_path / "y.urdf").write_text(f'<robot name="y"><link name="base"/>{parts}</robot>', encoding="utf-8")
    joints = [f"{name}_joint" for name, _ in TREE]
    robot = {"name": "y", "urdf": "y.urdf", "base": "base", "fixed_base": True, "joints": joints}
    (tmp_path / "y.yaml").write_text(yaml.safe_dump(robot), encoding="utf-8")
    return link_model(load_robot(tmp_path / "y.yaml"))


def rig(tmp_path, **load):
    document = RIG | {"load": {"robot": "fitted", "unknown_payload": ["loaded"], **load}}
    return parse_rig(document, tmp_path / "rig.yaml")


def test_the_declared_link_carries_the_load(links, tmp_path):
    assert set(links.outermost) == {"left", "right"}
    for link in ("trunk", "left", "right"):
        payload = payload_of(rig(tmp_path, payload_link=link), ["empty", "loaded"], links)
        columns = links.columns(*np.random.default_rng(0).normal(size=(3, 4, 3)))
        place = links.tree.links.index(link)
        assert_allclose(payload.columns(columns, "loaded"), columns[:, :, 10 * place : 10 * place + 10])
        assert_allclose(payload.columns(columns, "empty"), np.zeros((4, 3, 10)))


def test_several_outermost_links_need_a_name(links, tmp_path):
    with pytest.raises(RigError, match=r"payload_link: the robot has several outermost links .*left, right"):
        payload_of(rig(tmp_path), ["loaded"], links)
    without = replace(rig(tmp_path), load=dict.fromkeys(rig(tmp_path).joints, RobotLoad("fitted")))
    assert payload_of(without, ["loaded"], links).runs == ()


def test_the_rig_document_keeps_the_link(links, tmp_path):
    read = rig(tmp_path, payload_link="left")
    assert rig_document(read)["load"]["payload_link"] == "left"
