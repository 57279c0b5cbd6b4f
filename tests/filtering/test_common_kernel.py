"""The kernel against closed forms, and the promise: what balances before filtering balances after it."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.errors import ParamsError
from drake_tc.filtering.common_kernel import CommonKernel
from tests.benchmarks.times.machine import require


@settings(max_examples=30, deadline=None)
@given(degree=st.integers(0, 3), boxes=st.floats(1.0, 30.0), period=st.sampled_from([2e-4, 1e-3, 1 / 60]))
def test_polynomials_up_to_order_three_are_exact(degree, boxes, period):
    kernel = CommonKernel(boxes * 3.8 * period, period)
    samples = 2 * kernel.margin + 50
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.7][: degree + 1], domain=[0, samples * period])
    t = np.arange(samples) * period
    x = polynomial(t)
    valid = kernel.valid(samples)
    # rounding: 1e-12 of the largest sample, amplified by the kernel's own gain 1/width^k
    scale = 1e-12 * np.abs(x).max()
    assert_allclose(kernel.smooth(x)[valid], x[valid], atol=10 * scale)
    got = kernel.derivative(x)[valid]
    assert_allclose(got, polynomial.deriv()(t[valid]), atol=100 * scale / kernel.actual_width_s)
    got = kernel.second_derivative(x)[valid]
    assert_allclose(got, polynomial.deriv(2)(t[valid]), atol=1000 * scale / kernel.actual_width_s**2)


@pytest.mark.parametrize("frequency", [1.0, 8.0, 40.0])
def test_a_sinusoid_and_its_derivatives_pass_the_same_gain(frequency):
    kernel, t, omega = CommonKernel(0.02, 1e-3), np.arange(2000) * 1e-3, 2 * np.pi * frequency
    valid, x = kernel.valid(2000), np.sin(omega * t)
    gain = kernel.gain(np.array([frequency]))
    # 1e-5: aliasing of order (frequency/1000)^8 (1000/frequency)^2 and rounding
    assert_allclose(kernel.smooth(x)[valid], gain * x[valid], atol=1e-6)
    assert_allclose(kernel.derivative(x)[valid] / omega, gain * np.cos(omega * t[valid]), atol=1e-6)
    assert_allclose(kernel.second_derivative(x)[valid] / omega**2, -gain * x[valid], atol=1e-5)


def test_the_width_is_that_of_a_savitzky_golay_window_with_the_same_cutoff():
    from drake_tc.filtering.savitzky_golay import savgol_weights

    kernel = CommonKernel(0.102, 1e-3)
    frequency = np.linspace(0.1, 20, 2000)
    weights = savgol_weights(103, 2)
    savgol = np.cos(2 * np.pi * frequency[:, None] * (np.arange(103) - 51) * 1e-3) @ weights
    cutoff = [frequency[np.argmax(np.asarray(h) < np.sqrt(0.5))] for h in (kernel.gain(frequency), savgol)]
    assert_allclose(cutoff[0], cutoff[1], rtol=0.06)


def closed_form_motion(t):
    """A multisine: position, velocity, acceleration, jerk exactly."""
    rng = np.random.default_rng(5)
    omega = 2 * np.pi * np.array([0.3, 0.7, 1.9, 4.1, 9.7])[:, None]
    phase, amplitude = rng.uniform(0, 6, (5, 1)), np.array([[1.0], [0.5], [0.2], [0.05], [0.01]])
    angle = omega * t + phase
    return (
        (amplitude * np.sin(angle)).sum(axis=0),
        (amplitude * omega * np.cos(angle)).sum(axis=0),
        (-amplitude * omega**2 * np.sin(angle)).sum(axis=0),
        (-amplitude * omega**3 * np.cos(angle)).sum(axis=0),
    )


@pytest.mark.parametrize(("width", "period"), [(0.01, 1e-3), (0.05, 1e-3), (0.05, 5e-3)])
def test_a_torque_balance_survives_and_a_delay_of_zero_is_estimated_as_zero(width, period):
    t = np.arange(int(8 / period)) * period
    q, v, a, _ = closed_form_motion(t)
    inertia, damping, stiffness, drive = 0.31, 1.7, 12.0, 0.004
    torque = inertia * a + damping * v + stiffness * q
    effort = drive * torque
    kernel = CommonKernel(width, period)
    valid = kernel.valid(t.size)
    y = kernel.smooth(effort)[valid]
    x = np.stack(
        [kernel.second_derivative(q), kernel.derivative(q), kernel.smooth(q), kernel.derivative(torque)], axis=1
    )[valid]
    balance = y - drive * x[:, :3] @ [inertia, damping, stiffness]
    assert_allclose(balance / np.abs(y).max(), 0, atol=1e-6)
    delay = -np.linalg.lstsq(x, y, rcond=None)[0][3] / drive
    assert_allclose(delay, 0, atol=1e-6)  # seconds, against a period of 1e-3 and more


def test_the_kernel_attenuates_noise_and_commutes_with_itself():
    rng = np.random.default_rng(1)
    kernel = CommonKernel(0.05, 1e-3)
    x = rng.normal(size=4000)
    inner = slice(2 * kernel.margin, -2 * kernel.margin)
    assert kernel.smooth(x)[inner].std() < 0.3
    assert_allclose(kernel.smooth(kernel.derivative(x))[inner], kernel.derivative(kernel.smooth(x))[inner], atol=1e-9)


def test_segments_are_filtered_each_by_itself():
    kernel = CommonKernel(0.01, 1e-3)
    x = np.random.default_rng(2).normal(size=300)
    x[140:160] = np.nan
    segments = [slice(0, 140), slice(160, 300)]
    y = kernel.smooth(x, segments)
    assert_array_equal(np.isnan(y), np.isnan(x))
    assert_allclose(y[160:], kernel.smooth(x[160:]), rtol=1e-12)
    valid = kernel.valid(300, segments)
    assert valid.sum() == 280 - 4 * kernel.margin
    assert not valid[140 - kernel.margin : 160 + kernel.margin].any()


@pytest.mark.parametrize("samples", [0, 1, 2, 5])
def test_short_stretches_stay_finite_and_invalid(samples):
    kernel = CommonKernel(0.1, 1e-3)
    x = np.arange(samples, dtype=float)
    assert_array_equal(np.isfinite(kernel.second_derivative(x)), np.ones(samples, bool))
    assert not kernel.valid(samples).any()


@pytest.mark.benchmark
def test_a_million_samples_in_half_a_second():
    kernel = CommonKernel(0.05, 1e-3)
    x = np.random.default_rng(0).normal(size=1_000_000)
    kernel.smooth(x[:1000])

    def smoothed():
        start = time.perf_counter()
        kernel.smooth(x)
        return {"a million samples": time.perf_counter() - start}

    require({"a million samples": 0.3}, smoothed)


@pytest.mark.parametrize(("width", "period"), [(0.0, 1e-3), (0.1, -1.0), (np.nan, 1e-3)])
def test_bad_widths_are_refused(width, period):
    with pytest.raises(ParamsError, match="positive width and period"):
        CommonKernel(width, period)
