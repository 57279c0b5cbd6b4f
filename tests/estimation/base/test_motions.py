"""Along motions of a 30-joint humanoid whose truth is known: feet that tilt, roll, turn and slide."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sweeps import slow_but

from drake_tc.estimation.base_estimator import CopEstimator, FootCentreEstimator, FootCentreImuEstimator
from drake_tc.estimation.base_log import run_log, track_error

from .constructed import REAL, Motion, construct, spec, walker

PERIOD = 5e-3


def motion(**changes):
    return Motion(**{"duration": 3.0, "period": PERIOD, **changes})


def estimated(made, method=CopEstimator, log=None, **tuning):
    track = run_log(
        method(walker(), spec(PERIOD, **tuning)), log or made.log, made.truth.position[0], made.truth.rpy[0, 2]
    )
    return track, track_error(track, made.truth)


def size(error):
    return np.array([np.linalg.norm(error.position), np.linalg.norm(error.velocity), error.angle[2]])


@pytest.fixture(scope="module")
def clean():
    return construct(motion())


@pytest.fixture(scope="module")
def noisy():
    return construct(motion(), REAL, seed=1)


def test_without_noise_the_truth_is_found(clean):
    """Feet tilt by 3 degrees and turn by 2; what is left is the tick's own error, of second order in 4 ms."""
    track, _ = estimated(clean)
    assert_allclose(track.position, clean.truth.position, atol=5e-4)
    assert_allclose(track.velocity[3:], clean.truth.velocity[3:], atol=5e-3)
    assert_allclose(track.rpy, clean.truth.rpy, atol=2e-3)
    loaded = track.pressure[5:]
    assert_allclose(loaded, clean.cop[5:], atol=2e-3)


@pytest.mark.slow
def test_the_foot_centre_chain_is_exact_while_feet_stand():
    """The baseline is no straw man: with feet that stay flat it is as good as its sensors."""
    made = construct(motion(tilt=0.0, pivot=0.0, cop=0.0))
    track, _ = estimated(made, FootCentreEstimator)
    assert_allclose(track.position, made.truth.position, atol=1e-6)
    assert_allclose(track.rpy, made.truth.rpy, atol=1e-6)
    assert_allclose(track.velocity[5:], made.truth.velocity[5:], atol=1e-4)


@pytest.mark.slow
def test_the_chain_with_the_imu_is_exact_while_feet_stand_and_knows_a_tilt_that_the_chain_alone_does_not():
    """Without noise; the IMU's roll and pitch are those of the base whatever the feet do."""
    made = construct(motion(tilt=0.0, pivot=0.0, cop=0.0))
    track, _ = estimated(made, FootCentreImuEstimator)
    assert_allclose(track.position, made.truth.position, atol=1e-5)
    assert_allclose(track.velocity[5:], made.truth.velocity[5:], atol=1e-3)
    tilting = construct(motion())
    plain, imu = (np.abs(estimated(tilting, kind)[0].rpy - tilting.truth.rpy).max(axis=0)
                  for kind in (FootCentreEstimator, FootCentreImuEstimator))  # fmt: skip
    assert (imu[:2] < 1e-6).all()
    assert plain[:2].max() > 0.02
    assert_allclose(imu[2], plain[2], atol=5e-3)


@pytest.mark.parametrize("frequency", slow_but((0.5, 1.0), 0.5))
def test_a_fifth_of_the_baselines_errors_in_a_turn(frequency, noisy):
    made = noisy if frequency == 0.5 else construct(motion(frequency=frequency), REAL, seed=2)
    ours, base = size(estimated(made)[1]), size(estimated(made, FootCentreEstimator)[1])
    assert (ours <= 0.2 * base).all(), ours / base


@pytest.mark.slow
def test_the_reference_rolls_with_the_foot():
    """The centre of pressure moves over a foot that has turned since it came down."""
    made = construct(motion(pivot=0.15, duration=2.5))
    rolling = size(estimated(made)[1])
    fixed = size(estimated(made, reference="touchdown")[1])
    assert rolling[0] < 0.2 * fixed[0]


@pytest.mark.slow
def test_feet_that_keep_turning_one_way_do_not_turn_the_world():
    made = construct(motion(creep=0.08), REAL, seed=3)
    ours, base = estimated(made)[1], estimated(made, FootCentreEstimator)[1]
    assert np.degrees(base.angle[2]) > 3.0
    assert (size(ours) <= 0.2 * size(base)).all()


@pytest.mark.parametrize("speed", slow_but((0.1, 0.3), 0.1))
def test_a_sliding_foot_is_left_out(speed):
    made = construct(motion(slip=(0, 1.8, 2.1, (speed, 0.3 * speed, 0.0)), duration=2.6), REAL, seed=4)
    track, error = estimated(made)
    during = (made.log.time > 1.85) & (made.log.time < 2.08)
    assert track.contact_flags[during, 0, 2].mean() > 0.9
    assert track.contact_flags[:, 1, 2].mean() < 0.01
    assert np.linalg.norm(error.position) < 2e-3  # of 30 and 90 mm
    blind = size(estimated(made, slip_speed=np.inf, slip_distance=np.inf, slip_turn=np.inf)[1])
    assert size(error)[0] < 0.2 * blind[0]


@pytest.mark.slow
def test_a_foot_that_slides_too_slowly_to_be_seen_costs_little():
    made = construct(motion(slip=(0, 1.5, 2.5, (0.03, 0.0, 0.0))), REAL, seed=5)
    track, error = estimated(made)
    assert track.flags[:, 7].any()  # inconsistent
    assert np.degrees(error.angle[2]) < 1.0
    blind = estimated(made, slip_distance=np.inf, slip_turn=np.inf)[1]
    assert error.angle[2] < 0.5 * blind.angle[2]


def test_a_step_and_a_level_ground():
    made = construct(motion(lift=(0, 1.5, 2.2), duration=2.6), REAL, seed=6)
    track, error = estimated(made, ground="level")
    assert np.linalg.norm(error.position) < 2e-3
    air = (made.log.time > 1.6) & (made.log.time < 2.1)
    assert not track.contact_flags[air, 0, 0].any()
    assert track.contact_flags[:, 1, 0].all()


def test_without_roll_and_pitch_the_gyro_and_the_accelerometer_give_them(noisy):
    blind = replace(noisy.log, tilt=np.full_like(noisy.log.tilt, np.nan))
    _, error = estimated(noisy, log=blind)
    assert (np.degrees(error.angle[:2]) < 0.5).all()
    assert np.linalg.norm(error.position) < 8e-3


def test_the_gyros_bias_is_learnt_at_rest():
    made = construct(motion(), replace(REAL, gyro_bias=(0.01, -0.01, 0.02)), seed=7)
    _, error = estimated(made)
    assert np.degrees(error.angle[2]) < 0.3
    assert made.log.time[-1] * np.degrees(0.02) > 3.0  # what it would have come to


def test_in_another_frame_of_the_world_it_is_the_same(clean):
    """The world's origin and heading are the user's: moved and turned, everything moves and turns along."""
    turn, shift = 0.9, np.array([3.0, -2.0, 1.0])
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    here, _ = estimated(clean)
    start = R @ clean.truth.position[0] + shift
    there = run_log(CopEstimator(walker(), spec(PERIOD)), clean.log, start, clean.truth.rpy[0, 2] + turn)
    assert_allclose(there.position, here.position @ R.T + shift, atol=1e-9)
    assert_allclose(there.rpy[:, 2], here.rpy[:, 2] + turn, atol=1e-9)
