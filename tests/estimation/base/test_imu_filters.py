"""An IMU whose readings are late: carried to the tick, against motions known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import ParamsError
from drake_tc.estimation.base_estimator import CopEstimator
from drake_tc.estimation.base_log import run_log
from drake_tc.kernels.base.attitude import SLOPE_TIME, carried_to_tick

from .constructed import Motion, construct, spec, walker

DT = 1e-3


def carry(readings, age, dt=DT):
    trail, out = readings[0], []
    for reading in readings:
        now, trail = carried_to_tick(reading, trail, age, dt)
        out.append(now)
    return np.array(out)


@pytest.mark.parametrize("frequency", [0.5, 1.0, 4.0])
@pytest.mark.parametrize("age", [1e-3, 3e-3])
def test_a_sinusoid_is_carried_to_the_tick_up_to_the_closed_form(frequency, age):
    w = 2.0 * np.pi * frequency
    t = DT * np.arange(4000)
    found = carry(np.sin(w * (t - age))[:, None] * np.ones(6), age)
    z, k = np.exp(1j * w * DT), DT / (SLOPE_TIME + DT)
    gain = np.exp(-1j * w * age) * (1.0 + age * k / DT * (1.0 - 1.0 / z) / (1.0 - (1.0 - k) / z))
    wanted = (gain * np.exp(1j * w * t)).imag
    assert_allclose(found[200:, 0], wanted[200:], atol=1e-9)
    assert abs(gain - 1.0) < 1.1 * w * w * age * (SLOPE_TIME + 0.5 * age + 0.5 * DT)
    assert abs(gain - 1.0) < 0.2 * abs(np.exp(-1j * w * age) - 1.0) * max(1.0, frequency)


def test_a_ramp_is_carried_exactly_and_noise_grows_little():
    t = DT * np.arange(300)[:, None]
    ramp = 3.0 * t * np.ones(6)
    assert_allclose(carry(ramp - 3.0 * 2e-3, 2e-3)[100:], ramp[100:], atol=1e-6)
    noise = np.random.default_rng(0).normal(size=(20000, 6))
    now = carry(noise, DT)
    assert now.std() < 1.2
    assert_allclose(np.cumsum(now, axis=0), np.cumsum(noise, axis=0), atol=2.0)  # slopes telescope: 200 would be a walk


def test_a_late_imu_costs_nothing_that_its_age_does_not_give_back():
    """A turn whose truth is known; the log's gyro and accelerometer come two ticks late."""
    period, late = 5e-3, 2
    made = construct(Motion(duration=1.2, period=period, rest=0.1, frequency=1.0))

    def delayed(values):
        return np.concatenate([np.repeat(values[:1], late, axis=0), values[:-late]])

    # a reading of these logs is the rate at its tick; one of a gyro that averages is that of half a tick ago
    log = replace(made.log, gyro=delayed(made.log.gyro), accel=delayed(made.log.accel))
    worst = {}
    for age in (0.0, (late - 0.5) * period):
        tuned = spec(period, imu_age=age, yaw_time=np.inf)
        track = run_log(CopEstimator(walker(), tuned), log, made.truth.position[0], 0.0)
        worst[age > 0.0] = np.abs(track.rpy[:, 2] - made.truth.rpy[:, 2]).max()
    fastest = np.abs(np.gradient(made.truth.rpy[:, 2], period)).max()
    assert_allclose(worst[False], fastest * (late - 0.5) * period, rtol=0.25)
    assert worst[True] < 0.2 * worst[False]


@pytest.mark.parametrize("age", [-1e-3, np.inf, np.nan])
def test_what_is_refused(age):
    with pytest.raises(ParamsError, match="imu_age: expected a number >= 0"):
        spec(DT, imu_age=age)
