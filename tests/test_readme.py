"""The README keeps its promises: its links lead somewhere, its rig file is one, its names exist."""

import re
from pathlib import Path

import yaml

import drake_tc
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import load_rig, parse_rig
from drake_tc.robot.robot import load_robot

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_links_lead_somewhere():
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    local = [t for t in targets if not t.startswith("http")]
    assert len(local) >= 4
    assert [t for t in local if not (ROOT / t).exists()] == []


BLOCKS = re.findall(r"```yaml\n(.*?)```", README, re.S)


def test_the_rig_file_is_one():
    rig = parse_rig(yaml.safe_load(BLOCKS[0]))
    assert rig.joints == ("knee",)
    assert rig.known("knee", "rotor_inertia") == 0.31
    assert rig.units["time"] == "ms"


def test_the_arm_with_fitted_links_is_a_robot_and_a_rig(tmp_path):
    joints = yaml.safe_load(BLOCKS[1])["joints"]
    parents = ["base_link", *joints]
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/>"
    links = "".join(f"<link name='{name}'>{inertial}</link>" for name in parents)
    chain = "".join(
        f"<joint name='{joint}' type='revolute'><parent link='{parent}'/><child link='{joint}'/>{limit}</joint>"
        for parent, joint in zip(parents[:-1], joints, strict=True)
    )
    (tmp_path / "my_arm.urdf").write_text(f"<robot name='arm'>{links}{chain}</robot>", encoding="utf-8")
    for name, text in zip(("arm.yaml", "rig.yaml"), BLOCKS[1:], strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert load_robot(tmp_path / "arm.yaml").joints == tuple(joints)
    rig = load_rig(tmp_path / "rig.yaml")
    assert rig.joints == tuple(joints) and set(rig.load.values()) == {RobotLoad("fitted")}


def test_the_names_it_imports_are_public():
    for line in re.findall(r"from drake_tc import (.*)", README):
        assert set(line.split(", ")) <= set(drake_tc.__all__)


def test_its_commands_are_in_the_makefile():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name in re.findall(r"(?:`|    )make ([a-z-]+)", README):
        assert re.search(rf"^{name}:", makefile, re.M), name


def test_no_path_of_one_machine():
    assert not re.search(r"/(home|work|tmp|Users|root)/", README)
