"""Outside causes leave the trace in the torque balance that their definition says, and no library explains it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from drake_tc.joint_simulator.measurement import CleanLog, clean_log
from drake_tc.joint_simulator.physics import simulate
from drake_tc.joint_simulator.reference import BandNoise, random_instants, random_walk
from tests.benchmarks.blind.catalogue import caused_rig
from tests.benchmarks.blind.truth import unmodelled_torque
from tests.benchmarks.blind.verdicts import OUTSIDE, RIGHT_VERDICTS, right_verdicts

from .make import Traces, rig, traces_of

TOUCH = {"amplitude": 4.0, "start": 0.5, "length": 2.0, "only_run": 2.0}
RIGS = {
    "random_disturbance": rig({"random_disturbance": {"amplitude": 2.0, "noise_seed": 11.0}}),
    "long_touch": rig({"long_touch": TOUCH}),
    "other_run": rig({"long_touch": TOUCH | {"only_run": 1.0}}),
    "wandering_sensor": rig({"wandering_sensor": {"walk": 3.0, "noise_seed": 12.0}}),
    "end_stop": rig({"end_stop": {"stiffness": 60.0, "stop": 0.3, "side": -1.0, "time": 0.1}}),
    "load_times_speed": rig({"load_times_speed": {"slope": 0.3}}),
    "drive_dropout": rig({"drive_dropout": {"share": 0.4, "length": 0.1, "noise_seed": 13.0}}, "voltage"),
    "friction_jump": rig({"friction_jump": {"share": 0.6, "start": -4.5}}),
}


@pytest.fixture(scope="module")
def traces() -> Traces:
    return traces_of(RIGS)


def test_random_disturbance_has_its_rms_and_band(traces: Traces) -> None:
    """The term is a torque on the joint: u is the noise itself, at any step of the integration."""
    _, _, u = traces["random_disturbance"]
    other = simulate([RIGS["random_disturbance"]], ["multisine"], 2e-4)[0]
    np.testing.assert_allclose(u, unmodelled_torque(other, clean_log(other)), atol=1e-8)
    noise = BandNoise.draw([[1], [2]], 1.0, 5.0)
    time = np.arange(0.0, 400.0, 0.02)
    values = noise.over(time)
    np.testing.assert_allclose(np.sqrt(np.mean(values**2)), 1.0, rtol=0.05)  # 400 s of 120 tones
    power = np.abs(np.fft.rfft(values * np.hanning(time.size))) ** 2
    frequency = np.fft.rfftfreq(time.size, 0.02)
    inside = (frequency > 0.98) & (frequency < 5.02)
    assert power[inside].sum() > 0.9999 * power.sum()
    one_run = np.abs(np.fft.rfft(noise.over(np.arange(0.0, 30.0, 0.02)))) ** 2
    assert one_run.max() < 0.1 * one_run.sum()  # broad: over a run of 30 s no line stands out
    np.testing.assert_allclose(noise.at(3.2)[0], noise.over(np.array([3.2]))[0], rtol=1e-12)
    other_values = BandNoise(noise.frequency_hz[1:], noise.phase[1:]).over(time)
    assert abs(np.mean(values * other_values)) < 0.05  # independent seeds


def test_random_walk_is_brownian() -> None:
    """Var W(t) = t and Cov(W(s), W(t)) = min(s, t), over 4000 draws; W(0) = 0 exactly."""
    time = np.array([0.0, 5.0, 12.0, 30.0])
    walks = np.stack([random_walk(time, 30.0, [seed]) for seed in range(4000)])
    np.testing.assert_allclose(walks[:, 0], 0.0, atol=1e-12)
    covariance = walks[:, 1:].T @ walks[:, 1:] / 4000
    # the standard error of a variance over 4000 draws is 2.2 %
    np.testing.assert_allclose(covariance, np.minimum.outer(time[1:], time[1:]), rtol=0.08)
    np.testing.assert_array_equal(random_walk(time, 30.0, [3]), random_walk(time, 30.0, [3]))


def test_wandering_sensor_is_what_the_sensor_adds(traces: Traces) -> None:
    record, log, u = traces["wandering_sensor"]
    np.testing.assert_allclose(u, record.channels["torque"] - log.torque, atol=1e-8)
    np.testing.assert_allclose(u[0], 0.0, atol=1e-8)
    # the step of the walk over 0.5 s has the standard deviation 3 sqrt(0.5/30) = 0.39 N m; it never jumps
    assert 0.02 < np.std(u) < 3.0
    assert np.max(np.abs(np.diff(u))) < 0.2


def test_long_touch_lasts_its_time_in_one_run(traces: Traces) -> None:
    _, log, u = traces["long_touch"]
    before, during = log.time < 0.5, (log.time > 0.8) & (log.time < 2.2)
    np.testing.assert_allclose(u[before | (log.time > 2.5)], 0.0, atol=1e-8)
    np.testing.assert_allclose(u[during], 4.0, atol=1e-8)
    np.testing.assert_allclose(traces["other_run"][2], 0.0, atol=1e-8)


def test_end_stop_pushes_at_one_end(traces: Traces) -> None:
    _, log, u = traces["end_stop"]
    assert (log.position < -0.35).any() and (log.position > 0.35).any()
    depth = -log.position - 0.3
    expected = np.where(depth > 0.0, -60.0 * np.maximum(depth - 0.1 * log.velocity, 0.0), 0.0)
    np.testing.assert_allclose(u, expected, atol=1e-8)
    assert np.max(u) <= 1e-8  # the stop pushes, it never pulls
    assert np.any((depth > 0.0) & (np.abs(u) < 1e-8))  # it lets go while the joint leaves it fast


def test_load_times_speed_takes_power(traces: Traces) -> None:
    record, log, u = traces["load_times_speed"]
    # atol: the torque of one step (0.1 ms) before
    np.testing.assert_allclose(u, 0.3 * np.abs(record.channels["torque"]) * log.velocity, atol=0.1)
    assert np.min(u * log.velocity) >= -1e-9


def test_drive_dropout_takes_a_share_for_its_length(traces: Traces) -> None:
    _, log, u = traces["drive_dropout"]
    motor = log.effort / 0.4
    out = np.abs(u) > 1e-6 * np.abs(motor)
    np.testing.assert_allclose(u[out], 0.4 * motor[out], atol=1e-8)
    start = random_instants([13, 2], 12, 2.5)
    expected = ((log.time[:, None] >= start) & (log.time[:, None] < start + 0.1)).any(axis=1)
    assert abs(int(out.sum()) - int(expected.sum())) <= 2  # the sample at either edge
    assert 100 <= expected.sum() <= 202


def test_friction_jumps_once(traces: Traces) -> None:
    """In the multisine (run 2) the instant is start + 6 s = 1.5 s."""
    record, log, u = traces["friction_jump"]
    np.testing.assert_allclose(u[log.time < 1.5], 0.0, atol=1e-8)
    late = log.time > 1.53
    np.testing.assert_allclose(u[late], -0.6 * 4.0 * record.channels["bristle"][late], atol=1e-8)


def test_every_outside_cause_knows_its_right_verdict() -> None:
    assert set(OUTSIDE) == set(RIGHT_VERDICTS) and len(OUTSIDE) >= 10
    for kind in OUTSIDE:
        spec = caused_rig((kind,), "outside", "outside", 0, 0)
        assert set(right_verdicts(spec)) <= {"unexplained_structure", "unexplained_residual"}
    assert right_verdicts(caused_rig(("random_disturbance",), "outside", "outside", 0, 0)) == ["unexplained_residual"]
    assert right_verdicts(rig({"stribeck": {}})) == ["effects_found"]


def library_columns(log: CleanLog, balance: np.ndarray) -> np.ndarray:
    """(T, p) what a library of friction, load, drive and sensor effects can add: a wide linear dictionary.

    It has the expected torque and not the effort itself: the two together balance whatever is missing.
    """
    q, v, s, tau = log.position, log.velocity, log.bristle, log.torque
    one = np.ones_like(q)
    drive = np.sign(log.effort), np.gradient(log.command, 1e-3), np.gradient(log.effort, 1e-3)
    stribeck = [s * np.exp(-np.abs(v / speed)) for speed in (0.05, 0.2, 0.8)]
    columns = [balance, tau, v, s, np.abs(tau) * s, np.abs(v) * v, np.abs(v), q, one, np.cos(q), np.sin(q)]
    columns += [s * log.effort, log.time, log.time * s, log.time * v, log.acceleration, *drive, *stribeck]
    knots = np.concatenate([np.full(3, q.min()), np.linspace(q.min(), q.max(), 5), np.full(3, q.max())])
    curve = BSpline.design_matrix(np.clip(q, q.min(), q.max() - 1e-12), knots, 3).toarray()
    return np.concatenate([np.stack(columns, axis=1), curve], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", OUTSIDE)
def test_a_library_of_effects_leaves_most_of_an_outside_cause(kind: str) -> None:
    """More than ten noise floors (0.1 N m) are left after all of it is fitted to the noise-free run."""
    run = "sine" if kind == "touch" else "multisine"
    spec = caused_rig((kind,), "outside", "outside", 0, 3)
    causes = {kind: dict(spec.causes[kind])}
    if "only_run" in causes[kind]:
        causes[kind] |= {"only_run": float(("static", "sine", "multisine").index(run))}
    if "start" in causes[kind]:
        causes[kind] |= {"start": 6.0}
    spec = replace(spec, causes=causes, duration=20.0, name=kind)
    record = simulate([spec], [run], 2e-4)[0]
    log = clean_log(record)
    u = unmodelled_torque(record, log)
    moving = np.abs(log.velocity) > 0.02
    design = library_columns(log, log.torque + spec.declared_inertia * log.acceleration)[moving]
    scaled = design / np.sqrt(np.mean(design**2, axis=0))
    left = u[moving] - scaled @ np.linalg.lstsq(scaled, u[moving], rcond=None)[0]
    assert np.sqrt(np.mean(left**2)) > 0.3, f"{np.std(u[moving]):.2f} N m, of which {np.std(left):.2f} are left"
