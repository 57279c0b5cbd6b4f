"""What no file may hold is refused by every kind of file: at once, in one short line that names file and place."""

import time
from pathlib import Path
from textwrap import indent

import pytest

from drake_tc.actuation.model_file import load_model_file
from drake_tc.control.torque_uncertainty_file import load_torque_uncertainty
from drake_tc.errors import DrakeTcError
from drake_tc.estimation.base_rig import load_base_rig
from drake_tc.identification.motor_prior import load_motor_sheet
from drake_tc.logs.rig import load_rig
from drake_tc.loops.series_elastic.scenario import SeaScenario
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.whole_body.scenario import TsidScenario
from drake_tc.robot.robot import load_robot
from drake_tc.tsid.configuration import load_law

from .test_yaml_file import ALIAS_BOMB


def in_file(kind):
    """Reader of a scenario whose text alone is in the file: gives it a name and reads it."""

    def load(path):
        path.write_text("one:\n" + indent(path.read_text(encoding="utf-8"), "  "), encoding="utf-8")
        return kind.load(path, "one")

    return load


KINDS = {
    "rig": (load_rig, "joint: knee\ndrive: current\n", "drive", "saturation: {knee: VALUE}"),
    "robot": (
        load_robot,
        "name: a\nurdf: a.urdf\nbase: b\nfixed_base: true\njoints: [j]\n",
        "fixed_base",
        "posture: {j: VALUE}",
    ),
    "actuator": (
        load_model_file,
        "joints: {knee: {drive: {kind: current, gain: 1.0}}}\n",
        "joints",
        "links: {x: {mass: VALUE}}",
    ),
    "controller": (load_law, "robot: r.yaml\ntasks: {com: {kind: com, kp: 1.0, kd: 1.0}}\n", "tasks", "period: VALUE"),
    "base rig": (
        load_base_rig,
        "robot: r.yaml\ncontacts: {}\n",
        "contacts",
        "start: {position: [VALUE, 0, 0]}",
    ),
    "scenario": (in_file(Scenario), "robot: r.yaml\n", "robot", "masses: {foot: VALUE}"),
    "whole-body scenario": (in_file(TsidScenario), "controller: c.yaml\n", "controller", "masses: {foot: VALUE}"),
    "series-elastic scenario": (in_file(SeaScenario), "actuators: a.yaml\njoint: j\n", "actuators", "delay: VALUE"),
    "motors": (
        load_motor_sheet,
        "motors: {all: {torque_constant: 0.04, back_emf: 0.04, resistance: 0.5, rotor_inertia: 1.0e-5,"
        " gear_ratio: 100.0, coulomb: 1.0, viscous: 1.0, stiffness: 200.0}}\n",
        "motors",
        "widths: {resistance: VALUE}",
    ),
    "uncertainty": (
        load_torque_uncertainty,
        "schema: 1\nunit: N*m\njoints: [a]\ncovariance: [[1.0]]\n",
        "covariance",
        "shrinkage: VALUE",
    ),
}
VALUES = {
    "digits": ("7" * 5000, "at most 40 digits"),
    "digits of 400": ("7" * 400, "at most 40 digits"),
    "float tag": ("!!float abc", "the tag '!!float' is not read"),
    "empty int": ("!!int ''", "the tag '!!int' is not read"),
    "date tag": ("!!timestamp 2001-99-99", "the tag '!!timestamp' is not read"),
    "deep": ("[" * 10_000, "at most 50 levels"),
    "bomb": ("1\n" + ALIAS_BOMB, "aliases that repeat at most"),
    "huge": ("1e999", "expected a number below"),
}


FREE_FORM = ("actuator",)


def refused(kind: str, folder: Path, text: str) -> str:
    path = folder / "some.yaml"
    path.write_text(text, encoding="utf-8")
    begin = time.process_time()
    with pytest.raises(DrakeTcError) as caught:
        KINDS[kind][0](path)
    assert time.process_time() - begin < 1.0
    message = str(caught.value)
    assert str(path) in message and "\n" not in message and len(message) < len(str(path)) + 500
    return message.replace(str(path), "FILE")


@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize("kind", KINDS)
def test_values_that_no_file_may_hold(tmp_path, kind, value):
    _, good, _, last = KINDS[kind]
    text, says = VALUES[value]
    said = refused(kind, tmp_path, good + last.replace("VALUE", text).replace("}", "}" * ("\n" not in text)))
    assert says in said or ("\n" in text and "not valid YAML" in said)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bomb_in_place_of_the_file(tmp_path, kind):
    assert "aliases that repeat at most" in refused(kind, tmp_path, ALIAS_BOMB)


@pytest.mark.parametrize("kind", KINDS)
def test_a_date_where_a_number_is_expected(tmp_path, kind):
    _, good, _, last = KINDS[kind]
    if kind in FREE_FORM:
        return  # the value is free-form
    assert "'2001-99-99'" in refused(kind, tmp_path, good + last.replace("VALUE", "2001-99-99"))


@pytest.mark.parametrize("kind", KINDS)
def test_a_key_twice(tmp_path, kind):
    _, good, key, _ = KINDS[kind]
    assert f"key '{key}' is given twice" in refused(kind, tmp_path, f"{good}{key}: 1\n")


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_key_with_its_nearest_match(tmp_path, kind):
    _, good, key, _ = KINDS[kind]
    said = refused(kind, tmp_path, f"{good}{key}s_: 1\n")
    assert f"unknown key '{key}s_'; did you mean '{key}'?; allowed: " in said


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("text", ["", "[1, 2]", "5", "text", "2001-99-99"])
def test_no_mapping(tmp_path, kind, text):
    said = refused(kind, tmp_path, text)
    assert "mapping" in said or (text == "" and " is missing" in said)
