"""The snippets of README and documentation run, on files such as their readers have."""

import numpy as np
import pytest
import yaml

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import load_rig, parse_rig
from drake_tc.robot.robot import load_robot

from .pages import blocks, follow

INERTIAL = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
LIMIT = "<limit lower='-1' upper='1' effort='1' velocity='1'/>"


def chain(name, joints):
    """A URDF of links in a row."""
    parents = ["base_link", *joints]
    links = "".join(f"<link name='{link}'>{INERTIAL}</link>" for link in parents)
    made = "".join(
        f"<joint name='{joint}' type='revolute'><parent link='{parent}'/><child link='{joint}'/>{LIMIT}</joint>"
        for parent, joint in zip(parents[:-1], joints, strict=True)
    )
    return f"<robot name='{name}'>{links}{made}</robot>"


@pytest.fixture
def knee(tmp_path, monkeypatch):
    """The folder of a reader of the README after `close-loop`: out/knee/model_after.yaml and robot.urdf."""
    values = (
        EffectValue("coulomb", {"coulomb": 4.0}),
        EffectValue("viscous", {"viscous": 2.0}),
        EffectValue("rotor_inertia", {"rotor_inertia": 0.31}),
    )
    model = ActuatorModel("knee", Drive("position_servo", 2e-4), values)
    (tmp_path / "out" / "knee").mkdir(parents=True)
    save_models({"knee": model}, tmp_path / "out" / "knee" / "model_after.yaml")
    (tmp_path / "robot.urdf").write_text(chain("robot", ["knee"]), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_readme_uses_the_model(knee):
    (block,) = blocks("README.md", "python")
    names: dict[str, object] = {}
    exec(compile(block.text, "README.md", "exec"), names)
    expected = 2e-4 * (20.0 + 4.0 + 2.0 * 0.5)  # K (tau_d + F sign(v) + b v), no acceleration
    np.testing.assert_allclose(names["effort"], [expected], rtol=1e-12)
    assert names["actuators"].get_input_port(0).size() == 1


def test_an_arm_with_fitted_links_is_a_robot_and_a_rig(tmp_path):
    arm, rig = blocks("docs/whole_arm.md", "yaml")
    joints = yaml.safe_load(arm.text)["joints"]
    (tmp_path / "my_arm.urdf").write_text(chain("arm", joints), encoding="utf-8")
    for name, block in (("arm.yaml", arm), ("rig.yaml", rig)):
        (tmp_path / name).write_text(block.text, encoding="utf-8")
    assert load_robot(tmp_path / "arm.yaml").joints == tuple(joints)
    read = load_rig(tmp_path / "rig.yaml")
    assert read.joints == tuple(joints) and set(read.load.values()) == {RobotLoad("fitted")}


def test_the_rig_file_with_other_columns_is_one():
    (block,) = blocks("docs/your_own_log.md", "yaml")
    rig = parse_rig(yaml.safe_load(block.text))
    assert rig.columns["knee/torque"] == "ft_torque" and rig.units["time"] == "ms"
    assert rig.joint_sensors("knee").torque_noise == 0.25


def test_a_controller_reads_the_torque_uncertainty(knee):
    document = {"schema": 1, "unit": "N*m", "joints": ["knee"], "covariance": [[0.04]]}
    path = knee / "out" / "knee" / "torque_uncertainty.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    (block,) = blocks("docs/report.md", "python")
    names: dict[str, object] = {}
    exec(compile(block.text, "docs/report.md", "exec"), names)
    np.testing.assert_allclose(names["sigma"], [[0.04]], rtol=1e-12)


def test_the_tutorial_leads_from_logs_to_a_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    follow("docs/tutorial.md")
    said = capsys.readouterr().out
    assert "+ deadzone" in said and "+ stribeck" in said
    assert "before: command the servo" in said and "after: command the servo" in said
    assert (tmp_path / "out" / "knee.xml").exists()
