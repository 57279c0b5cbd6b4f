"""`drake-tc identify --method motor`: parameters, and nothing is repaired, contradicted, cut or lost in silence."""

import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from drake_tc.actuation.model_file import load_model_file

SHEET = (
    "{torque_constant: 0.043, back_emf: 0.043, resistance: 0.55, rotor_inertia: 1.0e-5, gear_ratio: GEAR,"
    " coulomb: 1.0, viscous: 1.0, stiffness: 200.0, voltage_limit: 24.0}"
)


@pytest.fixture
def bench(tmp_path):
    """bench(**columns): arguments of the command on a motor in closed form, with columns of the log replaced.

    v = Rm/(kt N) (tau + tau_co sign v + (tau_v + ke kt N^2/Rm) v + Jm N^2 a).
    """

    def make(gear=100.0, joints=("elbow",), drive="voltage", **columns):
        t = np.arange(6000) * 1e-3
        q, v, a = 0.5 * np.sin(9 * t), 4.5 * np.cos(9 * t), -40.5 * np.sin(9 * t)
        tau = 12.0 * np.sin(3.1 * t + 1.0)
        volts = 0.15 * (tau + 3.0 * np.sign(v) + (1.5 + 0.04**2 * 1e4 / 0.6) * v + 0.12 * a)
        frame = {"time": t}
        for joint in joints:
            frame |= {f"{joint}/position": q, f"{joint}/voltage": volts, f"{joint}/torque": tau}
        pd.DataFrame({**frame, **columns}).to_csv(tmp_path / "run.csv", index=False)
        (tmp_path / "rig.yaml").write_text(f"joints: [{', '.join(joints)}]\ndrive: {drive}\nload: torque\n")
        (tmp_path / "sheet.yaml").write_text(f"motors: {{all: {SHEET.replace('GEAR', str(gear))}}}\n")
        files = ["--rig", tmp_path / "rig.yaml", "--log", tmp_path / "run.csv", "--sheet", tmp_path / "sheet.yaml"]
        return ["identify", "--method", "motor", *files, "--out", tmp_path / "model.yaml"]

    return make


def test_a_voltage_motor_by_its_data_sheet(invoke, bench, tmp_path):
    """Inertia and dry friction are the logs'; kt and Rm come as far back as tau_v is known; the gain is their ratio."""
    call = bench()
    found = json.loads(invoke(*call, "--json").out)["joints"]["elbow"]["parameters"]
    assert_allclose(found["rotor_inertia"]["value"], 1.2e-5, rtol=0.03)
    assert_allclose(found["coulomb"]["value"], 3.0, rtol=0.01)
    assert_allclose(found["torque_constant"]["value"], 0.04, rtol=0.04)
    assert found["torque_constant"]["data_sheet"] == 0.043
    assert found["viscous"]["from_logs"] < 0.5 < 0.99 < found["coulomb"]["from_logs"]
    for name, truth in {"torque_constant": 0.04, "resistance": 0.6, "viscous": 1.5}.items():
        low, high = found[name]["ci95"]
        assert low <= truth <= high
    written = load_model_file(tmp_path / "model.yaml")
    assert written.models["elbow"].drive.kind == "voltage"
    assert_allclose(written.models["elbow"].drive.gain, 0.15, rtol=2e-3)
    assert written.provenance["data_sheet"] == "sheet.yaml"
    shown = invoke(*call).out
    assert "data sheet" in shown and "from logs" in shown


KT = "torque_constant: 0.043"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("motors: {}", "motors: expected a mapping of joint, or 'all'"),
        ("motors: {hip: SHEET}", "no motor of joint 'elbow', nor 'all'; there: hip"),
        (f"motors: {{all: {SHEET.replace(f'{KT}, ', '')}}}", "motors.all: torque_constant is missing"),
        (f"motors: {{all: {SHEET.replace('}', ', mass: 1}')}}}", "motors.all: unknown key 'mass'"),
        (
            f"motors: {{all: {SHEET.replace(KT, 'torque_constant: much')}}}",
            "motors.all.torque_constant: expected a finite number",
        ),
        (
            f"motors: {{all: {SHEET.replace(KT, 'torque_constant: -1')}}}",
            "sheet.yaml: motors.all.torque_constant: expected a number from 1e-12 to 1e+09",
        ),
        ("motors: {all: SHEET}\nwidths: {coulomb: 0}", "widths.coulomb: expected a"),
    ],
)
def test_a_data_sheet_that_cannot_be_used_is_refused(invoke, bench, tmp_path, text, says):
    call = bench()
    (tmp_path / "sheet.yaml").write_text(text.replace("SHEET", SHEET).replace("GEAR", "100.0"))
    assert says in invoke(*call).refusal()


def test_data_sheet_and_method_go_together(invoke, bench):
    call = bench()
    at = call.index("--sheet")
    assert "without a --sheet" in invoke(*call[:at], *call[at + 2 :]).refusal()
    other = ["least_squares" if word == "motor" else word for word in call]
    assert "--method least_squares and a --sheet" in invoke(*other).refusal()


def test_a_column_that_was_turned_is_told_everywhere(invoke, bench, tmp_path):
    call = bench()
    table = pd.read_csv(tmp_path / "run.csv")
    table.assign(**{"elbow/voltage": -table["elbow/voltage"]}).to_csv(tmp_path / "run.csv", index=False)
    outcome = invoke(*call, "--json")
    said = "Column elbow/voltage has the wrong sign and was turned"
    assert said in outcome.err
    assert said in json.loads(outcome.out)["joints"]["elbow"]["notes"][0]
    assert said in load_model_file(tmp_path / "model.yaml").provenance["fits"][0]["notes"][0]


def test_a_sheet_that_the_logs_contradict_is_refused(invoke, bench, tmp_path):
    line = invoke(*bench(gear=1.0)).refusal()
    assert "elbow: logs and data sheet contradict each other" in line
    assert "check gear_ratio" in line
    assert not (tmp_path / "model.yaml").exists()


def test_one_motor_that_fails_does_not_lose_the_other(invoke, bench, tmp_path):
    call = bench(joints=("elbow", "knee"), **{"knee/torque": 0.0})
    outcome = invoke(*call, "--json")
    assert outcome.code == 2
    found = json.loads(outcome.out)
    assert list(found["joints"]) == ["elbow"]
    assert "knee: excitation too poor: the hand's torque is 0 throughout" in found["failed"]["knee"]
    assert "rig.yaml: knee: excitation too poor" in outcome.err.strip().splitlines()[-1]
    assert list(load_model_file(tmp_path / "model.yaml").models) == ["elbow"]


def test_no_motion_is_too_poor_an_excitation(invoke, bench):
    assert "'elbow/position' is constant (0.3 rad) in all rows" in invoke(*bench(**{"elbow/position": 0.3})).refusal()


def test_what_rig_and_files_cannot_be_is_told_before_a_log_is_read(invoke, bench, tmp_path):
    line = invoke(*bench(drive="current")).refusal()
    assert "elbow: expected drive voltage and load torque, got current and torque" in line
    call = bench()
    (tmp_path / "run.csv").unlink()  # not looked at before what follows is refused
    (tmp_path / "plain").write_text("")
    assert "cannot be written" in invoke(*call[:-1], tmp_path / "plain" / "model.yaml").refusal()
    (tmp_path / "sheet.yaml").write_text(f"motors: {{knee: {SHEET.replace('GEAR', '100.0')}}}\n")
    assert "no motor of joint 'elbow'" in invoke(*call).refusal()


def test_a_narrow_terminal_cuts_no_number(invoke, bench, monkeypatch):
    call = bench()
    monkeypatch.setenv("COLUMNS", "40")
    outcome = invoke(*call)
    entries = json.loads(invoke(*call, "--json").out)["joints"]["elbow"]["parameters"]
    lines = {line.split()[0]: line for line in outcome.out.splitlines() if line.strip()}
    for name, entry in entries.items():
        shown = lines[name]
        assert "[{:.4g}, {:.4g}]".format(*entry["ci95"]) in shown
        assert f"{entry['value']:.4g}" in shown
        assert shown.rstrip().endswith(f"{entry['off_sheet_sd']:+.1f}")
