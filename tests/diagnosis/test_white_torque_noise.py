"""White noise of one channel alone, at 250 Hz: nothing is missing, and no effect may explain it."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from drake_tc.diagnosis.notes import NoiseOfRecordedEffort
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.timing_notes import OlderEffort, ViscousByAge
from drake_tc.logs.rig import parse_rig
from drake_tc.logs.rig_writing import save_rig

PERIOD, GAIN = 4e-3, 2e-3


def log(seed: int) -> pd.DataFrame:
    """A servo's joint that lacks nothing: J 0.3 kg m^2, viscous 2 N m s/rad, Coulomb 1.5 N m; torque noise 0.1 N m."""
    rng = np.random.default_rng(seed)
    t = np.arange(5000) * PERIOD
    phase = rng.uniform(0.0, 2.0 * np.pi, 4)
    w = np.array([1.3, 2.1, 3.7, 5.3]) * (1.0 + 0.05 * rng.standard_normal(4))
    a = np.array([0.5, 0.3, 0.1, 0.05])
    angle = np.outer(t, w) + phase
    q, v, acceleration = np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w**2)
    tau = 8.0 * np.sin(3.1 * t + phase[0]) + 4.0 * np.sin(1.7 * t + phase[1])
    motor = tau + 0.3 * acceleration + 2.0 * v + 1.5 * np.tanh(50.0 * v)
    return pd.DataFrame(
        {
            "time": t,
            "joint/position": q,
            "joint/position_command": q + GAIN * motor,
            "joint/torque": tau + 0.1 * rng.standard_normal(t.size),
        }
    )


@pytest.mark.parametrize("seed", [10])
def test_nothing_is_named(tmp_path, seed):
    """Nor is the command taken to be older: friction turns over within 50 mrad/s, alike on both sides of a reversal."""
    paths = [tmp_path / f"run_{i}.csv" for i in range(3)]
    for i, path in enumerate(paths):
        log(seed + i).to_csv(path, index=False)
    document = {"joint": "joint", "drive": "position_servo", "declared": {"rotor_inertia": 0.3}}
    rig = save_rig(parse_rig(document), tmp_path / "rig.yaml")
    found = close_loop(rig, paths[:2], paths[2:], DiagnosisOptions()).joints["joint"]
    assert found.effects == ()
    assert found.verdict == "no_missing_effect"
    assert not [n for n in found.notes if isinstance(n, OlderEffort | ViscousByAge)]
    assert found.final_parameters["viscous"]["viscous"].value == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("seed", [10])
def test_noise_of_a_measured_current_is_no_unexplained_residual(tmp_path, seed):
    """It leaves five times what the other sensors' noise does."""
    paths = [tmp_path / f"run_{i}.csv" for i in range(3)]
    for i, path in enumerate(paths):
        table = log(seed + i)
        current = 10.0 * (table["joint/position_command"] - table["joint/position"])
        noise = 0.01 * np.random.default_rng([seed, i]).standard_normal(len(table))
        table = table.drop(columns="joint/position_command").assign(**{"joint/current": current + noise})
        table.to_csv(path, index=False)
    document = {"joint": "joint", "drive": "current", "declared": {"rotor_inertia": 0.3}}
    rig = save_rig(parse_rig(document), tmp_path / "rig.yaml")
    found = close_loop(rig, paths[:2], paths[2:], DiagnosisOptions()).joints["joint"]
    assert found.effects == ()
    assert found.verdict == "no_missing_effect"
    assert [n.drive for n in found.notes if isinstance(n, NoiseOfRecordedEffort)] == ["current"]


@pytest.mark.parametrize(
    ("sensors", "verdict"),
    [
        (None, "no_missing_effect"),
        ({"torque_noise": 0.6, "correlation_time": 0.02}, "no_missing_effect"),
        ({"torque_noise": 0.1}, "unexplained_residual"),
    ],
)
def test_what_is_declared_of_the_torque_sensor_replaces_the_colour_that_the_log_shows(tmp_path, sensors, verdict):
    """Its noise of 0.6 N m is correlated over 20 ms. An owner who declares 0.1 N m of white noise hears of the rest."""
    rng, pole = np.random.default_rng(5), np.exp(-PERIOD / 0.02)
    paths = [tmp_path / f"run_{i}.csv" for i in range(3)]
    for i, path in enumerate(paths):
        table = log(i)
        white = 0.6 * np.sqrt(1.0 - pole**2) * rng.standard_normal(len(table))
        coloured = lfilter([1.0], [1.0, -pole], white)
        table.assign(**{"joint/torque": table["joint/torque"] + coloured}).to_csv(path, index=False)
    document = {"joint": "joint", "drive": "position_servo", "declared": {"rotor_inertia": 0.3}}
    rig = save_rig(parse_rig(document | ({"sensors": sensors} if sensors else {})), tmp_path / "rig.yaml")
    found = close_loop(rig, paths[:2], paths[2:], DiagnosisOptions()).joints["joint"]
    assert found.verdict == verdict
