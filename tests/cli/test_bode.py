"""`drake-tc bode`: the table, its JSON, the plot, and what it says of ports that are not there."""

import json

import numpy as np
import pytest

from drake_tc.cli.main import run

PORTS = ["--input", "reference:y0", "--output", "actuators:transmitted_torque"]
QUIET = (
    "{wanted: {amplitude: 0.0}, effects: {coulomb: {}}, sensors: {motor_encoder: {resolution: 0}, torque: {noise: 0}}}"
)
SHORT = ["--from", "4", "--to", "9", "--points", "2", "--at", "0.1", "--settle", "0.2", "--measure", "0.4"]


def test_measured_and_predicted_agree_where_nothing_is_rough(capsys, tmp_path):
    plot = tmp_path / "plots" / "bode.png"
    assert run(["bode", "sea_joint", *PORTS, *SHORT, "--scenario-text", QUIET, "--plot", str(plot), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert plot.stat().st_size > 10_000
    assert (found["diagram"], found["input"], found["note"]) == ("sea_joint", "reference:y0", "")
    rows = found["rows"]
    assert len(rows) == 2
    np.testing.assert_allclose([row["frequency_hz"] for row in rows], [4.0, 9.0], rtol=0.02)
    for row in rows:
        # encoder without steps, no friction: what is left is the accuracy of the differences
        assert abs(row["magnitude_db"] - row["predicted_magnitude_db"]) < 1e-3
        assert abs(row["phase_deg"] - row["predicted_phase_deg"]) < 0.01
        assert abs(row["phase_deg"] + 360.0 * 0.015 * row["frequency_hz"]) < 3.0
        assert row["distortion"] < 1e-3
    assert found["bandwidth_hz"] == rows[-1]["frequency_hz"]


def test_a_table_for_people_and_no_prediction_where_none_is_wanted(capsys):
    assert run(["bode", "sea_joint", *PORTS, *SHORT, "--scenario-text", QUIET, "--no-prediction"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert "|H| [dB]" in out[0]
    assert len(out) == 3
    assert out[1].split()[-2:] == ["-", "-"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--input", "nothing:y0", "--output", "plant:state"], "no system 'nothing'; systems: plant, actuators"),
        (["--input", "reference:y7", "--output", "plant:state"], "port 'reference:y7': wanted one of y0"),
        (["--input", "reference:y0", "--output", "reference"], "wanted SYSTEM:PORT"),
        ([*PORTS, "--from", "9", "--to", "2"], "wanted 0 < --from <= --to"),
        ([*PORTS, "--plot", "bode.txt"], "wanted --plot FILE.png"),
        ([*PORTS, "--amplitude", "0"], "sweep.amplitude"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(capsys, arguments, says):
    assert run(["bode", "sea_joint", *arguments]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1
    assert says in error[0]


def test_an_unknown_diagram_lists_those_there_are(capsys):
    assert run(["bode", "nowhere", *PORTS]) == 2
    assert "no diagram 'nowhere'; diagrams: hrp2_leg" in capsys.readouterr().err


@pytest.mark.slow
def test_a_port_of_another_diagram(capsys):
    arguments = ["--input", "torque_control:desired_torque[2]", "--output", "torque_control:command[2]"]
    arguments += ["--from", "5", "--to", "5", "--points", "1", "--settle", "0.1", "--measure", "0.4", "--json"]
    assert run(["bode", "hrp2_leg", "--scenario-text", "{sensors: perfect}", *arguments]) == 0
    row = json.loads(capsys.readouterr().out)["rows"][0]
    assert np.isfinite([row["magnitude_db"], row["predicted_magnitude_db"]]).all()
