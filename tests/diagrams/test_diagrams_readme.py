"""diagrams/README.md names every field of a scenario, and every diagram."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from drake_tc.control.torque_control import CompensationSpec
from drake_tc.estimation.delay_predictor import PredictorSpec
from drake_tc.estimation.disturbance_observer import ObserverSpec
from drake_tc.loops.scenarios.parts import FilterSpec
from drake_tc.loops.torque import scenario as data
from drake_tc.registry import diagrams
from drake_tc.sensing.fault import SensorFault
from drake_tc.sensing.spec import SensorSpec
from drake_tc.sensing.suite import SensorSuiteSpec

PAGE = (Path(__file__).resolve().parents[2] / "diagrams" / "README.md").read_text("utf-8")
PARTS = {
    "gains": data.GainSpec,
    "filters": FilterSpec,
    "compensation": CompensationSpec,
    "motion": data.MotionSpec,
    "force": data.ForceSpec,
    "pushes": data.PushSpec,
    "objects": data.ObjectSpec,
    "sensors": SensorSuiteSpec,
    "faults": SensorFault,
    "predictor": PredictorSpec,
    "observer": ObserverSpec,
    "suspension": data.SuspensionSpec,
}


def test_the_table_has_every_field_of_a_scenario_and_no_other():
    table = PAGE.split("| field | default |")[1].split("\n\n")[0]
    named = {name for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE) for name in re.findall(r"`(\w+)`", row)}
    assert named == {field.name for field in fields(data.Scenario)}


@pytest.mark.parametrize("name", PARTS)
def test_a_part_is_described_with_all_its_fields(name):
    about = PAGE.split(f"**{name}**:")[1].split("\n\n")[0]
    missing = [field.name for field in fields(PARTS[name]) if not re.search(rf"\b{field.name}\b", about)]
    assert not missing


def test_what_a_sensor_may_do_is_described():
    about = PAGE.split("**sensors**:")[1].split("\n\n")[0]
    assert all(f"`{field.name}`" in about for field in fields(SensorSpec))


def test_every_diagram_is_listed():
    assert all(f"`{name}`" in PAGE for name in diagrams())


def test_the_defaults_in_the_table_are_those_of_the_code():
    rows = dict(re.findall(r"^\| `(\w+)` \| `?([^|`]+)`? \|", PAGE, re.MULTILINE))
    plain = {
        field.name: field.default
        for field in fields(data.Scenario)
        if isinstance(field.default, str | bool | float | int)
    }
    plain.pop("source")
    for name, value in plain.items():
        assert rows[name] == (str(value).lower() if isinstance(value, bool) else str(value)), name
