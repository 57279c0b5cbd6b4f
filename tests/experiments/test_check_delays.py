"""Delays between the columns of a simulated joint are stated where they are, and on a sound joint nothing is stated."""

from dataclasses import replace

import numpy as np
import pytest
from few_effects import experiments_fit

from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.experiments.check.consistency import findings
from drake_tc.experiments.check.delays import LATE_VELOCITY, late_columns
from drake_tc.experiments.fitted import fitted_joint
from drake_tc.joint_simulator.measurement import clean_log, measured, sample_clean
from drake_tc.joint_simulator.physics import simulate
from drake_tc.joint_simulator.spec import RigSpec, Sensors
from drake_tc.logs.prepare import load_runs
from drake_tc.logs.rig import load_rig
from tests.benchmarks.blind.files import rig_yaml
from tests.benchmarks.blind.joints import draw_joint

TRAIN = ("static", "sine")
RATE_HZ = 50
NEAR = ("delay", "torque_sensor_gain", "stribeck")
"""What the joint may be taken to lack."""
HALF_A_STEP = 2e-4
"""The simulator's velocity belongs to the middle of its step of 0.2 ms; as much again for noise [s]."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A current drive at 50 Hz; `late` says by how much each channel is recorded late [s]."""
    joint = draw_joint(np.random.default_rng(41), "current")
    spec = RigSpec("rig", "null", "plain", "", joint, 43, sensors=Sensors(rate_hz=RATE_HZ))
    records = simulate([spec] * len(TRAIN), list(TRAIN), step=2e-4)

    def told(**late):
        folder = tmp_path_factory.mktemp("rig")
        for record in records:
            log, rng = clean_log(record), np.random.default_rng([7, TRAIN.index(record.run)])
            velocity = np.interp(log.time - late.get("velocity", 0.0), log.time, log.velocity)
            moved = {
                name: np.interp(log.time - d, log.time, getattr(log, name))
                for name, d in late.items()
                if name != "velocity"
            }
            clean = sample_clean(replace(log, **moved), velocity, spec.sensors, rng)
            table = measured(clean, spec, rng)
            table["joint/velocity"] = clean["unmodelled"] + rng.normal(0.0, 2e-3, len(clean))
            table.to_csv(folder / f"{record.run}.csv", index=False)
        (folder / "rig.yaml").write_text(rig_yaml(spec))
        rig = load_rig(folder / "rig.yaml")
        runs = load_runs([folder / f"{run}.csv" for run in TRAIN], rig)
        with pytest.MonkeyPatch.context() as patch:
            experiments_fit(patch, *NEAR)
            fitted = fitted_joint(prepare_joint(runs, [], rig, "joint"))
        return {f.name: f for f in findings(fitted, late_columns(fitted, runs, "joint"))}

    return told


def delays(found):
    return {name: each for name, each in found.items() if name.startswith("delay of")}


def holds(finding, seconds):
    """Whether the interval, widened to three standard deviations, holds the delay."""
    low, high = finding.interval
    return abs(finding.value - seconds) <= 3.0 / 1.96 * 0.5 * (high - low)


def test_a_sound_joint_has_no_delay(recorded):
    found = recorded()
    assert not delays(found) and found["clocks"].level == "good"


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason="the fit prefers a late effort and a sensor's gain, and is wrong")
def test_a_torque_that_is_late_within_its_sampling_is_told(recorded):
    found = recorded(torque=0.01)
    assert set(delays(found)) == {"delay of the torque"}
    assert abs(found["delay of the torque"].value - 0.01) < 2e-3 and found["delay of the torque"].level == "note"


@pytest.mark.slow
def test_a_late_torque_is_told_as_one(recorded):
    found = delays(recorded(torque=0.02))
    assert set(found) == {"delay of the torque"}
    assert holds(found["delay of the torque"], 0.02)


@pytest.mark.parametrize("seconds", [pytest.param(0.005, marks=pytest.mark.slow), 0.02])
def test_an_effort_that_is_recorded_late_is_stated(recorded, seconds):
    found = recorded(command=seconds)
    assert set(delays(found)) == {"delay of the effort"}
    assert holds(found["delay of the effort"], seconds)


def test_an_effort_that_acts_late_is_an_effect_and_no_delay_of_a_column(recorded):
    found = recorded(command=-0.01)
    assert not delays(found) and holds(found["clocks"], 0.01)


def test_a_late_position_is_late_against_torque_and_velocity(recorded):
    found = delays(recorded(position=0.02))
    assert set(found) == {"delay of the torque", "delay of the velocity"}
    assert all("The position is recorded" in each.text for each in found.values())
    assert holds(found["delay of the torque"], -0.02)
    assert abs(found["delay of the velocity"].value + 0.02) < HALF_A_STEP


def test_a_late_velocity_is_stated(recorded):
    found = recorded(velocity=0.005)
    assert set(delays(found)) == {LATE_VELOCITY}
    assert abs(found[LATE_VELOCITY].value - 0.005) < HALF_A_STEP
    assert "clocks" in found  # of torque and effort it says nothing
