"""`drake-tc bode`: the table, its JSON, the plot, and what it says of ports that are not there."""

import json

import numpy as np
import pytest

from drake_tc.analysis.frequency_response import FrequencyResponse
from drake_tc.cli.bode_command import _print
from drake_tc.cli.bode_measurement import BodeMeasurement
from drake_tc.cli.main import run

PORTS = ["--input", "reference:y0", "--output", "actuators:transmitted_torque"]
QUIET = (
    "{reference: {amplitude: 0.0}, effects: {coulomb: {}}, "
    "sensors: {motor_encoder: {resolution: 0}, torque: {noise: 0}}}"
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
    assert found["bandwidth_is_at_least"]
    assert not found["phase_modulo_360"]


def test_a_table_for_people_and_no_prediction_where_none_is_wanted(capsys):
    assert run(["bode", "sea_joint", *PORTS, *SHORT, "--scenario-text", QUIET, "--no-prediction"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert "|H| [dB]" in out[0]
    assert len(out) == 4
    assert "phase modulo 360 [deg]" in out[0]
    assert out[1].split()[-2:] == ["-", "-"]
    assert out[3].startswith("-3 dB bandwidth: at least 9.0")


def test_a_narrow_terminal_cuts_no_figure(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    f, nothing = np.array([5.0, 123.456]), np.full(2, np.nan)
    h = np.array([1.1 * np.exp(-1.0j), 0.0])
    measured = FrequencyResponse(f, h, np.array([0.0123, np.nan]), turned=np.array([-1.0 - 2.0 * np.pi, 0.0]))
    _print(BodeMeasurement(measured, FrequencyResponse(f, np.array([1.0, 1e-3]), nothing, turned=np.zeros(2)), ()))
    out = capsys.readouterr().out.splitlines()
    assert out[1].split() == ["5.000", "0.83", "-417.3", "0.012", "0.00", "0.0"]
    assert out[2].split() == ["123.456", "-", "-", "-", "-60.00", "0.0"]
    assert out[3] == "-3 dB bandwidth: 5.06 Hz"


def test_an_unstable_loop_has_no_prediction_and_no_steady_sine(capsys):
    """Ten times the gain that keeps the rule: what is measured is the limit cycle, not an answer."""
    text = "{reference: {amplitude: 0.0}, control: {kp: 40.0}}"
    brief = ["--from", "5", "--to", "5", "--points", "1", "--at", "0.3", "--settle", "0.2", "--measure", "0.4"]
    assert run(["bode", "sea_joint", *PORTS, *brief, "--scenario-text", text, "--json"]) == 0
    told = capsys.readouterr()
    found = json.loads(told.out, parse_constant=pytest.fail)
    assert "the linearised loop is unstable: spectral radius 1.0" in found["note"]
    assert "Hz: no steady sine (distortion" in found["note"]
    assert found["rows"][0]["predicted_magnitude_db"] is None
    assert found["bandwidth_hz"] is None
    assert not found["rows"][0]["steady"]
    assert "no steady sine" in told.err


def test_a_plot_that_cannot_be_written_and_a_frequency_too_high_are_told_before_anything_is_measured(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    for more, says in (
        (["--plot", str(tmp_path / "file" / "bode.png")], "cannot be written"),
        (["--to", "600"], "expected frequencies below 400 Hz"),
    ):
        assert run(["bode", "sea_joint", *PORTS, *more]) == 2
        told = capsys.readouterr()
        assert says in told.err
        assert told.out == ""
        assert "Hz\n" not in told.err.replace("below 400 Hz", "")  # no progress on a sine


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--input", "nothing:y0", "--output", "plant:state"], "no system 'nothing'; systems: plant, actuators"),
        (["--input", "reference:y7", "--output", "plant:state"], "port 'reference:y7': expected one of y0"),
        (["--input", "reference:y0", "--output", "reference"], "expected SYSTEM:PORT"),
        ([*PORTS, "--from", "9", "--to", "2"], "expected 0 < --from <= --to"),
        ([*PORTS, "--plot", "bode.txt"], "expected --plot FILE.png"),
        ([*PORTS, "--amplitude", "0"], "amplitude: expected a positive number"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(capsys, arguments, says):
    assert run(["bode", "sea_joint", *arguments]) == 2
    error = capsys.readouterr().err.strip().splitlines()
    told = [line for line in error if not line.startswith("bode sea_joint: on its way to t = 0.7 s")]
    assert len(told) == 1
    assert says in told[0]


def test_an_unknown_diagram_lists_those_there_are(capsys):
    assert run(["bode", "nowhere", *PORTS]) == 2
    assert "no diagram 'nowhere'; diagrams: hrp2_leg" in capsys.readouterr().err


@pytest.mark.slow
def test_a_port_of_another_diagram(capsys):
    arguments = ["--input", "torque_control:desired_torque[2]", "--output", "torque_control:command[2]"]
    arguments += ["--from", "5", "--to", "5", "--points", "1", "--settle", "0.1", "--measure", "0.4", "--json"]
    assert run(["bode", "hrp2_leg", "--scenario-text", "{sensors: perfect}", *arguments]) == 0
    found = json.loads(capsys.readouterr().out)
    row = found["rows"][0]
    assert np.isfinite([row["magnitude_db"], row["predicted_magnitude_db"]]).all()
    assert abs(row["phase_deg"] - row["predicted_phase_deg"]) <= 180.0
    # cut there, nothing holds the leg up: it grows, but hardly in a measurement of half a second
    assert "the linearised loop is unstable: spectral radius 1.000" in found["note"]
