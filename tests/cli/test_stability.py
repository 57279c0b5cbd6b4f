"""`drake-tc stability`: a short loop, its JSON, and its refusals."""

import json

import pytest

from drake_tc.cli.main import run

SHORT = "{filters: {window: 8}, tare: 0.0, guard: {start_time: 0.05}, motion: {posture: {r_hip_pitch: -0.45}}}"


def test_verdict_and_simulation_of_a_stable_leg(capsys):
    arguments = ["stability", "hrp2_leg", "--scenario-name", "hanging", "--scenario-text", SHORT, "--at", "0.4"]
    assert run([*arguments, "--joint", "r_knee", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] == "stable" and found["simulation"]["stable"] and found["agree"]
    assert found["open_at"] == "torque_control:command[3]"
    assert 0.9 < found["spectral_radius_but_for_drift"] < 1.0
    assert found["margins"]["gain_margin"] > 1.0 and found["margins"]["sensitivity_peak"] > 1.0
    assert len(found["eigenvalues"]) == 8


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--open-at", "torque_control"], "expected SYSTEM:PORT"),
        (["--open-at", "nobody:command"], "no system 'nobody'; systems: plant"),
        (["--open-at", "guard:command[9]", "--at", "0.1"], "has 6 channels, none of element 9"),
        (["--open-at", "torque_control:command[x]"], "expected SYSTEM:PORT or SYSTEM:PORT[i]"),
        (["--open-at", "guard:x"], "expected one of command, mode"),
        (["--joint", "r_elbow"], "no joint 'r_elbow'; joints: r_hip_yaw"),
        (["--at", "0.0"], "expected the normal mode, to linearise; it is in start"),
        (["--friction", "none"], "expected sliding or modelled"),
    ],
)
def test_refusals_are_one_line(more, message, capsys):
    arguments = ["stability", "hrp2_leg", "--scenario-name", "hanging", "--scenario-text", SHORT, "--at", "0.02"]
    assert run([*arguments, *more]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith("drake-tc:") and message in last
