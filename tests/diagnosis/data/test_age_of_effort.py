"""Ages of an effort against closed forms, and the inertia of a servo whose goal is held for 20 ms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.channels import HELD, aged
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.effects.library import effect

from .. import stick_slip
from ..rigs import sines
from ..stick_slip import JOINT, Servo, rig_of, simulated

RAMP = np.array([0.0, 1.0, 2.0, 3.0, 10.0, 11.0, 12.0])
SEGMENTS = [slice(0, 4), slice(4, 7)]
WAVES = ((0.23, 0.5, 0.0), (0.71, 0.4, 1.1), (1.9, 0.15, 2.3))
SERVO = Servo(
    period=0.02,
    duration=30.0,
    encoder_step=1e-6,
    stiffness=8.0,
    inertia=0.004,
    viscous=0.2,
    coulomb=0.05,
    mass=0.4,
    length=0.15,
)


def test_a_negative_age_takes_later_samples_of_the_same_segment():
    assert aged(RAMP, SEGMENTS, -1.5) == pytest.approx([1.5, 2.5, 3.0, 3.0, 11.5, 12.0, 12.0])


def test_a_held_ramp_is_half_a_period_old():
    assert aged(RAMP, SEGMENTS, HELD)[[1, 2, 3, 5, 6]] == pytest.approx([0.5, 1.5, 2.5, 10.5, 11.5])


def test_no_age_leaves_the_samples_as_they_are():
    noisy = np.random.default_rng(4).normal(size=7)
    assert np.array_equal(aged(noisy, SEGMENTS, 0.0), noisy)


@pytest.mark.parametrize("age", [0.2, HELD, 0.8, 1.0, 2.3])
def test_a_held_wave_is_as_small_as_its_mean_over_a_period(age: float):
    """Mean of sin(w t) over one period: sin(w/2)/(w/2). A spline's own error is of the order w^4."""
    w, k = 0.4, np.arange(400)
    found = aged(np.sin(w * k), [slice(0, 400)], age)
    held = np.sin(0.5 * w) / (0.5 * w) * np.sin(w * (k - age))
    assert_allclose(found[20:-20], held[20:-20], atol=w**4 / 100)


@pytest.mark.parametrize("age", [-0.3, -0.5, -1.7])
def test_a_wave_that_acted_before_it_was_recorded_keeps_its_size(age: float):
    """A straight line between the samples would lose w^2/8 = 2 % of it at half a period."""
    w, k = 0.4, np.arange(400)
    found = aged(np.sin(w * k), [slice(0, 400)], age)
    assert_allclose(found[20:-20], np.sin(w * (k - age))[20:-20], atol=w**4 / 100)


@pytest.mark.parametrize("age", [-2.0, -1.0])
def test_whole_periods_shift_the_samples(age: float):
    noisy = np.random.default_rng(5).normal(size=30)
    found = aged(noisy, [slice(0, 30)], age)
    assert_allclose(found[3:-3], np.roll(noisy, int(age))[3:-3], atol=1e-12)  # rounding of the spline


@pytest.mark.parametrize("age", [0.2, HELD, 1.7])
def test_a_held_effort_is_constant_before_its_first_sample_and_after_its_last(age: float):
    """Against sums over fine steps of the linear ramp that stays at its ends."""
    fine = np.linspace(-0.5, 0.5, 4001)
    at = np.arange(4)[:, None] - age + fine
    assert_allclose(aged(RAMP[:4], [slice(0, 4)], age), np.clip(at, 0.0, 3.0).mean(axis=1), atol=1e-3)


def rotor_inertia(seed: int) -> float:
    """Of the declared model, of two runs [kg m^2]."""
    made = []
    rng = np.random.default_rng(seed)
    for number in range(3):
        command = sines(SERVO.times(), WAVES, float(rng.uniform(0.0, 3.0)))[0]
        position = SERVO.encoder(simulated(SERVO, command), rng)
        made.append(SERVO.run(f"run{number}", {f"{JOINT}/position": position, f"{JOINT}/position_command": command}))
    rig = replace(rig_of(SERVO), command_hold=True)
    found = prepare_joint(made[:2], made[2:], rig, JOINT)
    terms = [Term(effect(key)) for key in ("viscous", "coulomb", "rotor_inertia")]
    return float(fit(found.train, terms).beta[-1])


@pytest.mark.parametrize("seed", [31, 32, 33])
def test_a_goal_that_is_held_adds_no_inertia(seed: int, monkeypatch: pytest.MonkeyPatch):
    """The mean of two goals in the place of the hold adds K T^2/12 = 2.7e-4 kg m^2; a tenth of it is allowed.

    The integrator's step h of 0.2 ms would cost an eighth of it, by viscous friction (b h/2 = 2e-5 kg m^2).
    """
    monkeypatch.setattr(stick_slip, "FINE", 1e-4)
    excess = rotor_inertia(seed) - SERVO.inertia
    assert abs(excess) < 0.1 * SERVO.stiffness * SERVO.period**2 / 12.0
