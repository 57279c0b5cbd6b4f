"""Motions: derivatives against finite differences, limits, spectra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.errors import IdentificationError
from drake_tc.identification.excitation import (
    MotionLimits,
    growing_sinusoid,
    multisine,
    postures_with_pushes,
    trapezoids,
)

LIMITS = MotionLimits((-1.0, 1.5), 3.0, 40.0)
TIME = np.arange(10_000) * 1e-3


def check(motion, limits, time=TIME):
    low, high = limits.position
    assert motion.position.shape == motion.velocity.shape == motion.acceleration.shape == time.shape
    assert low - 1e-9 <= motion.position.min() <= motion.position.max() <= high + 1e-9
    assert np.abs(motion.velocity).max() <= limits.velocity * (1 + 1e-9)
    assert np.abs(motion.acceleration).max() <= limits.acceleration * (1 + 1e-9)
    step = time[1] - time[0]
    middle = slice(1, -1)
    rate = (motion.position[2:] - motion.position[:-2]) / (2 * step)
    assert_allclose(motion.velocity[middle], rate, atol=limits.acceleration * step)
    # positions are the integral of the velocities (trapezoidal rule, error of order step)
    travelled = np.cumsum(0.5 * (motion.velocity[1:] + motion.velocity[:-1])) * step
    assert_allclose(motion.position[1:] - motion.position[0], travelled, atol=limits.acceleration * step**2 * 50)
    gained = np.cumsum(0.5 * (motion.acceleration[1:] + motion.acceleration[:-1])) * step
    assert_allclose(motion.velocity[1:] - motion.velocity[0], gained, atol=limits.acceleration * step * 30)


def test_growing_sinusoid_is_the_papers_when_it_fits():
    motion = growing_sinusoid(TIME, 0.5, 0.1, 0.02, LIMITS)
    check(motion, LIMITS)
    assert motion.scale == 1
    assert_allclose(motion.position, (0.1 + 0.02 * TIME) * np.sin(np.pi * TIME), atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(f=st.floats(0.1, 5), a0=st.floats(0, 3), a=st.floats(0.001, 1), centre=st.floats(-0.9, 1.4))
def test_growing_sinusoid_keeps_the_limits_and_touches_one_when_scaled(f, a0, a, centre):
    motion = growing_sinusoid(TIME, f, a0, a, LIMITS, centre)
    check(motion, LIMITS)
    use = max(
        (motion.position.max() - centre) / (1.5 - centre),
        (centre - motion.position.min()) / (centre + 1.0),
        np.abs(motion.velocity).max() / 3,
        np.abs(motion.acceleration).max() / 40,
    )
    assert motion.scale == 1 or use == pytest.approx(1, rel=1e-9)


def test_multisine_has_its_tones_only_and_a_low_crest():
    motion = multisine(TIME, (0.5, 6.0), 20, LIMITS, np.random.default_rng(0))
    check(motion, LIMITS)
    spectrum = np.abs(np.fft.rfft(motion.position)) / 5000
    tones = spectrum > 1e-9
    assert tones.sum() == 20
    frequency = np.fft.rfftfreq(10_000, 1e-3)[tones]
    assert frequency.min() >= 0.5 - 1e-9 and frequency.max() <= 6 + 1e-9
    assert_allclose(spectrum[tones], spectrum[tones].mean(), rtol=1e-6)
    in_phase = np.sqrt(2 * 20)
    assert np.abs(motion.position).max() / motion.position.std() < 0.6 * in_phase


def test_multisine_is_seeded():
    make = [multisine(TIME, (0.5, 6.0), 9, LIMITS, np.random.default_rng(s)).position for s in (1, 1, 2)]
    assert_array_equal(make[0], make[1])
    assert np.abs(make[0] - make[2]).max() > 1e-3


def test_trapezoids_reach_their_targets_with_full_speed():
    motion = trapezoids(TIME, [-0.5, 1.4, 1.3, -0.9], LIMITS, dwell_s=0.5)
    check(motion, LIMITS)
    assert_allclose(motion.position[[0, -1]], [-0.5, -0.9], atol=1e-12)
    assert_allclose(np.abs(motion.velocity).max(), 3.0, rtol=1e-9)
    assert_allclose(motion.position[int(1000 * (0.5 + 1.9 / 3 + 3 / 40 + 0.25))], 1.4, atol=1e-9)


def test_pushes_come_at_rest_with_both_signs():
    motion, torque = postures_with_pushes(TIME, [0.0, 0.8, -0.5], 12.0, 2, LIMITS, np.random.default_rng(0))
    check(motion, LIMITS)
    assert np.abs(torque).max() <= 12
    assert torque.max() > 5 and torque.min() < -5
    assert_allclose(torque[np.abs(motion.velocity) > 1e-9], 0, atol=1e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MotionLimits((1.0, 0.0), 1.0, 1.0), "lowest < highest"),
        (lambda: growing_sinusoid(TIME, 0.0, 1, 1, LIMITS), "positive frequency"),
        (lambda: growing_sinusoid(TIME, 1.0, 1, 1, LIMITS, centre=2.0), "centre"),
        (lambda: multisine(TIME, (600.0, 700.0), 5, LIMITS, np.random.default_rng(0)), "band"),
        (lambda: trapezoids(TIME, [0.0, 3.0], LIMITS), "outside"),
        (lambda: trapezoids(TIME, [], LIMITS), "none given"),
        (
            lambda: postures_with_pushes(TIME[:5], [0, 1], 1, 1, LIMITS, np.random.default_rng(0)),
            "time to rest",
        ),
    ],
)
def test_bad_wishes_are_refused(make, message):
    with pytest.raises(IdentificationError, match=message):
        make()
