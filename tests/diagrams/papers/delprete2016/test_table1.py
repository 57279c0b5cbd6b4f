"""Table 1 of Del Prete et al. (2016): logs give back what was simulated; the committed models agree."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from few_effects import diagnoses_look_for
from numpy.testing import assert_allclose
from scipy.stats import norm

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.model_file import load_model_file, load_models
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagrams.papers.delprete2016.complete_model import (
    COMPLETE,
    DriveEstimate,
    Logs,
    control,
    diagnose,
    drive_estimates,
    read_logs,
)
from drake_tc.diagrams.papers.delprete2016.identification import Experiment, experiment_scenarios, off_line_torque
from drake_tc.diagrams.papers.delprete2016.leg_models import STEM, leg_models, write_leg_models
from drake_tc.diagrams.papers.delprete2016.table1 import family_factor, identify_table1
from drake_tc.loops.recording import write_log
from drake_tc.loops.torque.running import simulate_scenario

MODELS = Path(__file__).resolve().parents[4] / "models" / "hrp2_like"
TRUTH = load_models(MODELS / f"{STEM}_actuators.yaml")
GAIN, VISCOUS, COULOMB, INERTIA, ZONE = 2e-4, 40.0, 2.0, 0.3, 3e-4
NOISE = 1e-5


def k_v(model: ActuatorModel) -> float:
    return model.drive.gain * next(e.parameters["viscous"] for e in model.effects if e.key == "viscous")


def written(folder: Path, name: str, frequency: float, size: float, torque: float, seed: int) -> Path:
    """A log of one joint whose effort follows eq. 6 of Del Prete et al. (2016) with a dead zone, in closed form."""
    time = np.arange(0.0, 14.0, 2e-3)
    rate, load = 2.0 * np.pi * frequency, torque * np.sin(2.0 * np.pi * 0.37 * frequency * time + 1.0)
    q, v, a = (size * f for f in (np.sin(rate * time), rate * np.cos(rate * time), -(rate**2) * np.sin(rate * time)))
    wanted = GAIN * (load + INERTIA * a + VISCOUS * v + COULOMB * np.sign(v))
    effort = wanted + ZONE * np.sign(wanted)
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (2, time.size))
    columns = {
        "time": time,
        "joint/position": q + NOISE * noise[0],
        "joint/position_command": q + effort,
        "joint/torque": load + 0.02 * noise[1],
    }
    return write_log(columns, folder / f"{name}.npz")


@pytest.fixture(scope="module")
def closed_form(tmp_path_factory) -> Logs:
    folder = tmp_path_factory.mktemp("closed_form")
    train = (written(folder, "fast", 0.8, 0.25, 2.0, 1), written(folder, "loaded", 0.3, 0.1, 30.0, 2))
    held = (written(folder, "held", 0.6, 0.2, 10.0, 3),)
    rig = folder / "rig.yaml"
    rig.write_text(yaml.safe_dump({"joint": "joint", "drive": "position_servo", "load": "torque"}))
    friction = (EffectValue("viscous", {"viscous": VISCOUS}), EffectValue("coulomb", {"coulomb": COULOMB}))
    truth = {"joint": ActuatorModel("joint", Drive("position_servo", GAIN), friction)}
    return read_logs(Experiment(train, train, held, train, rig, ("joint",), truth, {"joint": 0.0}, 0))


@pytest.fixture(scope="module")
def declared(closed_form) -> JointResult:
    return control(closed_form, "joint")


def test_closed_form_logs_give_back_both_coefficients(closed_form, declared):
    gain, damping = drive_estimates(declared, closed_form)
    assert_allclose([gain.truth, damping.truth], [GAIN, GAIN * VISCOUS], rtol=1e-12)
    assert abs(gain.error) < 2e-3
    assert abs(damping.error) < 0.5 * damping.half / damping.value  # the age of the command looks like damping
    assert gain.inside(2.0, calibrated=True)


def test_the_gain_has_the_interval_that_close_loop_reports(closed_form, declared):
    gain, damping = drive_estimates(declared, closed_form)
    reported = declared.final_parameters["drive"]["gain"]
    half = 0.5 * (reported.ci95[1] - reported.ci95[0])
    assert_allclose([gain.value, gain.half], [reported.value, half], rtol=0.02)  # other finite differences
    viscous = declared.final_parameters["viscous"]["viscous"]
    assert_allclose(damping.value, reported.value * viscous.value, rtol=1e-9)
    other = 0.5 * (viscous.ci95[1] - viscous.ci95[0]) / viscous.value
    relative = gain.half / gain.value  # of a product: between the difference and the sum, whatever the correlation
    assert abs(relative - other) * 0.98 <= damping.half / damping.value <= 1.02 * (relative + other)


@pytest.mark.slow
def test_a_dead_zone_that_is_not_declared_is_found(closed_form, monkeypatch):
    diagnoses_look_for(monkeypatch, "deadzone", "stribeck", "delay", "elasticity")
    result = diagnose(closed_form, "joint", "deadzone")
    found = {effect.key: effect for effect in result.effects}
    assert "deadzone" in found
    assert_allclose(found["deadzone"].parameters["deadzone"].value, ZONE, rtol=0.05)
    assert result.after.heldout < 0.3 * result.before.heldout


def test_inside_counts_interval_and_tolerance_apart():
    estimate = DriveEstimate("joint", "K_tau", 1.0, 1.006, 0.002, 0.005)
    assert not estimate.inside(calibrated=True)
    assert not estimate.inside(2.9, calibrated=True)
    assert estimate.inside()
    assert not estimate.inside(0.4)
    assert_allclose(estimate.error, 1.0 / 1.006 - 1.0)


@pytest.mark.parametrize("count", [1, 2, 12])
def test_family_wise_intervals_hold_together(count):
    alone = 2.0 * norm.cdf(norm.ppf(0.975) * family_factor(count)) - 1.0
    assert 0.95 - 1e-12 <= alone**count < 0.952


def test_runs_differ_in_noise_and_held_out_ones_in_motion_too():
    runs = experiment_scenarios(3)
    assert len({run.seed for run in runs.values()}) == len(runs)
    assert not {run.seed for run in runs.values()} & {run.seed for run in experiment_scenarios(4).values()}
    assert runs["motion"].motion != runs["held_motion"].motion
    assert runs["sway"].pushes != runs["held_sway"].pushes
    assert runs["pushes"].motion.sinusoids == {}
    assert runs["sway"].pushes == runs["pushes"].pushes


def test_off_line_torque_is_the_plants_own():
    scenario = experiment_scenarios(0)["sway"].changed(duration=1.6)
    recording = simulate_scenario(scenario)
    torque = off_line_torque(recording, scenario.dt)
    truth = recording["joint_torque"]
    inner = slice(50, -50)
    share = np.sqrt(np.mean((torque - truth)[inner] ** 2, axis=0)) / np.ptp(truth[inner], axis=0)
    assert share.max() < 0.02
    # the simulated F/T sensors read 0.5 % too much, and the pushes pass through them
    undone = off_line_torque(recording, scenario.dt, 1.005)
    pitch = recording.robot.joints.index("r_hip_pitch")
    slopes = [np.polyfit(truth[inner, pitch], t[inner, pitch], 1)[0] for t in (torque, undone)]
    assert slopes[0] - slopes[1] > 0.003


@pytest.mark.parametrize("name", ["symmetric", "asymmetric", "identified"])
def test_committed_models_say_where_they_come_from(name):
    file = load_model_file(MODELS / f"{STEM}_{name}.yaml")
    assert set(file.provenance) >= {"identified_by", "method", "record", "note"}
    assert tuple(file.models) == tuple(TRUTH)
    effects = {e.key for model in file.models.values() for e in model.effects}
    assert effects == (set(COMPLETE) if name == "identified" else {"viscous"})
    for model in file.models.values():
        assert all(effect.ci95 and not effect.at_bound for effect in model.effects)


def test_committed_models_are_as_near_the_truth_as_the_table_says():
    symmetric, asymmetric, identified = (
        load_models(MODELS / f"{STEM}_{name}.yaml") for name in ("symmetric", "asymmetric", "identified")
    )
    for joint, truth in TRUTH.items():
        assert_allclose(k_v(identified[joint]), k_v(truth), rtol=1e-3)
        assert_allclose(identified[joint].drive.gain, truth.drive.gain, rtol=0.01)
        assert k_v(symmetric[joint]) > 1.02 * k_v(truth)  # what makes its feedforward unstable
        assert k_v(asymmetric[joint]) < 0.97 * k_v(symmetric[joint])


@pytest.mark.slow
def test_the_committed_models_are_those_that_the_logs_give(tmp_path):
    for path in write_leg_models(leg_models(identify_table1(0, hidden=("deadzone",))), tmp_path):
        fresh, committed = load_models(path), load_models(MODELS / path.name)
        assert list(fresh) == list(committed)
        for joint, model in fresh.items():
            other = committed[joint]
            assert_allclose(model.drive.gain, other.drive.gain, rtol=1e-3)  # rounding, through friction's reversals
            for ours, theirs in zip(model.effects, other.effects, strict=True):
                assert ours.key == theirs.key
                assert_allclose([*ours.parameters.values()], [*theirs.parameters.values()], rtol=5e-3)
