"""The most probable effort and acceleration of a simulated log: their errors tell nothing of the residual."""

import numpy as np
import pytest

from drake_tc.diagnosis.latent import Shares, filtered
from tests.diagnosis.rigs import Joint, problem

INERTIA = 0.4
"""K J [effort/(rad/s^2)]."""


@pytest.fixture(scope="module")
def samples():
    return problem(Joint(encoder_noise=2e-5, encoder_step=0.0)).samples


def _noise(samples, level: float, seed: int) -> np.ndarray:
    return level * np.random.default_rng(seed).normal(size=len(samples.signals))


def _shares(samples, residual: np.ndarray) -> Shares:
    return Shares.of(samples, residual, INERTIA)


def _correlation(samples, x: np.ndarray, y: np.ndarray) -> float:
    """Over all samples but the margins of the filters."""
    inner = slice(2 * samples.light.margin, -2 * samples.light.margin)
    x, y = x[inner], y[inner]
    return float(x @ y / np.sqrt((x @ x) * (y @ y)))


def test_where_the_effort_s_noise_is_all_the_effort_is_the_modelled_one(samples) -> None:
    residual = samples.light.smooth(_noise(samples, samples.resolution.effort_noise, 1))
    left = filtered(samples, _shares(samples, residual).effort, residual)
    assert np.std(samples.reduce(left)) < 0.25 * np.std(samples.reduce(residual))


def test_what_the_noise_does_not_explain_stays_in_the_effort(samples) -> None:
    slow = np.sin(2.0 * np.pi * 0.5 * samples.signals.time)
    left = filtered(samples, _shares(samples, slow).effort, slow)
    np.testing.assert_allclose(samples.reduce(left), samples.reduce(slow), atol=0.03)


def test_the_error_of_the_acceleration_tells_nothing_of_the_residual(samples) -> None:
    """r = -K J n_a + d: the recorded acceleration's error is n_a, that of the latent one n_a + (S_a/S) r/(K J)."""
    wrong = samples.light.second_derivative(_noise(samples, samples.resolution.position_noise, 2))
    other = samples.light.smooth(_noise(samples, 6.0 * INERTIA * float(np.std(wrong)), 3))
    residual = other - INERTIA * wrong
    told = filtered(samples, _shares(samples, residual).acceleration, residual) / INERTIA
    assert _correlation(samples, wrong, residual) < -0.2
    assert abs(_correlation(samples, wrong + told, residual)) < 0.1
