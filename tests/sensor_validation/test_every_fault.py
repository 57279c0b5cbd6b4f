"""Every sensor of a joint, the IMU and the F/T sensors, under every fault: finite, flagged where that can be, bounded.

A late IMU or F/T sensor is the one that nothing on board contradicts within a few milliseconds: its readings are those
of the same motion, and the estimators that read both are told of a known latency only. What it costs is bounded by the
rate of the signal times the delay, which the tests show; late encoders and gauges are seen by the springs.
"""

import numpy as np
import pytest

from drake_tc.sensor_validation.body_sensors import SETTLED

from .test_body_sensors import DT, imu_run, standing_imu, standing_wrench, wrench_run
from .test_joint_sensors import NAMES, TIME, C, joints, readings, voted

BEGIN, TICKS, LATE = 300, 800, 20
FAULTS = ("frozen", "dropped", "nan", "spike", "bias", "late")


def failing(samples, channels, fault, size):
    """Samples (T, ...) whose channels (indices of the last axis) fail from `BEGIN` on."""
    failed = samples.copy()
    late = np.s_[BEGIN:, channels]
    if fault == "frozen":
        failed[late] = samples[BEGIN - 1, channels]
    elif fault in ("dropped", "nan"):
        failed[late] = np.nan
    elif fault == "spike":
        failed[BEGIN::17, channels] += size
    elif fault == "bias":
        failed[late] += size
    else:
        failed[late] = samples[BEGIN - LATE : len(samples) - LATE, channels]
    return failed


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("sensor", NAMES)
def test_a_joint_s_sensor_is_replaced_and_flagged(sensor, fault):
    truth, row = joints(TICKS * DT), NAMES[sensor]
    sound = readings(truth)
    y = sound.copy()
    y[:, row] = failing(sound[:, row], [0], fault, {"gauge": 5.0}.get(sensor, 0.05))
    votes, given = voted(y)
    assert np.isfinite(given).all()
    flagged = [k for k, vote in enumerate(votes) if (vote.missing | vote.frozen | vote.odd)[row, 0]]
    assert flagged and BEGIN <= flagged[0] <= BEGIN + 50
    worst = np.abs(given[BEGIN:, :, 0] - truth[BEGIN:, :, 0]).max(axis=0)
    assert (worst * [1.0, C[0], 1.0] < 0.012).all()  # rad, of which 5 % of the deflection is not told
    assert TIME.size == 2


IMU_SIZES = {"spike": 3.0, "bias": 3.0}


def moving_imu():
    """A trunk that sways: 0.4 rad/s and 1 m/s^2 at 2 Hz, on gravity and noise."""
    t = DT * np.arange(TICKS)[:, None]
    return standing_imu(TICKS) + np.sin(4.0 * np.pi * t) * np.array([0.4, 0.2, 0.1, 1.0, 0.5, 0.2])


@pytest.mark.parametrize("fault", FAULTS)
def test_an_imu_gives_nan_or_what_is_near_the_truth(fault):
    """NaN is what the base estimator knows how to go on without; repeats are flagged by the monitor."""
    sound = moving_imu()
    raw = failing(sound, [3], fault, IMU_SIZES.get(fault, 0.0))
    flagged = np.zeros(TICKS)
    flagged[BEGIN + 10 :] = fault == "frozen"
    given, _ = imu_run(raw, flagged)
    believed = np.isfinite(given).all(axis=1)
    off = np.abs(given - sound)[believed].max()
    rate = 4.0 * np.pi * 1.0 * LATE * DT  # of the sway, times the delay
    assert off < {"late": rate + 0.5, "frozen": 0.7, "spike": 1.5}.get(fault, 1e-12)
    assert np.isfinite(given[: BEGIN - 1]).all()


@pytest.mark.parametrize("fault", FAULTS)
def test_an_f_t_sensor_never_gives_nan_and_no_jump_of_150_n_is_believed(fault):
    sound = standing_wrench(TICKS)
    sound[:, [2, 8]] += 20.0 * np.sin(4.0 * np.pi * DT * np.arange(TICKS))[:, None] * [1.0, -1.0]
    raw = failing(sound, [2], fault, 150.0)
    given, contacts = wrench_run(raw)
    assert np.isfinite(given).all() and np.isfinite(contacts).all()
    off = np.abs(given - sound).max()
    assert off < {"late": 20.0 * 4.0 * np.pi * LATE * DT + 3.0}.get(fault, 45.0)  # held while the load sways by 40 N
    assert BEGIN * DT > 2.0 * SETTLED
