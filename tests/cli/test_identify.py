"""`drake-tc identify`: from logs to a model file, by every method."""

import json

import numpy as np
import pandas as pd
import pytest
import yaml
from numpy.testing import assert_allclose

from drake_tc.actuation.model_file import load_model_file, load_models
from drake_tc.cli.demo import JOINT, ROTOR_INERTIA
from drake_tc.identification.actuator import piecewise_actuator, ratio_interval
from drake_tc.identification.asymmetric import PiecewiseFit, ThreePieces
from drake_tc.identification.identify import Identified

K, VISCOUS, COULOMB = 2e-3, 3.0, 2.0
RIG = "joint: elbow\ndrive: position_servo\ndeclared: {rotor_inertia: 0.3}\n"


@pytest.fixture
def clean(tmp_path):
    """A rig in closed form: q_d = q + K (tau + 0.3 a + 3 v + 2 sign v), pushed by hand the while."""
    t = np.arange(8000) * 1e-3
    q, v, a = 0.6 * np.sin(2 * t), 1.2 * np.cos(2 * t), -2.4 * np.sin(2 * t)
    tau = 20.0 * np.sin(3.1 * t + 1.0)
    command = q + K * (tau + 0.3 * a + VISCOUS * v + COULOMB * np.sign(v))
    frame = {"time": t, "elbow/position": q, "elbow/position_command": command, "elbow/torque": tau}
    pd.DataFrame(frame).to_csv(tmp_path / "run.csv", index=False)
    (tmp_path / "rig.yaml").write_text(RIG)
    return ["--rig", tmp_path / "rig.yaml", "--log", tmp_path / "run.csv"]


@pytest.mark.parametrize("method", ["least_squares", "asymmetric"])
def test_the_model_file_holds_friction_in_torque(invoke, clean, tmp_path, method):
    out = tmp_path / "deep" / "model.yaml"
    assert invoke("identify", *clean, "--method", method, "--out", out).code == 0
    model = load_models(out)["elbow"]
    assert_allclose(model.drive.gain, K, rtol=1e-3)  # no noise; the smoothing touches sign(v) alone
    values = {value.key: value for value in model.effects}
    assert_allclose(values["viscous"].parameters["viscous"], VISCOUS, rtol=1e-2)
    assert_allclose(values["coulomb"].parameters["coulomb"], COULOMB, rtol=1e-2)
    assert model.inertia == 0.3
    for name in ("viscous", "coulomb"):
        low, high = values[name].ci95[name]
        assert low <= values[name].parameters[name] <= high


@pytest.mark.parametrize("method", ["least_squares", "asymmetric", "two_stage", "piecewise"])
def test_every_method_writes_a_model_that_says_where_it_came_from(invoke, bench, tmp_path, method):
    out = tmp_path / "model.yaml"
    outcome = invoke("identify", *bench.arguments(), "--method", method, "--out", out)
    assert outcome.code == 0
    assert JOINT in outcome.out and method in outcome.out and str(out) in outcome.out
    written = load_model_file(out)
    assert written.models[JOINT].inertia == ROTOR_INERTIA
    fit = written.provenance["fits"][0]
    assert written.provenance["logs"] == [p.name for p in bench.logs]
    assert fit["method"] == method and fit["rms"]["unit"] == "rad" and fit["rms"]["value"] > 0
    assert "/" not in yaml.safe_dump(written.provenance["logs"])  # no folders of this machine


def test_json_alone_on_stdout(invoke, clean, tmp_path):
    outcome = invoke("identify", *clean, "--json", "--out", tmp_path / "m.yaml")
    assert outcome.code == 0 and outcome.err == ""
    row = json.loads(outcome.out)["joints"]["elbow"]
    assert_allclose(row["parameters"]["K_tau"]["value"], K, rtol=1e-3)
    low, high = row["parameters"]["K_tau"]["ci95"]
    assert low <= row["parameters"]["K_tau"]["value"] <= high
    assert row["parameters"]["K_v"]["unit"] == "rad*s/rad"


def test_a_narrow_terminal(invoke, clean, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    outcome = invoke("identify", *clean, "--out", tmp_path / "m.yaml")
    table = [line for line in outcome.out.splitlines() if not line.startswith("model: ")]
    assert max(map(len, table)) <= 60
    assert "K_tau" in outcome.out and "[" in outcome.out


def test_refusals(invoke, clean, tmp_path):
    assert "--rig" in invoke("identify", *clean[2:]).refusal()
    assert "--log" in invoke("identify", *clean[:2]).refusal()
    assert "elbow" in invoke("identify", *clean, "--joint", "hip", "--out", tmp_path / "m.yaml").refusal()


def test_a_torque_of_the_wrong_sign_is_refused_or_turned(invoke, clean, tmp_path):
    table = pd.read_csv(tmp_path / "run.csv")
    table["elbow/torque"] *= -1
    table.to_csv(tmp_path / "run.csv", index=False)
    out = tmp_path / "m.yaml"
    outcome = invoke("identify", *clean, "--out", out)
    if outcome.code == 0:
        assert_allclose(load_models(out)["elbow"].drive.gain, K, rtol=1e-2)  # the reader saw it and turned it
    else:
        assert "sign" in outcome.refusal()


def test_the_interval_of_a_ratio_matches_drawn_ratios():
    """Against a sample of correlated normal pairs, far from a zero gain."""
    rng = np.random.default_rng(0)
    x, k, sx, sk, rho = 3.0, 2.0, 0.06, 0.05, 0.6
    z = rng.standard_normal((2, 400_000))
    pairs = x + sx * z[0], k + sk * (rho * z[0] + np.sqrt(1 - rho**2) * z[1])
    low, high = ratio_interval((x - 1.96 * sx, x + 1.96 * sx), x, (k - 1.96 * sk, k + 1.96 * sk), k, rho)
    drawn = np.quantile(pairs[0] / pairs[1], [0.025, 0.975])
    assert_allclose([low, high], drawn, rtol=3e-3)  # first order, and the sample's own scatter


def test_three_pieces_read_as_a_dead_zone_and_coulomb_friction():
    """Curves of y = K (tau + s F) + w sign(tau + s F), the jump drawn out over 0.2 N m, give K, F and w back."""
    gain, friction, width, half = 2e-3, 3.0, 4e-3, 0.1

    def curve(way: float) -> ThreePieces:
        middle = -way * friction
        slope = gain + width / half
        return ThreePieces((middle - half, middle + half), (gain, slope, gain), -slope * middle, True, 1, False, 0.0)

    fit = PiecewiseFit(curve(1.0), curve(-1.0))
    torque = np.array([-20.0, 20.0])
    assert_allclose(fit(torque, np.ones(2)), gain * (torque + friction) + width * np.sign(torque), rtol=1e-12)
    found = Identified("elbow", "position_servo", "piecewise", {}, {}, 0.0, np.zeros(1), fit, ("run",))
    drive, (coulomb, zone) = piecewise_actuator(found, fit)
    assert_allclose(drive.gain, gain, rtol=1e-12)  # closed form, rounding alone
    assert_allclose(coulomb.parameters["coulomb"], friction, rtol=1e-12)
    assert_allclose(zone.parameters["deadzone"], width, rtol=1e-9)


MOTOR = "torque_constant: {kt}, back_emf: {kt}, resistance: 0.55, rotor_inertia: 1.0e-5, gear_ratio: 100.0"
REST = "coulomb: 1.0, viscous: 1.0, stiffness: 200.0, voltage_limit: 24.0"


@pytest.fixture
def volts(tmp_path):
    """A motor in closed form, v = Rm/(kt N) (tau + tau_co sign v + (tau_v + ke kt N^2/Rm) v + Jm N^2 a)."""
    kt, rm, jm, ratio, coulomb, viscous = 0.04, 0.6, 1.2e-5, 100.0, 3.0, 1.5
    t = np.arange(8000) * 1e-3
    q, v, a = 0.5 * np.sin(9 * t), 4.5 * np.cos(9 * t), -40.5 * np.sin(9 * t)
    tau = 12.0 * np.sin(3.1 * t + 1.0)
    friction = coulomb * np.sign(v) + (viscous + kt * kt * ratio**2 / rm) * v
    command = rm / (kt * ratio) * (tau + friction + jm * ratio**2 * a)
    frame = {"time": t, "elbow/position": q, "elbow/voltage": command, "elbow/torque": tau}
    pd.DataFrame(frame).to_csv(tmp_path / "run.csv", index=False)
    (tmp_path / "rig.yaml").write_text("joint: elbow\ndrive: voltage\nload: torque\n")
    (tmp_path / "sheet.yaml").write_text(f"motors:\n  all: {{{MOTOR.format(kt=0.043)}, {REST}}}\n")
    return ["--rig", tmp_path / "rig.yaml", "--log", tmp_path / "run.csv", "--method", "motor"]


def test_a_voltage_motor_by_its_data_sheet(invoke, volts, tmp_path):
    """Inertia and dry friction are the logs'; kt and Rm come as far back as tau_v is known; the gain is their ratio."""
    out = tmp_path / "model.yaml"
    outcome = invoke("identify", *volts, "--sheet", tmp_path / "sheet.yaml", "--json", "--out", out)
    found = json.loads(outcome.out)["joints"]["elbow"]["parameters"]
    assert_allclose(found["rotor_inertia"]["value"], 1.2e-5, rtol=0.03)
    assert_allclose(found["coulomb"]["value"], 3.0, rtol=0.01)
    assert_allclose(found["torque_constant"]["value"], 0.04, rtol=0.04)
    assert found["torque_constant"]["data_sheet"] == 0.043
    assert found["viscous"]["from_logs"] < 0.5 < 0.99 < found["coulomb"]["from_logs"]
    for name, truth in {"torque_constant": 0.04, "resistance": 0.6, "viscous": 1.5}.items():
        low, high = found[name]["ci95"]
        assert low <= truth <= high
    written = load_model_file(out)
    assert written.models["elbow"].drive.kind == "voltage"
    assert_allclose(written.models["elbow"].drive.gain, 0.15, rtol=2e-3)
    assert written.provenance["data_sheet"] == "sheet.yaml"
    shown = invoke("identify", *volts, "--sheet", tmp_path / "sheet.yaml", "--out", out).out
    assert "data sheet" in shown and "from logs" in shown


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("motors: {}", "motors: expected a mapping of joint, or 'all'"),
        (f"motors: {{hip: {{{MOTOR.format(kt=0.04)}, {REST}}}}}", "no motor of joint 'elbow', nor 'all'; there: hip"),
        (f"motors: {{all: {{{REST}}}}}", "motors.all: torque_constant is missing"),
        (f"motors: {{all: {{{MOTOR.format(kt=0.04)}, {REST}, mass: 1}}}}", "motors.all: unknown key 'mass'"),
        (
            f"motors: {{all: {{{MOTOR.format(kt='much')}, {REST}}}}}",
            "motors.all.torque_constant: expected a finite number",
        ),
        (
            f"motors: {{all: {{{MOTOR.format(kt=-1)}, {REST}}}}}",
            "sheet.yaml: motors.all.torque_constant: expected a number from 1e-12 to 1e+09",
        ),
        (
            f"motors: {{all: {{{MOTOR.format(kt=0.04)}, {REST}}}}}\nwidths: {{coulomb: 0}}",
            "widths.coulomb: expected a",
        ),
    ],
)
def test_a_data_sheet_that_cannot_be_used_is_refused(invoke, volts, tmp_path, text, says):
    sheet = tmp_path / "sheet.yaml"
    sheet.write_text(text)
    assert says in invoke("identify", *volts, "--sheet", sheet, "--out", tmp_path / "m.yaml").refusal()


def test_data_sheet_and_method_go_together(invoke, clean, volts, tmp_path):
    assert "without a --sheet" in invoke("identify", *volts).refusal()
    assert "--method least_squares and a --sheet" in invoke("identify", *clean, "--sheet", "x.yaml").refusal()
