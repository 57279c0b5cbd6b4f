"""The version of MuJoCo that a written file needs is said, and checked against the installed one."""

import json
from pathlib import Path

import numpy as np
import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import save_models
from drake_tc.cli.main import run as drake_tc
from drake_tc.errors import ParamsError
from drake_tc.exchange import mujoco_run
from drake_tc.exchange.mjcf import to_mjcf, with_torque_constant
from drake_tc.exchange.mujoco_run import (
    SINCE,
    file_notes,
    installed_mujoco,
    simulate_in_mujoco,
    too_old,
    version_sentence,
)
from drake_tc.exchange.projection import TARGETS, project
from drake_tc.exchange.target_run import RunInput
from drake_tc.exchange.trial import Exported, run_errors, run_notes
from drake_tc.simulator_files.terms import Terms

from .test_target_runs import SERVO, recorded

QUADRATIC = EffectValue("quadratic_viscous", {"quadratic_viscous": 1.5})
DELAY = EffectValue("delay.command", {"delay": 0.004})
PLAY = EffectValue("backlash", {"backlash": 0.02})
POSITION = Drive("position_servo", 2e-3)


def written(*effects, drive=POSITION, torque_constant=None, into=None):
    """A file of one joint, and its projections."""
    projection = project(ActuatorModel("knee", drive, (*SERVO, *effects)), TARGETS["mjcf"])
    projections = [
        projection if torque_constant is None else with_torque_constant(projection, torque_constant, TARGETS["mjcf"])
    ]
    return to_mjcf(projections, into), projections


VOLTAGE = {"drive": Drive("voltage", 0.25), "torque_constant": 1.5}
CASES = {
    "plain": ((), {}, ""),
    "play": ((PLAY,), {}, ""),
    "delay": ((DELAY,), {}, "3.5 or newer for the delay of an actuator (knee)"),
    "polynomial": ((QUADRATIC,), {}, "3.7 or newer for damping as a polynomial of the speed (knee)"),
    "dcmotor": ((), VOLTAGE, "3.7 or newer for the actuator dcmotor (knee)"),
    "all": (
        (QUADRATIC, DELAY),
        VOLTAGE,
        "3.7 or newer for damping as a polynomial of the speed (knee) and the actuator dcmotor (knee);"
        " 3.5 or newer for the delay of an actuator (knee)",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_file_needs_the_version_of_its_newest_term(case):
    effects, drive, needed = CASES[case]
    text, _ = written(*effects, **drive)
    expected = f"The file needs MuJoCo {needed}." if needed else ""
    for installed in (None, "3.17.0", "3.7.0"):
        assert version_sentence(text, ["knee"], installed=installed) == expected
        assert too_old(text, ["knee"], installed=installed) == ""
    for joint in ["hip"] if needed else ["hip", "knee"]:  # of joints that were not written nothing is said
        assert version_sentence(text, [joint], installed="3.0.0") == ""


def test_an_installed_version_that_refuses_the_file_is_named():
    text, _ = written(QUADRATIC, DELAY)
    assert version_sentence(text, ["knee"], installed="3.6.0").endswith(
        "3.5 or newer for the delay of an actuator (knee); MuJoCo 3.6.0 is installed, which refuses it."
    )
    assert (
        too_old(text, ["knee"], installed="3.6.0")
        == "MuJoCo 3.6.0 is installed, but 3.7 or newer is needed for damping as a polynomial of the speed"
    )
    late, _ = written(DELAY)
    assert too_old(late, ["knee"], installed="3.5.0rc1") == "" and "3.5 or newer is needed" in too_old(
        late, ["knee"], installed="3.4"
    )


@pytest.mark.parametrize("case", CASES)
def test_the_installed_version_loads_what_it_is_said_to_load(case):
    mujoco = pytest.importorskip("mujoco")
    effects, drive, _ = CASES[case]
    text, _ = written(*effects, **drive)
    assert installed_mujoco() == mujoco.__version__
    if not too_old(text, ["knee"], installed=mujoco.__version__):
        assert mujoco.MjModel.from_xml_string(text).nv == 1 + (case == "play")


FILE = """<mujoco>
  <worldbody><body><joint name="knee"/><geom size="0.1"/></body></worldbody>
  <actuator><motor name="m" joint="knee" gear="80"{limit}/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("limit", ["", ' forcerange="-1 1"'])
def test_a_file_that_cannot_have_a_dcmotor_says_so(tmp_path: Path, monkeypatch, limit):
    monkeypatch.setattr(mujoco_run, "installed_mujoco", lambda: None)
    path = tmp_path / "robot.xml"
    path.write_text(FILE.format(limit=limit), encoding="utf-8")
    notes = file_notes(*written(**VOLTAGE, into=path))
    said = (
        "knee: the file limits the force of the actuator, which MuJoCo's dcmotor cannot: a motor was written, and the"
        " back-EMF stays a part of the damping."
    )
    assert notes == ([said] if limit else ["The file needs MuJoCo 3.7 or newer for the actuator dcmotor (knee)."])


def test_the_page_has_the_same_versions():
    page = (Path(__file__).parents[2] / "docs" / "simulator_notes.md").read_text(encoding="utf-8")
    polynomial = "`damping` as a polynomial of the speed"
    names = ("`dcmotor` without input", "`pid`", polynomial, "`dcmotor`", "`delay` of an actuator")
    for name, (major, minor) in zip(names, SINCE.values(), strict=True):
        assert f"| {name} | {major}.{minor} or newer |" in page


@pytest.fixture
def old(monkeypatch):
    """MuJoCo 3.6.0 is taken for the installed version."""
    monkeypatch.setattr(mujoco_run, "installed_mujoco", lambda: "3.6.0")


def test_a_run_that_the_installed_version_cannot_do_is_refused(old):
    pytest.importorskip("mujoco")
    given = RunInput(np.zeros(10), np.zeros(10), (0.0, 1.0), 1e-3)
    told = r"^MuJoCo 3\.6\.0 is installed, but 3\.7 or newer is needed for damping as a .*; pip install 'drake-tc\["
    with pytest.raises(ParamsError, match=told):
        simulate_in_mujoco(Terms("torque", 1.0, armature=0.3, quadratic=2.0), None, given)
    assert np.isfinite(simulate_in_mujoco(Terms("torque", 1.0, armature=0.3, delay=2e-3), None, given)).all()


def test_the_table_has_no_error_of_the_export_and_says_why(old):
    pytest.importorskip("mujoco")
    model = ActuatorModel("joint", POSITION, (*SERVO, QUADRATIC))
    rig, run = recorded(model)
    projections = [project(model, TARGETS["mjcf"])]
    (row,) = run_errors({"joint": model}, Exported(projections, "mjcf"), rig, [run])
    assert row.model is not None and row.export is None
    assert run_notes(Exported(projections, "mjcf"), rig) == [
        "joint: the export was not run: MuJoCo 3.6.0 is installed, but 3.7 or newer is needed for damping as a"
        " polynomial of the speed."
    ]


def test_the_command_says_it(tmp_path: Path, capsys, old):
    save_models({"knee": ActuatorModel("knee", POSITION, (*SERVO, QUADRATIC))}, tmp_path / "model.yaml")
    command = ["export", str(tmp_path / "model.yaml"), "--to", "mjcf", "--out", str(tmp_path / "bench.xml"), "--force"]
    assert drake_tc(command) == 0
    said = (
        "The file needs MuJoCo 3.7 or newer for damping as a polynomial of the speed (knee);"
        " MuJoCo 3.6.0 is installed, which refuses it."
    )
    assert said in capsys.readouterr().out.splitlines()
    assert drake_tc([*command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["notes"] == [said]
