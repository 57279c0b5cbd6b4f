"""The snippets of README and documentation run, on files such as their readers have."""

import json
import shlex
import shutil
from functools import partial
from typing import Any

import numpy as np
import pytest
import yaml
from few_effects import diagnoses_look_for, experiments_fit
from public_examples import namespace

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import ModelFile, load_models, save_models
from drake_tc.actuation.remainder import Remainder
from drake_tc.cli import demo
from drake_tc.cli.main import run
from drake_tc.exchange.mjcf import to_mjcf
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import load_rig, parse_rig
from drake_tc.registry import diagram_entry
from drake_tc.robot.robot import load_robot

from .conftest import ROOT
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
    _, block = blocks("README.md", "python")
    names: dict[str, object] = {}
    exec(compile(block.text, "README.md", "exec"), names)
    expected = 2e-4 * (20.0 + 4.0 + 2.0 * 0.5)  # K (tau_d + F sign(v) + b v), no acceleration
    np.testing.assert_allclose(names["effort"], [expected], rtol=1e-12)
    assert names["actuators"].get_input_port(0).size() == 1


def test_the_readme_closes_the_loop_in_python(tmp_path, monkeypatch):
    made = namespace(tmp_path)
    shutil.copy(made["leg_rig_file"](), tmp_path / "rig.yaml")
    for seed, name in enumerate(("postures", "sinusoid", "multisine")):
        shutil.copy(made["leg_log"](seed), tmp_path / f"{name}.csv")
    monkeypatch.chdir(tmp_path)
    block, _ = blocks("README.md", "python")
    names: dict[str, Any] = {}
    exec(compile(block.text, "README.md", "exec"), names)
    assert names["result"].heldout_files == ("multisine.csv",)
    assert repr(names["result"]).startswith("verdict: No missing effect found")


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
    (block,) = blocks("docs/report_parts.md", "python")
    names: dict[str, object] = {}
    exec(compile(block.text, "docs/report_parts.md", "exec"), names)
    np.testing.assert_allclose(names["sigma"], [[0.04]], rtol=1e-12)


def test_the_leg_of_the_diagrams_page_swings_and_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (block,) = blocks("diagrams/README.md", "python")
    names: dict[str, object] = {}
    exec(compile(block.text, "diagrams/README.md", "exec"), names)
    assert {path.name for path in (tmp_path / "soft_swing").iterdir()} == {"log.csv", "rig.yaml"}
    assert names["recording"]["command"].shape[1] == 6


def test_the_scenario_of_the_diagrams_page_is_one(tmp_path):
    (block,) = blocks("diagrams/README.md", "yaml")
    path = tmp_path / "my.scenario.yaml"
    others = (ROOT / "diagrams" / "hrp2_leg.scenario.yaml").read_text("utf-8")
    path.write_text(others.replace("../models", str(ROOT / "models")) + block.text, encoding="utf-8")
    changed = diagram_entry("hrp2_leg").scenario("soft_swing", path)
    assert changed.gains.k6 == 0.25 and [fault.kind for fault in changed.faults["imu"]] == ["dropped"]


def test_the_page_of_the_whole_body_controller_builds_a_diagram(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "models" / "hrp2_like", tmp_path, dirs_exist_ok=True)
    (tmp_path / "hrp2_like_tsid.yaml").rename(tmp_path / "my_robot_tsid.yaml")
    monkeypatch.chdir(tmp_path)
    (block,) = blocks("drake_tc/tsid/README.md", "python")
    names: dict[str, object] = {}
    exec(compile(block.text, "drake_tc/tsid/README.md", "exec"), names)
    assert len(names["diagram"].GetSystems()) >= 2


@pytest.mark.slow
def test_the_pages_of_simulators_export_and_read(knee, monkeypatch):
    """Every command of the pages, in a folder with the reader's files; no effect is missing."""
    pytest.importorskip("onnx", reason="pip install onnx")
    diagnoses_look_for(monkeypatch)
    model, terms = load_models(knee / "out" / "knee" / "model_after.yaml"), ("armature", "damping", "frictionloss")
    (knee / "robot.xml").write_text(to_mjcf([project(model["knee"], TARGETS["mjcf"])]), encoding="utf-8")
    time = np.arange(0.0, 10.0, 0.004)
    q = 0.5 * np.sin(3.0 * time) + 0.2 * np.sin(7.0 * time)
    v, a = np.gradient(q, time), np.gradient(np.gradient(q, time), time)
    load = 15.0 * np.sin(q)
    effort = 0.31 * a + 2.0 * v + 4.0 * np.sign(v) + load
    names = ("time", "knee/position", "knee/position_command", "knee/torque")
    for seed, name in enumerate(("sinusoid.csv", "multisine.csv")):
        noise = np.random.default_rng(seed).standard_normal((2, time.size))
        table = np.column_stack([time, q + 1e-5 * noise[0], q + 2e-4 * effort, load + 0.01 * noise[1]])
        np.savetxt(name, table, delimiter=",", header=",".join(names), comments="")
    (rig,) = blocks("docs/declared_model.md", "yaml")
    (knee / "rig.yaml").write_text(rig.text, encoding="utf-8")
    assert load_rig(knee / "rig.yaml").declared["knee"] == {"rotor_inertia": 0.31, "viscous": 2.0, "coulomb": 4.0}
    names = ("your_own_simulator", "simulator_notes", "declared_model")
    pages = [(ROOT / "docs" / f"{name}.md").read_text("utf-8") for name in names]
    lines = [line.strip() for page in pages for line in page.splitlines() if line.startswith("    drake-tc ")]
    servo = ActuatorModel("knee", Drive("voltage", 0.5), (EffectValue("viscous", {"viscous": 4.0}),))
    rest = Remainder(np.zeros(4), np.ones(4), np.zeros((1, 4)), 1.0, 0.1, 0.3, np.ones(8))
    save_models({"knee": servo}, knee / "model_after.yaml")
    ModelFile(model, remainders={"knee": rest}).save(knee / "out" / "knee" / "model_after.yaml")
    assert len(lines) == 6
    for line in lines:
        assert run(shlex.split(line)[1:]) == 0, line
    identified = (knee / "robot_identified.xml").read_text("utf-8")
    assert all(f'{name}="' in identified for name in terms)
    assert (knee / "networks" / "knee.onnx").exists()
    assert "BamMotorCfg(" in (knee / "actuators.py").read_text("utf-8")
    (row,) = json.loads((knee / "out" / "tried" / "report.json").read_text("utf-8"))["export"]["free_runs"]
    assert None not in (row["model"], row["export"], row["original"])
    assert "RMS error of the free-running position" in (knee / "export.html").read_text("utf-8")


@pytest.mark.slow
def test_the_tutorial_leads_from_logs_to_a_command(tmp_path, monkeypatch, capsys):
    """With recordings of 6 s in place of 30 s, which have the same two effects, and a search for these alone."""
    diagnoses_look_for(monkeypatch, "deadzone", "stribeck")
    experiments_fit(monkeypatch, "deadzone", "stribeck")
    short = demo.DemoLength(duration=6.0, period=4e-3, step=5e-4)
    monkeypatch.setattr(demo, "record_demo", partial(demo.record_demo, length=short, jobs=1))
    monkeypatch.chdir(tmp_path)
    follow("docs/tutorial.md")
    said = capsys.readouterr().out
    assert "+ deadzone" in said and "+ stribeck" in said
    assert "before: command the servo" in said and "after: command the servo" in said
    assert (tmp_path / "out" / "knee.xml").exists()
    follow("docs/randomisation.md")
    said = capsys.readouterr().out
    assert "deadzone.deadzone: ±" in said and "'rotor_inertia'" in said.rpartition("not shown:")[2]
    assert "dr.joint_friction" in (tmp_path / "out" / "randomisation.py").read_text("utf-8")
