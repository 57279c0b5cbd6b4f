"""Kernel: polynomials in closed form, scipy's filter. System: equals the kernel, state in the Context."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import VectorLogSink
from scipy.signal import savgol_filter

from drake_tc.errors import ParamsError
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter, delay, savgol_weights, smooth, smooth_causal

DT = 1e-3


@settings(max_examples=60, deadline=None)
@given(
    order=st.integers(0, 5),
    extra=st.integers(0, 60),
    fraction=st.floats(0.0, 1.0),
    derivative=st.integers(0, 3),
    seed=st.integers(0, 2**31),
)
def test_weights_are_exact_on_polynomials_of_the_order(order, extra, fraction, derivative, seed):
    window = order + 1 + extra
    at = fraction * (window - 1)
    polynomial = np.polynomial.Polynomial(np.random.default_rng(seed).normal(size=order + 1), domain=[0, window * DT])
    weights = savgol_weights(window, order, at, derivative, DT)
    exact = (polynomial.deriv(derivative) if derivative else polynomial)(at * DT)
    # conditioning: weights of 1/dt^k times values of order 10; 1e-9 of that product is rounding
    assert_allclose(weights @ polynomial(np.arange(window) * DT), exact, atol=1e-9 * np.abs(weights).sum())


@pytest.mark.parametrize(("window", "order"), [(9, 2), (41, 2), (41, 3), (81, 5)])
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_smooth_agrees_with_scipy_up_to_the_edges(window, order, derivative):
    x = np.random.default_rng(3).normal(size=(400, 2))
    ours = smooth(x, window, order, DT)
    theirs = savgol_filter(x, window, order, deriv=derivative, delta=DT, axis=0, mode="interp")
    got = (ours.value, ours.first_derivative, ours.second_derivative)[derivative]
    assert_allclose(got, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize("window", [20, 21])
def test_smooth_has_no_delay_and_is_exact_for_even_and_odd_windows(window):
    t = np.arange(200) * DT
    got = smooth(3 - 2 * t + 40 * t**2, window, 2, DT)
    assert_allclose(got.value, 3 - 2 * t + 40 * t**2, rtol=1e-11)
    assert_allclose(got.first_derivative, -2 + 80 * t, atol=1e-9)
    assert_allclose(got.second_derivative, np.full(200, 80.0), rtol=1e-7)


def test_causal_estimate_is_old_by_the_stated_delay():
    t = np.arange(300) * DT
    window, at = 80, 39.5
    got = smooth_causal(5 * t**2 - t, window, 2, DT, at)
    late = t[window:] - delay(window, DT, at)
    assert_allclose(delay(window, DT), 39.5e-3, rtol=1e-12)
    assert_allclose(got.value[window:], 5 * late**2 - late, atol=1e-12)
    assert_allclose(got.first_derivative[window:], 10 * late - 1, atol=1e-9)


def test_order_one_has_no_second_derivative():
    assert_array_equal(savgol_weights(11, 1, derivative=2), np.zeros(11))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((2, 2), "at least order \\+ 1"),
        ((9, 2, 9.0), "0 to 8"),
        ((9, 2, 4.0, 0, 0.0), "period must be positive"),
        ((9, 2, 4.0, -1), "derivative"),
    ],
)
def test_bad_parameters_are_refused(arguments, message):
    with pytest.raises(ParamsError, match=message):
        savgol_weights(*arguments)


def test_a_stretch_shorter_than_the_window_is_refused():
    with pytest.raises(ParamsError, match="only 5"):
        smooth(np.zeros(5), 9, 2, DT)


def tick(system, context, u):
    system.get_input_port().FixValue(context, u)
    context.SetDiscreteState(system.EvalUniquePeriodicDiscreteUpdate(context))


def outputs(system, context):
    names = ("value", "first_derivative", "second_derivative", "fault")
    return np.stack([system.GetOutputPort(name).Eval(context) for name in names])


def test_system_equals_kernel_in_two_contexts_at_once():
    system = SavitzkyGolayFilter(2, 15, 2, DT, at=10)
    rng = np.random.default_rng(0)
    logs = rng.normal(size=(2, 40, 2)) + 5
    contexts = [system.CreateDefaultContext() for _ in range(2)]
    expected = [smooth_causal(log, 15, 2, DT, 10) for log in logs]
    for k in range(40):
        for context, log, want in zip(contexts, logs, expected, strict=True):
            tick(system, context, log[k])
            got = outputs(system, context)
            assert_allclose(got[0], want.value[k], rtol=1e-12, atol=1e-12)
            assert_allclose(got[1], want.first_derivative[k], atol=1e-9)
            assert_allclose(got[2], want.second_derivative[k], atol=1e-6)
    assert_allclose(system.delay, 4 * DT, rtol=1e-12)


def test_estimate_stacks_the_three_and_orders_go_by_channel():
    orders = (2, 1, 2, 0)
    system = SavitzkyGolayFilter(4, 7, orders, DT)
    singles = [SavitzkyGolayFilter(1, 7, order, DT) for order in orders]
    context, own = system.CreateDefaultContext(), [single.CreateDefaultContext() for single in singles]
    for u in np.random.default_rng(1).normal(size=(30, 4)):  # the ring turns more than four times
        tick(system, context, u)
        for channel, (single, its) in enumerate(zip(singles, own, strict=True)):
            tick(single, its, u[channel : channel + 1])
            assert_allclose(outputs(system, context)[:, channel], outputs(single, its)[:, 0], rtol=1e-9, atol=1e-9)
        stacked = system.GetOutputPort("estimate").Eval(context).reshape(3, 4)
        assert_allclose(stacked, outputs(system, context)[:3], rtol=1e-12, atol=1e-9)
    assert_array_equal(stacked[2, [1, 3]], 0.0)
    assert_array_equal(stacked[1, 3], 0.0)


def test_the_ring_equals_the_log_also_around_lost_samples():
    system, window = SavitzkyGolayFilter(2, 9, 2, DT, at=6), 9
    context = system.CreateDefaultContext()
    log = np.random.default_rng(2).normal(size=(60, 2))
    log[[20, 21, 40], 0], log[[21, 59], 1] = np.nan, np.inf
    held = log.copy()
    for k in range(1, 60):
        held[k] = np.where(np.isfinite(log[k]), log[k], held[k - 1])
    want = smooth_causal(held, window, 2, DT, 6)
    for k in range(60):
        tick(system, context, log[k])
        got = outputs(system, context)
        assert_allclose(got[0], want.value[k], atol=1e-11)
        assert_allclose(got[2], want.second_derivative[k], atol=1e-5)
        assert_array_equal(got[3], ~np.isfinite(log[k]))


def test_a_clone_goes_its_own_way():
    system = SavitzkyGolayFilter(1, 4, 1, DT)
    context = system.CreateDefaultContext()
    for k in range(6):
        tick(system, context, [float(k)])
    clone = context.Clone()
    before = outputs(system, context)
    tick(system, clone, [50.0])
    assert_array_equal(outputs(system, context), before)
    assert outputs(system, clone)[0, 0] > before[0, 0] + 1.0


@pytest.mark.parametrize(
    ("size", "order", "message"), [(0, 2, "at least one joint"), (3, (2, 1), "one a joint \\(3\\), got 2")]
)
def test_bad_systems_are_refused(size, order, message):
    with pytest.raises(ParamsError, match=message):
        SavitzkyGolayFilter(size, 9, order, DT)


def test_system_starts_without_a_bump():
    system = SavitzkyGolayFilter(1, 9, 2, DT)
    context = system.CreateDefaultContext()
    tick(system, context, [7.0])
    assert_allclose(outputs(system, context)[:, 0], [7, 0, 0, 0], atol=1e-8)


def test_non_finite_samples_are_held_and_flagged():
    system = SavitzkyGolayFilter(2, 3, 1, DT, at=2)
    context = system.CreateDefaultContext()
    assert_array_equal(outputs(system, context), [[0, 0], [0, 0], [0, 0], [1, 1]])
    tick(system, context, [np.nan, 1.0])
    assert_allclose(outputs(system, context)[[0, 3]], [[0, 1], [1, 0]], atol=1e-12)
    tick(system, context, [4.0, np.inf])
    assert_allclose(outputs(system, context)[[0, 3]], [[4, 1], [0, 1]], atol=1e-12)
    tick(system, context, [4.0, 1.0])
    assert_allclose(outputs(system, context)[[0, 3]], [[4, 1], [0, 0]], atol=1e-12)


def test_outputs_depend_on_exactly_what_is_declared():
    system = SavitzkyGolayFilter(1, 5, 2, DT)
    assert not system.HasAnyDirectFeedthrough()
    context = system.CreateDefaultContext()
    tick(system, context, [1.0])
    before = outputs(system, context)
    system.get_input_port().FixValue(context, [9.0])
    assert_array_equal(outputs(system, context), before)
    context.SetDiscreteState(2, [4.0, 3.0, 2.0])
    assert_array_equal(outputs(system, context)[:, 0], [4.0, 3.0, 2.0, 0.0])
    assert_array_equal(system.GetOutputPort("estimate").Eval(context), [4.0, 3.0, 2.0])
    context.SetDiscreteState(1, [1.0])
    assert_array_equal(outputs(system, context)[:, 0], [4.0, 3.0, 2.0, 1.0])
    context.SetDiscreteState(0, np.zeros(7))
    assert_array_equal(outputs(system, context)[:, 0], [4.0, 3.0, 2.0, 1.0])


@pytest.mark.parametrize("oldest", [0, 1, 4])
def test_update_reads_the_ring_from_its_oldest_sample(oldest):
    system = SavitzkyGolayFilter(1, 5, 2, DT)
    context = system.CreateDefaultContext()
    tick(system, context, [1.0])
    ring = np.roll([7.0, 0.0, 1.0, 4.0, 9.0], oldest)  # from the oldest: 7 0 1 4 9; the update puts 16 for the 7
    context.SetDiscreteState(0, [*ring, 1.0, float(oldest)])
    tick(system, context, [16.0])
    assert_allclose(outputs(system, context)[:, 0], [4, 4 / DT, 2 / DT**2, 0], rtol=1e-9, atol=1e-9)


def test_system_runs_in_a_diagram_and_lags_one_period_behind_for_a_discrete_reader():
    from pydrake.systems.primitives import TrajectorySource
    from pydrake.trajectories import PiecewisePolynomial

    builder = DiagramBuilder()
    line = PiecewisePolynomial.FirstOrderHold([0.0, 1.0], np.array([[1.0, 3.0]]))
    source = builder.AddSystem(TrajectorySource(line))
    system = builder.AddSystem(SavitzkyGolayFilter(1, 11, 2, 0.01))
    sink = builder.AddSystem(VectorLogSink(1, 0.01))
    builder.Connect(source.get_output_port(), system.GetInputPort("signal"))
    builder.Connect(system.GetOutputPort("value"), sink.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.5)
    log = sink.FindLog(simulator.get_context())
    late = log.sample_times()[20:] - system.delay - 0.01
    assert_allclose(log.data()[0, 20:], 1 + 2 * late, atol=1e-9)
