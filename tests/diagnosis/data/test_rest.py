"""A position sensor that wanders: what it shows of a joint at rest is no motion."""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.diagnosis.data.sliding import direction_of_motion, speed_at_rest
from drake_tc.types import FloatArray

PERIOD, COUNT = 1e-3, 30_000
TIME = PERIOD * np.arange(COUNT)
WHOLE = [slice(0, COUNT)]
WANDER = 4e-4


def wander() -> FloatArray:
    """Noise between 1 and 5 Hz with a standard deviation of 0.4 mrad (T,)."""
    white = np.random.default_rng(3).normal(size=COUNT)
    noise = sosfiltfilt(butter(2, (1.0, 5.0), "bandpass", fs=1.0 / PERIOD, output="sos"), white)
    return np.asarray(WANDER * noise / noise.std())


def steps_and_rests() -> FloatArray:
    """Strokes of 0.4 rad in 1 s, with rests of 2 s between them (T,)."""
    phase = np.clip(np.mod(TIME, 6.0), 0.0, 1.0) - np.clip(np.mod(TIME, 6.0) - 3.0, 0.0, 1.0)
    return np.asarray(0.2 * (1.0 - np.cos(np.pi * phase)))


def test_the_speed_at_rest_is_that_of_the_noise():
    noise = wander()
    q = steps_and_rests() + noise
    found = speed_at_rest(q, np.gradient(q, PERIOD), WHOLE, PERIOD)
    of_noise = np.gradient(noise, PERIOD).std()  # the trend within half a second is not counted
    assert 0.5 * of_noise < found < 1.05 * of_noise


def test_a_joint_at_rest_does_not_slide_though_its_sensor_wanders():
    noise = wander()
    q = steps_and_rests() + noise
    v = np.gradient(q, PERIOD)
    at_rest = speed_at_rest(q, v, WHOLE, PERIOD)
    still = np.gradient(steps_and_rests(), PERIOD) == 0.0
    share = []
    for speed in (0.0, at_rest):
        resolution = Resolution(0.0, 1e-6, 0.1, 1e-4, speed_at_rest=speed)
        moving = direction_of_motion(q, v, WHOLE, resolution)[2]
        share.append(np.mean(moving[still]))
    assert share[0] > 0.02
    assert share[1] < 0.1 * share[0]


def test_a_slow_reversal_is_no_rest():
    """Reversals of 4 mrad within half a second, with white noise that turns the velocity's sign many times."""
    v = 0.06 * np.sin(2 * np.pi * 0.3 * TIME) + np.random.default_rng(5).normal(0.0, 1e-3, COUNT)
    q = np.cumsum(v) * PERIOD
    assert speed_at_rest(q, v, WHOLE, PERIOD) < 2.5e-3


def test_a_joint_that_always_moves_shows_nothing():
    q = 0.8 * np.sin(2 * np.pi * 0.5 * TIME)
    assert speed_at_rest(q, np.gradient(q, PERIOD), WHOLE, PERIOD) == 0.0


def test_what_is_left_of_the_motion_stays_resolved():
    """A vibration that is as fast as the strokes does not make all of them unresolved."""
    q = 0.3 * (1.0 - np.cos(0.2 * TIME)) + 1e-3 * np.sin(2 * np.pi * 30.0 * TIME)
    v = np.gradient(q, PERIOD)
    assert speed_at_rest(q, v, WHOLE, PERIOD) <= 0.02 * np.percentile(np.abs(v), 95.0)


def test_a_joint_whose_bristles_spring_back_at_rest_does_not_slide():
    """It moves, rests while the torque turns, gives way by 0.1 mrad against its last direction, and moves on.

    Until it has moved by 1 mrad again it only winds up.
    """
    resolution = Resolution(0.0, 1e-6, 0.1, 1e-4)
    v = np.full(4000, -0.02)
    v[1000:1300] = 3.5e-4  # below the resolved speed, and above a fifth of it
    v[1300:1400] = -1e-3  # the torque rises until the joint breaks away
    q = np.cumsum(v) * PERIOD
    assert 0.2 * resolution.least_speed < 3.5e-4 < resolution.least_speed < 1e-3
    moving = direction_of_motion(q, v, [slice(0, 4000)], resolution)[2]
    assert not moving[1300:1400].any()
    assert moving[:1000].any()
    assert moving[1500:].all()
