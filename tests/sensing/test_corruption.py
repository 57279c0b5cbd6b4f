"""Kernel: the corruption of a log against closed forms and the laws of its random numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from drake_tc.errors import ParamsError
from drake_tc.sensing.sensor import SensorFault, SensorSpec, corrupt

DT = 1e-3
LONG = 40_000


def test_a_perfect_sensor_reads_the_truth():
    truth = np.random.default_rng(0).normal(size=(700, 3))
    assert_array_equal(corrupt(truth, SensorSpec(), DT), truth)


def test_noise_is_white_normal_and_of_the_stated_size():
    deviation = (0.5, 2.0, 1e-5)
    error = corrupt(np.zeros((LONG, 3)), SensorSpec(noise=deviation, bias=(0.0, 3.0, 0.0)), DT, seed=5)
    error[:, 1] -= 3.0
    w = error / deviation
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], LONG)
    assert np.all((np.sum(w**2, axis=0) > low) & (np.sum(w**2, axis=0) < high))
    four_sigma = 4.0 / np.sqrt(LONG)
    assert np.all(np.abs(w.mean(axis=0)) < four_sigma)
    for lag in (1, 2, 255, 256, 257, 512):  # the last are the seams between blocks
        assert np.all(np.abs(np.mean(w[lag:] * w[:-lag], axis=0)) < 1.1 * four_sigma)
    assert np.all(np.abs(np.corrcoef(w.T)[np.triu_indices(3, 1)]) < four_sigma)
    for channel in range(3):
        assert stats.kstest(w[:, channel], "norm").pvalue > 1e-3


def test_different_seeds_are_independent_and_the_same_seed_repeats():
    spec = SensorSpec(noise=1.0)
    zero = np.zeros((LONG, 1))
    one, again, other = (corrupt(zero, spec, DT, seed=seed)[:, 0] for seed in (1, 1, 2))
    assert_array_equal(one, again)
    assert abs(np.corrcoef(one, other)[0, 1]) < 4.0 / np.sqrt(LONG)
    assert_array_equal(corrupt(zero[:300], spec, DT, seed=1)[:, 0], one[:300])  # a shorter log has the same start


@settings(max_examples=50, deadline=None)
@given(x=st.floats(-1e3, 1e3), step=st.floats(1e-5, 10.0))
def test_a_quantised_reading_is_the_nearest_multiple(x, step):
    (reading,) = corrupt(np.array([[x]]), SensorSpec(resolution=step), DT)[0]
    assert abs(reading - x) <= 0.5 * step * (1 + 1e-9) + 1e-12
    assert abs(reading / step - round(reading / step)) < 1e-6


def test_scale_bias_and_resolution_act_in_that_order_on_their_channels():
    spec = SensorSpec(scale=(2.0, 1.0), bias=(0.3, 0.0), resolution=(0.5, 0.0))
    assert_allclose(corrupt(np.array([[1.0, 0.123]]), spec, DT), [[2.5, 0.123]], rtol=1e-15)


def test_latency_is_exact_and_starts_with_the_first_truth():
    truth = np.random.default_rng(1).normal(size=(50, 2))
    late = corrupt(truth, SensorSpec(latency=7e-3), DT)
    assert_array_equal(late[7:], truth[:-7])
    assert_array_equal(late[:7], np.tile(truth[0], (7, 1)))


def test_dropouts_come_at_the_stated_rate_channel_by_channel():
    rates = (0.01, 0.3, 0.0)
    lost = np.isnan(corrupt(np.zeros((LONG, 3)), SensorSpec(dropout=rates), DT, seed=3))
    for channel, rate in enumerate(rates):
        low, high = stats.binom.ppf([1e-4, 1 - 1e-4], LONG, rate)
        assert low <= lost[:, channel].sum() <= high
    both = np.sum(lost[:, 0] & lost[:, 1])
    assert stats.binom.ppf(1e-4, LONG, 0.003) <= both <= stats.binom.ppf(1 - 1e-4, LONG, 0.003)
    assert np.isnan(corrupt(np.zeros((9, 1)), SensorSpec(dropout=1.0), DT)).all()


def test_dropouts_leave_the_noise_as_it_was():
    zero = np.zeros((1000, 2))
    plain = corrupt(zero, SensorSpec(noise=1.0), DT, seed=4)
    holes = corrupt(zero, SensorSpec(noise=1.0, dropout=0.2), DT, seed=4)
    came = np.isfinite(holes)
    assert 0.5 < came.mean() < 0.95
    assert_array_equal(holes[came], plain[came])


@pytest.mark.parametrize("kind", ["dropped", "nan"])
def test_a_lost_sensor_reads_nan_in_its_window_and_channels_only(kind):
    readings = corrupt(np.ones((400, 3)), SensorSpec(), DT, [SensorFault(kind, 0.25, 0.02, (0, 2))])
    lost = np.zeros((400, 3), dtype=bool)
    lost[250:270, [0, 2]] = True
    assert_array_equal(np.isnan(readings), lost)


def test_a_bias_fault_adds_before_quantisation():
    fault = SensorFault("biased", 0.005, 0.003, value=0.26)
    readings = corrupt(np.zeros((12, 1)), SensorSpec(resolution=0.25), DT, [fault])
    assert_allclose(readings[:, 0], [0] * 5 + [0.25] * 3 + [0] * 4, atol=1e-15)


def test_a_late_sensor_reads_an_earlier_truth_while_it_is_late():
    """A ramp of 1 a tick: the reading is the tick less its age; before the log it is the first truth."""
    ramp = np.tile(np.arange(60.0)[:, None], (1, 2))
    faults = [
        SensorFault("late", 0.020, 0.010, channels=(1,), value=5e-3),
        SensorFault("late", 0.001, 2e-3, value=4e-3),
    ]
    readings = corrupt(ramp, SensorSpec(latency=2e-3), DT, faults)
    age = np.full((60, 2), 2.0)
    age[20:30, 1] += 5.0
    age[1:3] += 4.0
    assert_array_equal(readings, np.maximum(ramp - age, 0.0))


def test_late_faults_at_the_same_time_add_up():
    ramp = np.arange(60.0)[:, None]
    faults = [SensorFault("late", 0.030, value=5e-3), SensorFault("late", 0.040, value=7e-3)]
    assert corrupt(ramp, SensorSpec(), DT, faults)[[29, 30, 40], 0].tolist() == [29.0, 25.0, 28.0]


def test_spikes_hit_single_samples_at_the_stated_rate_with_either_sign_and_leave_the_noise():
    spec = SensorSpec(noise=1e-3)
    plain = corrupt(np.zeros((LONG, 3)), spec, DT, seed=8)
    faults = [SensorFault("spikes", 1.0, channels=(0, 2), value=0.3, chance=0.1)]
    spiked = corrupt(np.zeros((LONG, 3)), spec, DT, faults, seed=8) - plain
    assert_array_equal(spiked[:1000], 0.0)
    assert_array_equal(spiked[:, 1], 0.0)
    late = spiked[1000:, [0, 2]]
    assert_allclose(np.abs(late[late != 0.0]), 0.3, rtol=1e-12)
    for sign in (1.0, -1.0):
        low, high = stats.binom.ppf([1e-4, 1 - 1e-4], late.shape[0], 0.05)
        hits = (sign * late > 0.0).sum(axis=0)
        assert np.all((hits >= low) & (hits <= high))
    assert np.abs(np.corrcoef((late != 0.0).T)[0, 1]) < 4.0 / np.sqrt(LONG)


def test_a_frozen_sensor_repeats_its_last_reading_noise_included():
    truth = np.arange(600.0)[:, None] * [1.0, 1.0]
    spec = SensorSpec(noise=0.1)
    free = corrupt(truth, spec, DT, seed=6)
    stuck = corrupt(truth, spec, DT, [SensorFault("frozen", 0.25, 0.02, (1,)), SensorFault("frozen", 0.5)], seed=6)
    expected = free.copy()
    expected[250:270, 1] = free[249, 1]
    expected[500:] = free[499]
    assert_array_equal(stuck, expected)


def test_a_sensor_frozen_from_the_start_keeps_its_first_reading():
    assert_array_equal(corrupt(np.arange(4.0)[:, None], SensorSpec(), DT, [SensorFault("frozen")])[:, 0], np.zeros(4))


def test_a_frozen_sensor_repeats_the_last_finite_reading_and_can_still_be_lost():
    faults = [
        SensorFault("nan", 0.003, 0.002),
        SensorFault("frozen", 0.004, 0.006),
        SensorFault("dropped", 0.007, 0.001),
    ]
    got = corrupt(np.arange(12.0)[:, None], SensorSpec(), DT, faults)[:, 0]
    assert_array_equal(got, [0, 1, 2, np.nan, np.nan, 2, 2, np.nan, 2, 2, 10, 11])


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"noise": -1.0}, "noise: expected numbers >= 0"),
        ({"bias": np.inf}, "bias: expected finite"),
        ({"dropout": 1.5}, "probability"),
        ({"noise": (1.0, 2.0), "bias": (1.0, 2.0, 3.0)}, "one number of channels, got noise 2, bias 3"),
        ({"latency": (1e-3, 2e-3)}, "latency: expected one number"),
        ({"noise": ()}, "finite numbers"),
    ],
)
def test_impossible_specs_are_refused(spec, message):
    with pytest.raises(ParamsError, match=message):
        SensorSpec(**spec)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"kind": "melted"}, "frozen, dropped, biased, nan, spikes, late, got 'melted'"),
        ({"kind": "nan", "start": np.nan}, "start"),
        ({"kind": "nan", "duration": 0.0}, "duration"),
        ({"kind": "biased"}, "size of the bias"),
        ({"kind": "nan", "value": 1.0}, "only with kind biased"),
        ({"kind": "spikes"}, "size of the spikes"),
        ({"kind": "spikes", "value": 1.0, "chance": 0.0}, "probability above 0 and at most 1, got 0"),
        ({"kind": "nan", "chance": 0.5}, "chance: expected only with kind spikes"),
        ({"kind": "nan", "channels": ()}, "channels"),
        ({"kind": "late"}, "size of the delay"),
        ({"kind": "late", "value": -1e-3}, "an additional age > 0"),
    ],
)
def test_impossible_faults_are_refused(fault, message):
    with pytest.raises(ParamsError, match=message):
        SensorFault(**fault)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((3, 2)), SensorSpec(latency=1.4e-3), DT), "nearest: 0.001 and 0.002"),
        (
            (np.zeros((3, 2)), SensorSpec(), DT, [SensorFault("late", value=1.4e-3)]),
            "value: .*nearest: 0.001 and 0.002",
        ),
        ((np.zeros((3, 2)), SensorSpec(noise=(1.0, 1.0, 1.0)), DT), "one value, or 2, got 3"),
        ((np.zeros((3, 2)), SensorSpec(), 0.0), "positive period"),
        ((np.zeros((3, 2)), SensorSpec(), DT, [SensorFault("nan", channels=(2,))]), "expected 0 to 1, got 2"),
        ((np.zeros((3, 2)), SensorSpec(), DT, (), -1), "seed"),
        ((np.zeros(3), SensorSpec(), DT), "truth \\(T, n\\)"),
    ],
)
def test_what_does_not_fit_the_sensor_is_refused(arguments, message):
    with pytest.raises(ParamsError, match=message):
        corrupt(*arguments)
