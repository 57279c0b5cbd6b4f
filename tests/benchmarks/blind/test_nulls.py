"""Rigs that lack nothing: what their sensors add is what the kind says, and no more than it says."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.ndimage import gaussian_filter1d

from drake_tc.joint_simulator.measurement import clean_log, measured, sample_clean
from drake_tc.joint_simulator.physics import simulate
from drake_tc.joint_simulator.reference import make_motion
from drake_tc.joint_simulator.spec import RUNS, BlindError, RigSpec
from tests.benchmarks.blind.catalogue import caused_rig
from tests.benchmarks.blind.files import rig_yaml
from tests.benchmarks.blind.noise import torque_left_by_noise, torque_of_position
from tests.benchmarks.blind.nulls import FULL_NULLS, SMOKE_NULLS, TORQUE_BIAS, null_rig
from tests.benchmarks.blind.oracle import differences
from tests.benchmarks.blind.truth import unmodelled_torque
from tests.benchmarks.blind.verdicts import right_verdicts

from .make import rig


def tables(spec: RigSpec) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The clean and the measured multisine."""
    record = simulate([spec], ["multisine"], 2.5e-4)[0]
    log = clean_log(record)
    rng = np.random.default_rng(3)
    clean = sample_clean(log, unmodelled_torque(record, log), spec.sensors, rng)
    return clean, measured(clean, spec, rng)


def test_kinds_and_counts() -> None:
    assert 45 <= sum(FULL_NULLS.values()) <= 60
    assert set(SMOKE_NULLS) <= set(FULL_NULLS)
    for kind in FULL_NULLS:
        assert null_rig(kind, 0, 4) == null_rig(kind, 0, 4)
        assert null_rig(kind, 0, 4) != null_rig(kind, 0, 5)
        wanders = kind == "drifting_noise"
        assert right_verdicts(null_rig(kind, 1, 0)) == ["no_missing_effect"] + ["unexplained_residual"] * wanders
    with pytest.raises(BlindError, match="no null kind 'gremlins'"):
        null_rig("gremlins", 0, 0)


@pytest.mark.parametrize("channel", ["torque", "position", "command"])
@pytest.mark.parametrize("k", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_channel_noise_is_one_to_one_and_a_half_of_the_rest(channel: str, k: int) -> None:
    """Monte Carlo: the noise alone, written into the balance y/K - tau - J a - B v, against the rest of the noise."""
    spec = null_rig(f"{channel}_channel_noise", k, 2)
    low, high = spec.sensors.band_hz
    rms = {"torque": spec.sensors.torque_band, "position": spec.sensors.position_band}.get(
        channel, spec.sensors.command_band
    )
    time = np.arange(20_000) * 1e-3
    rng = np.random.default_rng(8)
    tones = rng.uniform(low, high, 400)
    noise = rms * np.sqrt(2 / 400) * np.sin(2 * np.pi * np.outer(time, tones) + rng.uniform(0, 6.28, 400)).sum(axis=1)
    joint = spec.joint
    if channel == "position":
        effort = -noise / joint.gain if joint.drive == "position_servo" else 0.0 * noise
        motion = joint.rotor_inertia * differences(noise, 2, 1e-3) + joint.damping * differences(noise, 1, 1e-3)
        error = effort - motion
    else:
        error = noise if channel == "torque" else noise / joint.gain
    ratio = np.std(error[2:-2]) / torque_left_by_noise(spec)
    assert 0.93 < ratio < 1.6  # 1 to 1.5, and 7 % of a draw of 400 tones


def test_noise_left_is_what_smoothing_leaves() -> None:
    """Monte Carlo of white torque noise and encoder steps through the kernel, against the closed forms."""
    spec = rig()
    spec = replace(spec, sensors=replace(spec.sensors, encoder_step=1e-3, torque_noise=0.3))
    rng = np.random.default_rng(1)
    width = 5.0
    errors = gaussian_filter1d(rng.uniform(-0.5e-3, 0.5e-3, 400_000), width)
    torque = gaussian_filter1d(rng.normal(0.0, 0.3, 400_000), width)
    motion = spec.joint.rotor_inertia * differences(errors, 2, 1e-3) + spec.joint.damping * differences(errors, 1, 1e-3)
    left = np.std((errors / spec.joint.gain + motion + torque)[10:-10])
    # 400 000 samples of a correlation of 10: 0.5 %; central differences over 1 ms: 1 % at this width
    np.testing.assert_allclose(torque_left_by_noise(spec, width * 1e-3), left, rtol=0.02)


def test_position_error_over_a_narrow_band_is_the_transfer_function() -> None:
    spec = rig(drive="voltage")
    w = 2 * np.pi * 3.0
    expected = np.hypot(spec.joint.rotor_inertia * w**2, spec.joint.damping * w)
    np.testing.assert_allclose(torque_of_position(spec, 2.999, 3.001), expected, rtol=1e-3)


@pytest.mark.parametrize("channel", ["torque_band", "position_band", "command_band"])
def test_noise_reaches_its_channel_alone(channel: str) -> None:
    base = rig()
    quiet = replace(base.sensors, torque_noise=0.0, temperature_noise=0.0, encoder_step=1e-9)
    sensors: Mapping[str, float] = {channel: 0.01}
    clean, table = tables(replace(base, sensors=replace(quiet, **sensors)))
    added = {
        "torque_band": table["joint/torque"] - clean["torque"],
        "position_band": table["joint/position"] - clean["position"],
        "command_band": table["joint/position_command"] - clean["command"],
    }
    for name, error in added.items():
        if name == channel:
            assert 0.004 < error.std() < 0.02  # three seconds of noise between 1 and 5 Hz
        else:
            np.testing.assert_allclose(error, 0.0, atol=1e-6)


def test_biases_and_drift_of_the_thermometer() -> None:
    base = rig()
    quiet = replace(base.sensors, torque_noise=0.0, temperature_noise=0.0)
    changed = replace(quiet, torque_bias=0.02, torque_gain=0.001, temperature_drift=6.0)
    clean, table = tables(replace(base, sensors=changed))
    np.testing.assert_allclose(table["joint/torque"], 1.001 * clean["torque"] + 0.02, atol=1e-6)
    # 0.01 K is the resolution of the file
    np.testing.assert_allclose(table["joint/temperature"] - clean["temperature"], 0.2 * clean["time"], atol=0.006)
    for k in range(3):
        spec = null_rig("data_sheet_bias", k, 6)
        assert 0.0 < abs(spec.sensors.torque_bias) <= TORQUE_BIAS < torque_left_by_noise(spec)


def test_slow_rig_moves_slowly_at_a_low_rate() -> None:
    slow = null_rig("slow_rig", 1, 0)
    assert slow.sensors.rate_hz <= 200
    usual = replace(slow, pace=1.0)
    for run in RUNS:
        ratio = np.max(np.abs(make_motion(slow, run).velocity)) / np.max(np.abs(make_motion(usual, run).velocity))
        assert 0.7 * slow.pace < ratio < 1.6 * slow.pace, run


def test_sampling_and_drives() -> None:
    assert {null_rig("sampling_rate", k, 0).sensors.rate_hz for k in range(5)} >= {100, 250, 500}
    assert all(null_rig("voltage_drive", k, 0).joint.drive == "voltage" for k in range(4))
    coarse = null_rig("coarse_encoder_jitter", 0, 0)
    np.testing.assert_allclose(coarse.sensors.encoder_step, 1.534e-3, rtol=1e-3)
    assert coarse.sensors.jitter > 0.0


def test_some_owners_declare_their_sensors_noise() -> None:
    spec = null_rig("coloured_noise", 1, 0)
    declared = yaml.safe_load(rig_yaml(spec))["sensors"]
    np.testing.assert_allclose(declared["torque_noise"], spec.sensors.torque_noise, atol=1e-6)
    np.testing.assert_allclose(declared["correlation_time"], spec.sensors.torque_noise_time, atol=1e-6)
    assert "sensors" not in yaml.safe_load(rig_yaml(null_rig("coloured_noise", 0, 0)))


def test_two_of_three_saturated_rigs_train_as_fast_as_they_are_judged() -> None:
    paces = [caused_rig(("saturation",), "single", "middle", k, 0).sine_pace for k in range(3)]
    assert sorted(paces) == [1.0, 2.0, 2.0]
    assert all(caused_rig(("stribeck",), "single", "middle", k, 0).sine_pace == 1.0 for k in range(3))
