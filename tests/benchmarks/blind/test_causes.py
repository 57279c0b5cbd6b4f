"""Each cause leaves the trace in the torque balance that its definition says, and as strong as was asked."""

import numpy as np
import pytest

from drake_tc.joint_simulator.amplitudes import AMPLITUDES
from drake_tc.joint_simulator.measurement import clean_log
from drake_tc.joint_simulator.physics import TERMS, simulate
from tests.benchmarks.blind.calibrate import calibrate
from tests.benchmarks.blind.catalogue import caused_rig
from tests.benchmarks.blind.truth import unmodelled_torque

from .make import Traces, rig, traces_of

RIGS = {
    "deadzone": rig({"deadzone": {"width": 3.0}}),
    "saturation": rig({"saturation": {"limit": 30.0}}, "voltage"),
    "effort_delay": rig({"delay": {"delay": 4e-3}}, "current"),
    "command_delay": rig({"delay": {"delay": 5e-3}}),
    "current_lag": rig({"current_lag": {"time": 0.01}}, "voltage"),
    "cable_spring": rig({"cable_spring": {"stiffness": 3.0, "rest": 0.1}}),
    "torque_ripple": rig({"torque_ripple": {"amplitude": 1.1, "count": 60.0, "phase": 0.7}}),
    "rotor_inertia": rig({"rotor_inertia": {"inertia": 0.36}}),
    "payload": rig({"payload": {"mass": 1.0, "arm": 0.4}}),
    "torque_sensor_gain": rig({"torque_sensor_gain": {"error": 0.1}}),
    "encoder_eccentricity": rig({"encoder_eccentricity": {"amplitude": 2e-4, "phase": 0.4}}),
    "load_dependent_friction": rig({"load_dependent_friction": {"mu": 0.2}}),
}


@pytest.fixture(scope="module")
def traces() -> Traces:
    return traces_of(RIGS)


def test_every_cause_can_be_simulated_and_drawn() -> None:
    assert set(AMPLITUDES) == set(TERMS) - {"command_delay", "effort_delay"}


def test_dead_zone_takes_its_width(traces: Traces) -> None:
    _, log, u = traces["deadzone"]
    np.testing.assert_allclose(u, np.clip(log.effort / 1.5e-4, -3.0, 3.0), atol=1e-8)


def test_saturation_takes_what_is_above_the_limit(traces: Traces) -> None:
    _, log, u = traces["saturation"]
    y = log.effort / 0.4
    np.testing.assert_allclose(u, y - np.clip(y, -30.0, 30.0), atol=1e-8)


def test_effort_delay_is_the_effort_now_less_the_effort_then(traces: Traces) -> None:
    _, log, u = traces["effort_delay"]
    y = log.effort / 0.08
    np.testing.assert_allclose(u[10:], y[10:] - y[6:-4], atol=1e-7)


def test_command_delay_is_the_command_now_less_the_command_then(traces: Traces) -> None:
    _, log, u = traces["command_delay"]
    np.testing.assert_allclose(u[10:], (log.command[10:] - log.command[5:-5]) / 1.5e-4, atol=1e-6)


def test_current_lag_obeys_its_differential_equation(traces: Traces) -> None:
    """T dtau_m/dt = y/K - tau_m, and u = y/K - tau_m: so T d(y/K - u)/dt = u."""
    _, log, u = traces["current_lag"]
    motor = log.effort / 0.4 - u
    np.testing.assert_allclose(0.01 * np.gradient(motor, 1e-3)[5:-5], u[5:-5], atol=0.05 * np.std(u))


def test_spring_ripple_and_inertia_are_functions_of_the_motion(traces: Traces) -> None:
    _, log, u = traces["cable_spring"]
    np.testing.assert_allclose(u, 3.0 * (log.position - 0.1), atol=1e-8)
    _, log, u = traces["torque_ripple"]
    np.testing.assert_allclose(u, 1.1 * np.sin(60.0 * log.position + 0.7), atol=1e-8)
    _, log, u = traces["rotor_inertia"]
    np.testing.assert_allclose(u, 0.36 * log.acceleration, atol=1e-8)


def test_sensor_causes_are_what_the_sensor_misses(traces: Traces) -> None:
    record, log, u = traces["payload"]
    q, a = record.channels["position"], record.channels["acceleration"]
    np.testing.assert_allclose(u, 0.4 * 9.81 * np.sin(q) + 0.16 * a, atol=1e-8)
    record, log, u = traces["torque_sensor_gain"]
    np.testing.assert_allclose(u, -0.1 * record.channels["torque"], atol=1e-8)
    record, log, u = traces["encoder_eccentricity"]
    np.testing.assert_allclose(log.velocity, np.gradient(log.position, 1e-3), atol=0.02)


def test_an_eccentric_encoder_logs_the_derivatives_of_what_it_reads(traces: Traces) -> None:
    """Its error, as a function of time, differentiated twice by central differences."""
    record, log, _ = traces["encoder_eccentricity"]
    inner, step = slice(5, -5), log.time[1]
    error = log.position - record.channels["position"]
    for name in ("velocity", "acceleration"):
        error = np.gradient(error, step)
        logged = getattr(log, name) - record.channels[name]
        left = np.std((logged - error)[inner])
        assert left < 0.02 * np.std(error[inner]), name  # the step of 1 ms smears reversals


def test_load_dependent_friction_grows_with_the_transmitted_torque(traces: Traces) -> None:
    record, _, u = traces["load_dependent_friction"]
    expected = 0.2 * np.abs(record.channels["torque"]) * record.channels["bristle"]
    # atol: the torque of one step (0.1 ms) before
    np.testing.assert_allclose(u, expected, atol=0.05)


@pytest.mark.slow
def test_calibrated_strengths_are_as_wanted() -> None:
    """RMS over moving samples after projecting out torque balance, velocity and its sign, by normal equations."""
    effects = ("stribeck", "cable_spring", "torque_ripple", "thermal_friction", "deadzone", "backlash")
    specs = calibrate([caused_rig((effect,), "single", "middle", 0, 3) for effect in effects])
    runs = ["sine", "multisine"]
    records = simulate([spec for spec in specs for _ in runs], runs * len(specs))
    for k, spec in enumerate(specs):
        rows, values = [], []
        for record in records[2 * k : 2 * k + 2]:
            log = clean_log(record)
            moving = np.abs(log.velocity) > 0.02
            load = log.torque + spec.joint.rotor_inertia * log.acceleration
            rows.append(np.stack([load, log.velocity, np.sign(log.velocity)])[:, moving])
            values.append(unmodelled_torque(record, log)[moving])
        design, u = np.concatenate(rows, axis=1), np.concatenate(values)
        left = u - design.T @ np.linalg.solve(design @ design.T, design @ u)
        # 15 %: calibration stops at 7 %, from a coarser step, and sign(v) is not the bristle
        np.testing.assert_allclose(np.sqrt(np.mean(left**2)), spec.targets[spec.kind], rtol=0.15, err_msg=spec.kind)
