"""One model of the rig file: the page is up to date, its examples load, and the schema agrees with the reader."""

import copy
import json
import re
from importlib.resources import as_file, files
from pathlib import Path
from typing import get_args

import pytest
import yaml
from jsonschema import Draft202012Validator
from pydantic import BaseModel

from drake_tc.effects.library import DECLARED_ONLY, LIBRARY, UNCOMMON, effect
from drake_tc.errors import RigError
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.rig import load_rig, parse_rig, rig_document
from drake_tc.logs.rig_document.declared import EFFECT_IDS
from drake_tc.logs.rig_document.document import RigDocument, rig_schema
from drake_tc.logs.rig_document.loads import KINDS, WORDS, ModelLoad, PendulumKeys
from drake_tc.logs.rig_document.sensors import (
    CurrentKeys,
    EncoderKeys,
    ForceTorqueKeys,
    ImuKeys,
    JointSensorKeys,
    TorqueCommandKeys,
    TorqueSensorKeys,
    VoltageKeys,
)
from drake_tc.logs.units import COLUMN_MEANING, JOINT_SUFFIXES, SENSOR_SUFFIXES
from drake_tc.report.pages import EXAMPLES, JOINT_TOLERANCES, example, rig_page
from drake_tc.robot.robot import load_robot

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "drake_tc" / "logs" / "RIG.md"
MODELS = (
    *(RigDocument, PendulumKeys, ModelLoad, JointSensorKeys, TorqueSensorKeys, EncoderKeys),
    *(ForceTorqueKeys, ImuKeys, CurrentKeys, VoltageKeys, TorqueCommandKeys),
)
BASE = {"joint": "knee", "drive": "current"}


def keys_of(model: type[BaseModel]) -> list[str]:
    return [name for name, field in model.model_fields.items() if not (field.alias or "").startswith("@")]


def test_the_page_is_what_the_model_says():
    command = "drake-tc schema rig --page --force --out drake_tc/logs/RIG.md"
    assert PAGE.read_text(encoding="utf-8") == rig_page(), f"stale; write it anew: {command}"


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.__name__)
def test_every_key_has_a_row_with_meaning_and_example(model):
    for name in keys_of(model):
        field = model.model_fields[name]
        assert field.description.endswith("."), name
        if not set(get_args(field.annotation)) & set(JOINT_TOLERANCES):  # they have a row for each of their keys
            row = rf"\| `(\w+: {{)?{name}: [^|]+`[^|]* \| {re.escape(field.description)} \| [^|]+ \|"
            assert re.search(row, rig_page()), name


TOGETHER = {
    "torque_constant": {"gear_ratio": 50.0},
    "gear_ratio": {"torque_constant": 0.1},
    "proportional_gain": {"drive": "position_servo"},
    "derivative_gain": {"drive": "position_servo", "proportional_gain": 20.0},
}
"""Keys without which another one says nothing."""


@pytest.mark.parametrize("name", sorted(set(keys_of(RigDocument)) - {"robot", "coupled"}))  # they need a file
def test_the_example_of_every_key_is_accepted(name):
    (value,) = RigDocument.model_fields[name].examples
    base = {"drive": "current"} if name in ("joint", "joints") else BASE
    assert parse_rig({**base, **TOGETHER.get(name, {}), name: value}).joints


@pytest.mark.parametrize(
    ("model", "owner"), [(JointSensorKeys, None), (ForceTorqueKeys, "ft_foot"), (ImuKeys, "imu_trunk")]
)
def test_the_examples_of_the_sensors_are_accepted(model, owner, tmp_path):
    entries = {name: model.model_fields[name].examples[0] for name in keys_of(model)}
    robot = "{joints: [knee, hip, waist], imu: {trunk: {}}, force_torque: {foot: {}}}"
    (tmp_path / "robot.yaml").write_text(robot, encoding="utf-8")
    drive = {"knee": "current", "hip": "voltage", "waist": "torque"}
    document = {"robot": "robot.yaml", "drive": drive, "sensors": entries if owner is None else {owner: entries}}
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    rig = load_rig(tmp_path / "rig.yaml")
    assert rig.joint_sensors("knee").torque_noise == 0.25 if owner is None else owner in rig.tolerances


def test_the_complete_examples_load():
    with as_file(files("drake_tc.logs") / "examples") as folder:
        joint, leg = load_rig(folder / "joint_rig.yaml"), load_rig(folder / "leg_rig.yaml")
        robot = load_robot(folder / "leg_robot.yaml")
    assert joint.required_columns("knee") == ("knee/position", "knee/position_command", "knee/torque")
    assert set(joint.columns.values()) == {"t", "q_meas", "q_ref", "ft_torque", "motor_temp"}
    assert joint.enabled == "torque_on" and joint.saturation == {"knee": 0.35}
    assert leg.joints == robot.joints and leg.load["hip"] == RobotLoad("estimate")
    assert set(leg.tolerances) == set(leg.robot_sensors) == {"ft_foot", "imu_trunk"}
    assert leg.joint_sensors("knee").encoder_step == pytest.approx(2 * leg.joint_sensors("hip").encoder_step)
    for name in EXAMPLES:
        assert example(name).rstrip() in rig_page()
        assert len(example(name).splitlines()) <= 20


def test_what_can_be_declared_is_what_the_library_has():
    assert set(EFFECT_IDS) == {m.id for m in (*LIBRARY, *UNCOMMON)} | {m.key for m in DECLARED_ONLY}
    for name in EFFECT_IDS:
        # The kinds of saturation share one row.
        rows = [rig_page()] if name.startswith("saturation") else re.findall(rf"^\| `{name}` \|.*$", rig_page(), re.M)
        (row,) = rows
        assert all(f"`{parameter.name}`" in row for parameter in effect(name).parameters), name


def test_every_column_has_a_meaning():
    assert {*JOINT_SUFFIXES, *(name for name in SENSOR_SUFFIXES if name.endswith("x"))} <= set(COLUMN_MEANING)


def test_every_kind_of_load_is_on_the_page():
    for word in WORDS:
        assert parse_rig({**BASE, "load": word}).load["knee"] == word and f"| `{word}` |" in rig_page()
    for name, kind in KINDS.items():
        assert next(iter(kind.model_fields)) == name and f"**`load: {{{name}: ...}}`**" in rig_page()


GOOD = (
    BASE,
    {**BASE, "load": {"pendulum": {"mass": 1.0, "length": 0.2, "zero": -0.1}}, "saturation": {"knee": 2}},
    {**BASE, "load": {"knee": "unknown"}, "declared": {"knee": {"stribeck": None, "viscous": {"viscous": 1.0}}}},
    {**BASE, "declared": "stribeck", "sensors": {"knee": {"encoder_step": "0.1 deg"}, "torque_noise": 0.1}},
    {**BASE, "columns": {"position": 3}, "units": {"position": 0.1, "time": "ms"}, "drive": {"knee": "voltage"}},
    {**BASE, "valid": "height > 0.02"},
    {**BASE, "valid": ["free", "height > 0.02"]},
)
BAD = (
    {"drive": "current"},
    {"joint": "knee"},
    {**BASE, "drives": "current"},
    {**BASE, "drive": "curent"},
    {**BASE, "load": "spring"},
    {**BASE, "load": {"pendulum": {"mass": 1.0}}},
    {**BASE, "load": {"pendulum": {"mass": 1.0, "length": 1.0, "lenght": 1.0}}},
    {**BASE, "load": {"robot": "estimated"}},
    {**BASE, "declared": ["stribek"]},
    {**BASE, "declared": {"stribeck": "much"}},
    {**BASE, "saturation": -1.0},
    {**BASE, "sensors": {"encoder_step": "much"}},
    {**BASE, "sensors": {"ft_foot": {"bias": [1.0]}}},
    {**BASE, "columns": {"position": [1]}},
    {**BASE, "valid": 3},
)


def test_the_schema_is_one():
    Draft202012Validator.check_schema(rig_schema())
    text = json.dumps(rig_schema(), ensure_ascii=False)
    assert "@" not in text and '"absent"' not in text and '"expected"' not in text
    assert "Unit: rad, A, V or N·m. Default: not known." in text


@pytest.mark.parametrize("document", GOOD)
def test_the_schema_accepts_what_the_reader_accepts(document):
    parse_rig(copy.deepcopy(document))
    Draft202012Validator(rig_schema()).validate(document)


@pytest.mark.parametrize("document", BAD)
def test_the_schema_refuses_what_the_reader_refuses(document):
    with pytest.raises(RigError):
        parse_rig(copy.deepcopy(document))
    assert list(Draft202012Validator(rig_schema()).iter_errors(document))


@pytest.mark.parametrize(
    "path", sorted((ROOT / "drake_tc").rglob("*rig*.yaml")), ids=lambda p: f"{p.parent.name}/{p.name}"
)
def test_the_schema_accepts_every_committed_rig(path):
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    Draft202012Validator(rig_schema()).validate(document)
    Draft202012Validator(rig_schema()).validate(rig_document(load_rig(path)))
