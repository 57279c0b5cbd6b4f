"""Limit cycles: known signals, and describing functions against the oscillation of a simulated loop."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.analysis.limit_cycle import (
    coulomb_gain,
    deadzone_gain,
    find_limit_cycle,
    predicted_limit_cycles,
    saturation_gain,
)
from drake_tc.errors import ParamsError

DT = 1e-3


@pytest.mark.parametrize("shape", ["sine", "square", "triangle"])
def test_period_and_amplitude_of_a_known_oscillation(shape):
    phase = 2.0 * np.pi * np.arange(4000) * DT / 0.137
    signal = {"sine": np.sin(phase), "square": np.sign(np.sin(phase)), "triangle": np.arcsin(np.sin(phase))}[shape]
    noise = 0.02 * np.random.default_rng(1).normal(size=4000)
    found = find_limit_cycle(3.0 + 0.5 * signal + noise, DT)
    assert_allclose(found.period, 0.137, rtol=0.01)
    assert_allclose(found.amplitude, 0.5 * np.abs(signal).max(), rtol=0.2)
    assert found.confidence > 0.8


def test_a_decaying_oscillation_noise_and_rest_are_no_limit_cycle():
    time = np.arange(4000) * DT
    decaying = find_limit_cycle(np.exp(-1.5 * time) * np.sin(40.0 * time), DT)
    assert decaying.confidence < 0.3
    noise = find_limit_cycle(np.random.default_rng(0).normal(size=4000), DT)
    assert noise.confidence < 0.3
    assert find_limit_cycle(np.zeros(4000), DT) is None
    assert find_limit_cycle(1e-6 * np.sin(40.0 * time), DT, floor=1e-5) is None


@pytest.mark.parametrize(
    ("gain", "law"),
    [
        (lambda a: deadzone_gain(a, 0.3), lambda x: np.sign(x) * np.maximum(np.abs(x) - 0.3, 0.0)),
        (lambda a: saturation_gain(a, 0.3), lambda x: np.clip(x, -0.3, 0.3)),
        (lambda a: coulomb_gain(a, 0.3), lambda x: 0.3 * np.sign(x)),
    ],
)
def test_describing_functions_are_first_harmonics(gain, law):
    phase = 2.0 * np.pi * (np.arange(200000) + 0.5) / 200000
    for amplitude in (0.2, 0.5, 3.0):
        wanted = 2.0 * np.mean(law(amplitude * np.sin(phase)) * np.sin(phase)) / amplitude
        assert_allclose(gain(np.array([amplitude]))[0], wanted, atol=1e-6)


def test_a_saturated_delayed_integrator_oscillates_as_predicted():
    """x[k+1] = x[k] - g sat(x[k - d]): unstable near rest, held by its limit."""
    g, late, limit = 0.06, 40, 1.0

    def open_loop(omega):
        z = np.exp(1j * omega * DT)
        return g * z**-late / (z - 1.0)

    (predicted, *rest) = predicted_limit_cycles(
        open_loop, DT, lambda a: saturation_gain(a, limit), np.geomspace(0.5, 50.0, 60)
    )
    assert not rest
    x = np.zeros(20000)
    x[: late + 1] = 0.1
    for k in range(late, x.size - 1):
        x[k + 1] = x[k] - g * np.clip(x[k - late], -limit, limit)
    found = find_limit_cycle(x, DT)
    assert found.confidence > 0.9
    assert_allclose(found.period, predicted.period, rtol=0.05)
    assert_allclose(found.amplitude, predicted.amplitude, rtol=0.15)  # a describing function leaves harmonics out


def test_refusals():
    with pytest.raises(ParamsError, match="expected at least 16 finite samples"):
        find_limit_cycle(np.zeros(5), DT)
    with pytest.raises(ParamsError, match="expected at least two rising amplitudes"):
        predicted_limit_cycles(lambda w: 1.0 / (1j * w), DT, lambda a: a, np.array([1.0, 0.5]))
