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
