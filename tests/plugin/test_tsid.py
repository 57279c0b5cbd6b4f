"""A kind of task and a kind of limit of an installed package in controller files; `test_robots` has what they do."""

import json
from pathlib import Path

import pytest

import drake_tc.models
from drake_tc.errors import ParamsError
from drake_tc.tsid.configuration import load_law

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
MIRROR = {"kind": "mirror", "joints": ["r_knee", "l_knee"], "kp": 100.0, "kd": 20.0, "weight": 10.0}
REFUSED = [
    ({"tasks": {"knees": {"kind": "mirror", "kp": 1.0, "kd": 1.0}}}, "tasks.knees: missing key 'joints'"),
    ({"limits": {"joint_power": {"watts": -1.0}}}, "limits.joint_power: watts: expected a number > 0, got -1"),
    ({"limits": {"joint_power": {"volts": 1.0}}}, "limits.joint_power: unknown key 'volts'"),
]


def test_errors_of_such_kinds_name_the_place_in_the_file(python):
    script = """
import sys
from drake_tc.errors import ParamsError
from drake_tc.tsid.configuration import load_law

for changes in CHANGES:
    try:
        load_law(sys.argv[1], changes)
    except ParamsError as error:
        print(error)
""".replace("CHANGES", repr([changes for changes, _ in REFUSED]))
    lines = python("-c", script, FILE).stdout.splitlines()
    assert len(lines) == len(REFUSED)
    for line, (_, message) in zip(lines, REFUSED, strict=True):
        assert message in line


@pytest.mark.slow
def test_the_command_line_simulates_with_them(commands):
    """`simulate` reads the kinds' names from the controller file of a scenario."""
    changes = f"{{changes: {{tasks: {{knees: {MIRROR}}}, limits: {{joint_power: {{watts: 500.0}}}}}}}}"
    (ran,) = commands(["simulate", "humanoid_tsid", "--duration", "0.02", "--json", "--scenario-text", changes])
    assert json.loads(ran)["diagram"] == "humanoid_tsid"
    with pytest.raises(ParamsError, match=r"tasks\.knees\.kind: expected one of com"):
        load_law(FILE, {"tasks": {"knees": MIRROR}})
