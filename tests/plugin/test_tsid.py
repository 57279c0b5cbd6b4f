"""A kind of task and a kind of limit of an installed package, used from controller files."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import drake_tc.models
from drake_tc.errors import ParamsError
from drake_tc.tsid.configuration import load_law

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
MIRROR = {"kind": "mirror", "joints": ["r_knee", "l_knee"], "kp": 100.0, "kd": 20.0, "weight": 10.0}

SCRIPT = """
import sys
import numpy as np
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid

law = load_law(sys.argv[1], {
    "tasks": {"knees": MIRROR},
    "limits": {"joint_power": {"watts": float(sys.argv[2])}},
})
system = RobustTsid(law)
context = system.CreateDefaultContext()
model = law.model
q, v = model.start.copy(), np.zeros(model.nv)
first, second = (model.robot.joints.index(name) for name in ("r_knee", "l_knee"))
arm = model.robot.joints.index("r_elbow")
v[model.actuated[arm]] = -0.5
system.GetInputPort("estimated_state").FixValue(context, np.concatenate((q, v)))
apart = q[model.positions[first]] - q[model.positions[second]]
system.GetInputPort("knees_reference").FixValue(context, [apart + 0.01])
vdot = system.GetOutputPort("acceleration").Eval(context)
torque = system.GetOutputPort("torque").Eval(context)
print(vdot[model.actuated[first]] - vdot[model.actuated[second]], torque[arm] * -0.5)
print("joint power: r_elbow power" in law.constraints)
""".replace("MIRROR", repr(MIRROR))


def run(python, watts):
    ran = python("-c", SCRIPT, FILE, watts)
    assert ran.returncode == 0, ran.stderr
    numbers, listed = ran.stdout.strip().splitlines()
    assert listed == "True"
    return [float(number) for number in numbers.split()]


def test_the_yaml_kinds_of_an_installed_package_act(python):
    """Knees: qdd_a - qdd_b = kp 0.01. Elbow: its power is below the limit, which the free motion exceeds."""
    apart, power = run(python, 1000.0)
    assert_allclose(apart, 100.0 * 0.01, rtol=0.05)
    limit = 0.5 * power
    assert limit > 0.0
    again, held = run(python, limit)
    assert held <= limit * (1.0 + 1e-9)
    assert np.isfinite(again)


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


def test_the_command_line_simulates_with_them(command):
    """`simulate` reads the kinds' names from the controller file of a scenario."""
    changes = f"{{changes: {{tasks: {{knees: {MIRROR}}}, limits: {{joint_power: {{watts: 500.0}}}}}}}}"
    arguments = ("simulate", "humanoid_tsid", "--duration", "0.02", "--json", "--scenario-text", changes)
    ran = command(*arguments)
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["diagram"] == "humanoid_tsid"
    with pytest.raises(ParamsError, match=r"tasks\.knees\.kind: expected one of com"):
        load_law(FILE, {"tasks": {"knees": MIRROR}})
