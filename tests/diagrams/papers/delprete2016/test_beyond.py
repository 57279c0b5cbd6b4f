"""Predictor, observer and floating base in the leg's loop; what A.beyond makes of known runs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagrams.papers.catalogue import REPRODUCTIONS
from drake_tc.diagrams.papers.delprete2016 import beyond
from drake_tc.diagrams.papers.delprete2016.beyond import Run
from drake_tc.diagrams.papers.expected_values import expectations
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import ModelFactors
from drake_tc.loops.torque.running import build_loop, simulate_scenario
from drake_tc.loops.torque.stages import actuator_models, loop_robot
from drake_tc.registry import diagram_entry
from drake_tc.report.figure_row import evaluated

ENTRY = diagram_entry("hrp2_leg")
QUICK = (
    "{duration: 0.75, tare: 0.05, guard: {start_time: 0.1}, motion: {times: [0.15, 0.5, 0.9, 1.35]}, gains: {k6: 0.1}}"
)


def rms(recording):
    late = recording.time > 0.15
    return np.sqrt(np.mean(recording.tracking_error[late] ** 2, axis=0))


def test_soft_torque_control_tracks_better_than_the_servo_on_every_joint():
    """The first half of a swing, K6 = 0.1: the paper loses on all but the knee."""
    torque = simulate_scenario(ENTRY.scenario("predicted_swing", text=QUICK))
    servo = simulate_scenario(replace(ENTRY.scenario("predicted_swing", text=QUICK), controller="servo"))
    assert np.all(rms(torque) < 0.7 * rms(servo))
    assert not torque["flags"].any()
    # the observer names the friction: its sign is that of the motion where the joint is fast
    knee = torque.robot.joints.index("r_knee")
    fast = np.abs(torque.velocity[:, knee]) > 0.5
    assert np.all(torque["disturbance"][fast, knee] * torque.velocity[fast, knee] > 0.0)


def test_a_leg_under_a_swinging_waist():
    """0.3 s of the suspended scenario: its base moves, its torques are estimated as the plant has them."""
    text = "{duration: 0.3, tare: 0.02, guard: {start_time: 0.05}, log_truth: true,"
    text += " pushes: [{link: waist, begin: 0.0, duration: 0.3, force: [150.0, 80.0, 0.0]}]}"
    recording = simulate_scenario(ENTRY.scenario("suspended_swing", text=text))
    assert all(np.isfinite(values).all() for values in recording.signals.values())
    base = recording["base_state"]
    assert base.shape == (301, 13)  # quaternion, position, velocities
    assert np.ptp(base[:, 4]) > 0.01 and np.abs(base[:, 7:10]).max() > 0.05
    assert np.abs(recording.tracking_error).max() < 0.01
    late = recording.time > 0.15
    ticks = 41
    error = recording["estimated_torque"][ticks:] - recording["joint_torque"][:-ticks]
    assert np.abs(error[late[:-ticks]]).max() < 0.05 * np.ptp(recording["joint_torque"], axis=0).max()
    assert not recording["flags"].any()


def test_a_scenario_without_them_builds_no_such_stages():
    plain = build_loop(ENTRY.scenario("stairs_swing")).diagram
    assert not any(plain.HasSubsystemNamed(name) for name in ("disturbance_observer", "delay_predictor", "live_torque"))
    both = build_loop(ENTRY.scenario("predicted_swing")).diagram
    assert all(both.HasSubsystemNamed(name) for name in ("disturbance_observer", "delay_predictor", "live_torque"))
    filtered = build_loop(ENTRY.scenario("predicted_swing", text="{observer: {torque: filtered}}")).diagram
    assert filtered.HasSubsystemNamed("reference_filter") and not filtered.HasSubsystemNamed("live_torque")


def test_model_factors_change_the_controllers_model_alone():
    scenario = replace(ENTRY.scenario("stairs_swing"), model_factors=ModelFactors(k_tau=0.8, k_v=1.2))
    robot = loop_robot(scenario)
    right = actuator_models(ENTRY.scenario("stairs_swing"), robot, controller=True)
    wrong = actuator_models(scenario, robot, controller=True)
    for joint, model in wrong.items():
        k_v = [m.drive.gain * m.effects[0].parameters["viscous"] for m in (model, right[joint])]
        assert_allclose(model.drive.gain, 0.8 * right[joint].drive.gain)
        assert_allclose(k_v[0], 1.2 * k_v[1])
    assert actuator_models(scenario, robot) == actuator_models(ENTRY.scenario("stairs_swing"), robot)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("stairs_swing", "{predictor: {}}", "rotor_inertia: expected that of 'r_hip_yaw'"),
        ("stairs_swing", "{observer: {}, rotor_inertia: {knee: 1.0}}", "rotor_inertia: no joint 'knee'"),
        ("stairs_swing", "{observer: {bandwith: 1.0}}", r"observer: unknown key 'bandwith'; did you mean 'bandwidth'"),
        ("stairs_swing", "{predictor: {bandwidth: -1.0}}", r"predictor\.bandwidth: expected a positive number"),
        ("stairs_swing", "{model_factors: {k_tau: 0.0}}", "model_factors.k_tau: expected a positive number"),
        ("suspended_swing", "{angular_acceleration: zero}", "angular_acceleration: expected gyro or neglected"),
        ("suspended_swing", "{suspension: {stiffness: [1.0, 1.0]}}", r"suspension\.stiffness: expected three"),
        ("suspended_swing", "{suspension: {stiffness: [1.0, 1.0, 0.0]}}", "a positive one along z"),
    ],
)
def test_refusals(name, text, message):
    with pytest.raises(ParamsError, match=message):
        build_loop(ENTRY.scenario(name, text=text))


def known_runs(**changed):
    """Every run of A.beyond with round numbers: servo 2 mrad, without 1 (stiff) and 10 (soft), with 0.4 throughout."""
    names = [name for name, _, _ in beyond.scenarios(0)]
    value = {"servo": 2e-3, "without, K6 = 1": 1e-3, "without, K6 = 0.1": 1e-2}
    runs = {}
    for name in names:
        rms_error = next((v for ending, v in value.items() if name.endswith(ending)), 4e-4)
        runs[name] = Run(("a", "b"), np.full(2, rms_error), np.full(2, 0.1), np.full(2, 10.0), 0)
    return runs | changed


def test_the_rows_are_ratios_of_known_runs():
    wrong = [name for name, _ in beyond.variants(ENTRY.scenario("predicted_swing"))]
    values = beyond.figures(known_runs(), 0, wrong)
    assert_allclose(values["squared error ratio, K6 = 0.1, a"], 25.0)
    assert_allclose(values["without over with, K6 = 1, b"], 2.5)
    assert_allclose(values["worst ratio, K6 = 0.1, K_tau x 0.8, K_v x 1.2"], 25.0)
    assert_allclose(values["suspended, torque error over that of the fixed base, worst joint"], 1.0)
    lame = Run(("a", "b"), np.array([4e-4, np.nan]), np.ones(2), np.ones(2), 3)  # a joint that ran away
    values = beyond.figures(known_runs(**{"rotors x 2": lame}), 0, wrong)
    assert np.isnan(values["worst ratio, K6 = 0.1, rotors x 2"])
    assert values["ticks with a flag or with the guard out of its normal mode"] == 3.0


def test_every_expected_row_is_computed():
    values = beyond.figures(known_runs(), 0, [name for name, _ in beyond.variants(ENTRY.scenario("predicted_swing"))])
    joints = loop_robot(ENTRY.scenario("predicted_swing")).joints
    values |= {
        f"{row}, {joint}": 1.0
        for row in ("squared error ratio, K6 = 0.1", "without over with, K6 = 1")
        for joint in joints
    }
    values["force error without over with, K6 = 0.1"] = 1.0
    assert all(
        row.expected is not None for row in evaluated(values, expectations("a_beyond")) if row.name.endswith("r_knee")
    )
    assert "A.beyond" in REPRODUCTIONS
