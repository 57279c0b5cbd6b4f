"""Residuals that a command of unknown age makes, and others."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.residual.age_of_command import may_be_age_of_command
from drake_tc.diagnosis.residual.unexplained import DataSplit

from ..rigs import WAVES, sines
from ..stick_slip import JOINT, Servo, rig_of

SERVO = Servo(period=0.01, duration=20.0)
FLOOR = 1e-4


@pytest.fixture(scope="module")
def samples() -> Samples:
    """Rows of a servo that follows its command perfectly."""
    q = sines(SERVO.times(), WAVES, 0.0)[0]
    run = SERVO.run("run", {f"{JOINT}/position": q, f"{JOINT}/position_command": q + 1e-3})
    return build_samples([run], rig_of(SERVO), JOINT)


def speed(samples: Samples) -> np.ndarray:
    """(N,) of the command on the rows [rad/s], from the closed form of its sines."""
    return np.asarray(samples.signals.velocity[samples.rows])


def split(samples: Samples, after: np.ndarray) -> DataSplit:
    return DataSplit(samples, after, after)


def test_an_age_that_wanders_within_one_period_may_be_the_cause(samples):
    time = samples.signals.time[samples.rows]
    age = 0.5 * SERVO.period * np.sin(2.0 * np.pi * 0.7 * time)
    noise = FLOOR * np.random.default_rng(0).standard_normal(time.size)
    assert may_be_age_of_command(split(samples, age * speed(samples) + noise), FLOOR)
    assert not may_be_age_of_command(split(samples, 3.0 * age * speed(samples)), FLOOR), "three half periods"


def test_an_error_that_does_not_grow_with_the_speed_has_another_cause(samples):
    constant = np.full(samples.rows.size, 0.2 * SERVO.period * float(np.abs(speed(samples)).max()))
    assert not may_be_age_of_command(split(samples, constant), FLOOR)
    slow = np.abs(speed(samples)) <= np.median(np.abs(speed(samples)))
    within = np.where(slow, 0.4 * SERVO.period * speed(samples), 0.0)
    assert not may_be_age_of_command(split(samples, within), FLOOR)


def test_on_a_fast_clock_half_a_period_is_nothing(samples):
    fast = replace(samples, signals=replace(samples.signals, period=1e-3))
    assert not may_be_age_of_command(split(fast, np.zeros(samples.rows.size)), FLOOR)
