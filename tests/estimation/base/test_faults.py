"""Faulty sensors: the estimate gets worse by little, says so, and stays finite whatever comes in."""

from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_tc.estimation.base_estimator import CopEstimator
from drake_tc.estimation.base_kinematics import CONTACT_FLAGS, FLAGS, SCALARS, Sample
from drake_tc.estimation.base_log import run_log, track_error

from .constructed import REAL, Motion, construct, spec, walker

PERIOD = 5e-3


@pytest.fixture(scope="module")
def standing():
    """Two feet on the ground all the time, 3.4 s."""
    return construct(Motion(duration=3.4, period=PERIOD), REAL, seed=11)


@pytest.fixture(scope="module")
def stepping():
    """The left foot in the air from 1.5 to 2.5 s."""
    return construct(Motion(duration=3.2, period=PERIOD, lift=(0, 1.5, 2.5)), REAL, seed=12)


@pytest.fixture(scope="module")
def estimator():
    return CopEstimator(walker(), spec(PERIOD))


def run(estimator, made, log):
    track = run_log(estimator, log, made.truth.position[0], made.truth.rpy[0, 2])
    return track, track_error(track, made.truth)


def raised(track):
    return {name for i, name in enumerate(FLAGS) if track.flags[:, i].any()}


def of_contact(track, contact, name):
    return track.contact_flags[:, contact, CONTACT_FLAGS.index(name)]


def test_without_a_fault_nothing_is_said(estimator, standing, stepping):
    for made in (standing, stepping):
        track, error = run(estimator, made, made.log)
        assert raised(track) == set()
        assert not of_contact(track, 0, "slip").any()
        assert not of_contact(track, 0, "force_offset").any()
        assert np.linalg.norm(error.position) < 2e-3


def test_a_contact_lost_without_notice(estimator, stepping):
    """The sensor hangs at what it read while the foot leaves the ground: the foot is seen to move."""
    log = stepping.log
    hung = log.wrench.copy()
    at = int(np.searchsorted(log.time, 1.2))
    hung[at:, 0] = hung[at, 0]
    track, error = run(estimator, stepping, replace(log, wrench=hung))
    flying = (log.time > 1.7) & (log.time < 2.3)
    assert of_contact(track, 0, "slip")[flying].mean() > 0.8
    assert "load_mismatch" in raised(track)
    assert np.linalg.norm(error.position) < 3e-3  # the foot moves by 50 mm
    assert np.degrees(error.angle[2]) < 1.0


@pytest.mark.parametrize("axis", [0, 2])
def test_ten_newtons_too_much(estimator, standing, stepping, axis):
    for made in (standing, stepping):
        off = made.log.wrench.copy()
        off[:, 0, axis] += 10.0
        track, error = run(estimator, made, replace(made.log, wrench=off))
        assert np.linalg.norm(error.position) < 2e-3
        if axis == 2:
            assert "load_mismatch" in raised(track)
    if axis == 2:
        assert of_contact(track, 0, "force_offset").any()  # of the foot in the air
        assert not of_contact(track, 1, "force_offset").any()


def test_a_gyro_that_starts_to_drift_by_a_degree_a_second(estimator, standing):
    log = standing.log
    drift = np.where(log.time > 1.0, np.radians(1.0), 0.0)[:, None] * [0.0, 0.0, 1.0]
    track, error = run(estimator, standing, replace(log, gyro=log.gyro + drift))
    assert "yaw_drift" in raised(track)
    yaw = np.degrees(track.rpy[:, 2] - standing.truth.rpy[:, 2])
    assert np.abs(yaw).max() < 0.7  # of 2.4 degrees, and falling again
    assert abs(yaw[-1]) < 0.8 * np.abs(yaw).max()
    assert np.linalg.norm(error.position) < 3e-3


def test_encoder_spikes_are_not_believed(estimator, standing):
    rng = np.random.default_rng(3)
    log = standing.log
    hit = rng.random(log.q.shape) < 1e-3
    hit[0] = False
    q, qd = log.q.copy(), log.qd.copy()
    q[hit] += rng.choice([-0.3, 0.3, 1.0], hit.sum())
    both = hit | np.roll(hit, 1, axis=0)
    qd[both] += rng.choice([-100.0, 100.0], both.sum())  # as differences of the spikes would be
    track, error = run(estimator, standing, replace(log, q=q, qd=qd))
    assert "encoder_spike" in raised(track)
    assert np.linalg.norm(error.position) < 2e-3
    assert np.abs(track.velocity - standing.truth.velocity)[3:].max() < 0.05


def test_an_encoder_that_insists_is_believed(estimator, standing):
    """A step that stays (a joint moved while the log was off) is taken over after five ticks."""
    log = standing.log
    wrist = walker().joints.index("r_wrist_yaw")
    q = log.q.copy()
    q[240:, wrist] += 0.5
    track, error = run(estimator, standing, replace(log, q=q))
    told = track.flags[:, FLAGS.index("encoder_spike")]
    assert 4 <= told.sum() <= 7
    assert np.linalg.norm(error.position) < 2e-3


@pytest.mark.parametrize(
    ("name", "flag", "worst"),
    [
        ("gyro", "imu_missing", 4e-3),
        ("accel", "imu_missing", 2e-3),
        ("tilt", None, 8e-3),
        ("q", "encoder_missing", 8e-3),
        ("wrench", "wrench_missing", 8e-3),
    ],
)
def test_a_sensor_that_is_silent_for_a_tenth_of_a_second(estimator, standing, name, flag, worst):
    log = standing.log
    quiet = getattr(log, name).copy()
    quiet[400:420] = np.nan
    track, error = run(estimator, standing, replace(log, **{name: quiet}))
    if flag is not None:
        seen = track.flags[:, FLAGS.index(flag)]
        assert seen[400:420].all()
        assert not seen[:400].any()
    assert np.linalg.norm(error.position) < worst
    assert np.isfinite(track.velocity).all()


def test_when_everything_falls_silent_the_base_is_held(estimator, standing):
    log = standing.log
    cut = {}
    for item in fields(log):
        if item.name not in ("time", "switch"):
            values = getattr(log, item.name).copy()
            values[400:] = np.nan
            cut[item.name] = values
    track, _ = run(estimator, standing, replace(log, **cut))
    assert {"no_contact", "encoder_missing", "imu_missing", "wrench_missing"} <= raised(track)
    assert np.isfinite(track.position).all()
    assert np.linalg.norm(track.position[-1] - track.position[404]) < 1e-3
    assert np.abs(track.velocity[408:]).max() < 1e-9


@lru_cache(maxsize=1)
def _estimator():
    return CopEstimator(walker(), spec(PERIOD))


numbers = st.one_of(
    st.just(0.0), st.floats(-50.0, 50.0), st.sampled_from([np.nan, np.inf, -np.inf, 1e9, -1e300, 1e300, 1e5])
)


@settings(max_examples=30, deadline=None)
@given(st.lists(numbers, min_size=20, max_size=20), st.integers(0, 2**31))
def test_whatever_comes_in_nothing_raises_and_nothing_but_numbers_comes_out(values, seed):
    estimator = _estimator()
    rng = np.random.default_rng(seed)
    n, k = estimator.num_joints, estimator.num_contacts
    state = estimator.initial_state(np.zeros(3), 0.0)
    for _ in range(4):

        def draw(*shape):
            return rng.choice(values, size=shape)

        sample = Sample(draw(n), draw(n), draw(6), draw(2), draw(6 * k), rng.choice([0.0, 1.0, -1.0], size=k))
        state = estimator.step(state, sample)
        for name, part in state._asdict().items():
            known = np.delete(part, SCALARS.index("ground")) if name == "scalars" else part
            assert np.isfinite(known).all(), name
