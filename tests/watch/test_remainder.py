"""The smooth part of what is left: its kernel, its size on held-out rows, the model file, and a whole diagnosis."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from drake_tc.actuation.model_file import ModelFile, load_model_file, load_models
from drake_tc.actuation.remainder import EDGE, LENGTHS, SUBSETS, Remainder, features
from drake_tc.cli.demo import demo_model, demo_run
from drake_tc.cli.main import run
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.residual.remainder import remainder_of, share_of
from drake_tc.diagnosis.result.models import models_of
from drake_tc.diagnosis.run import close_loop
from drake_tc.effects.base import plain_signals
from drake_tc.errors import ParamsError
from drake_tc.report.data_files import joint_json
from drake_tc.report.words import remainder_sentence
from tests.watch.conftest import LENGTH

GAIN = 2e-4


def split(seed: int, smooth: float, noise: float, runs: int = 6):
    """Rows of a joint whose residual is a function of position and velocity, and white noise [N m]."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.02)
    phase = rng.uniform(0.0, 6.0, 2)
    q, v = np.sin(time + phase[0]), 0.8 * np.cos(1.7 * time + phase[1])
    load = 5.0 * np.sin(0.4 * time)
    signals = plain_signals(time.size, {"position": q, "velocity": v, "load_torque": load})
    samples = SimpleNamespace(signals=signals, rows=np.arange(time.size), run=np.arange(time.size) * runs // time.size)
    true = smooth * np.cos(2.0 * q) * np.tanh(3.0 * v)
    return SimpleNamespace(samples=samples, after=GAIN * (true + noise * rng.standard_normal(time.size))), true


def test_features_are_those_of_gaussian_kernels_of_one_and_two_signals():
    z = np.random.default_rng(0).normal(0.0, 0.7, (40, 4))
    apart = z[:, None] - z[None]
    kernels = [np.exp(-0.5 * np.sum(apart[:, :, s] ** 2, axis=2) / length**2) for s in SUBSETS for length in LENGTHS]
    expected = np.mean(kernels, axis=0)
    psi = features(z, 20000)
    assert np.abs(psi @ psi.T - expected).max() < 0.03


def test_it_is_bounded_and_falls_to_0_outside_of_what_was_seen():
    rng = np.random.default_rng(1)
    one = Remainder(np.zeros(4), np.ones(4), np.zeros((1, 4)), 2.0, 0.5, 0.3, rng.normal(size=32))
    q = np.linspace(-1.0, 1.0, 201)
    inside = one.torque(q, 0.2 * q, q)
    assert np.abs(inside).max() == pytest.approx(0.3)
    edge, beyond = (one.torque(np.array([x]), np.zeros(1), np.zeros(1))[0] for x in (2.0, 2.0 + 6.0 * EDGE))
    assert abs(beyond) <= 0.3 * np.exp(-18.0) < abs(edge)


def test_the_share_is_the_one_of_the_truth_and_its_interval_holds_it():
    held = []
    for seed in range(20):
        (train, _), (test, true) = split(seed, 0.6, 0.8), split(100 + seed, 0.6, 0.8)
        found = remainder_of(train, test, GAIN)
        expected = np.mean(true**2) / (np.mean(true**2) + 0.64)
        held.append(found.model.share_ci95[0] <= expected <= found.model.share_ci95[1])
        assert found.holds and found.model.share == pytest.approx(expected, abs=0.05)
        s = test.samples.signals
        told = found.model.torque(s.position, s.velocity, s.load_torque)
        assert np.corrcoef(told, true)[0, 1] > 0.9
    assert np.mean(held) >= 0.8  # a bootstrap of six runs is a little narrow


def test_noise_alone_has_no_remainder():
    found = [remainder_of(split(s, 0.0, 0.8)[0], split(50 + s, 0.0, 0.8)[0], GAIN) for s in range(10)]
    assert not any(each.holds for each in found)
    assert max(abs(each.model.share) for each in found) < 0.02


def test_the_interval_of_a_share_is_that_of_drawing_runs():
    error, told = np.array([1.0, 1.0, 2.0, 2.0]), np.array([1.0, 1.0, 0.0, 0.0])
    share, (low, high) = share_of(error, told, np.array([0, 0, 1, 1]))
    assert share == pytest.approx(2.0 / 10.0) and (low, high) == (0.0, 1.0)


def test_a_model_file_is_read_back_and_a_bad_remainder_is_named(tmp_path, diagnosed):
    models = load_models(diagnosed.model)
    rng = np.random.default_rng(2)
    one = Remainder(
        rng.normal(size=4), np.ones(4), rng.normal(size=(2, 4)), 1.5, 0.5, 0.3, rng.normal(size=8), 0.2, (0.1, 0.3)
    )
    path = tmp_path / "model.yaml"
    ModelFile(models, remainders={"simulated_knee": one}).save(path)
    back = load_model_file(path)
    assert back.models == models
    q = np.linspace(-2.0, 2.0, 50)
    read = back.remainders["simulated_knee"]
    np.testing.assert_array_equal(read.torque(q, q, q), one.torque(q, q, q))
    assert (read.share, read.share_ci95) == (0.2, (0.1, 0.3))
    path.write_text(path.read_text().replace("slow: 0.5", "slow: -0.5"))
    with pytest.raises(ParamsError, match="slow: expected a positive number"):
        load_model_file(path)


def test_friction_that_the_library_lacks_is_a_remainder_of_the_model_and_exports_name_it(tmp_path, capsys):
    model = demo_model(0)
    model = replace(model, effects=tuple(value for value in model.effects if value.key != "deadzone"))
    tables = []
    for number in (5, 6, 7):
        made = demo_run(model, "multisine_held_out", number, LENGTH, np.random.default_rng(number))
        tables.append(pd.DataFrame({"time": made.time, **made.columns}))
    rig = {"joint": "simulated_knee", "drive": "position_servo", "declared": {"rotor_inertia": 0.31}}
    found = close_loop(rig, tables[:2], tables[2:], DiagnosisOptions(effects=()))
    (joint,) = found.joints.values()
    assert joint.verdict == "unexplained_structure"
    assert joint.remainder.holds and joint.remainder.model.share > 0.5  # a Stribeck peak
    entry = json.loads(json.dumps(joint_json(joint)["remainder"]))
    assert entry["share"]["value"] == pytest.approx(joint.remainder.model.share, rel=1e-3)
    assert "smooth function of position, velocity and load torque" in remainder_sentence(joint)
    models_of(found, tmp_path)
    read = load_model_file(tmp_path / "model_after.yaml").remainders["simulated_knee"]
    slow, fast = (float(read.torque(np.zeros(1), np.array([v]), np.zeros(1))[0]) for v in (0.05, 0.5))
    assert slow > fast + 1.0  # the peak of 4 N m near rest resists
    for target, name in (("mjcf", "m.xml"), ("c", "m.c")):
        assert run(["export", str(tmp_path / "model_after.yaml"), "--to", target, "--out", str(tmp_path / name)]) == 0
        assert f"the remainder of the model, {read.rms:.3g} N m RMS" in capsys.readouterr().out
