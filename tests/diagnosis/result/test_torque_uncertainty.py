"""Torque uncertainty: coloured noise of known covariance comes back, with intervals that hold what they promise."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.control.torque_uncertainty_file import load_torque_uncertainty, save_torque_uncertainty
from drake_tc.diagnosis.result.torque_uncertainty import (
    Rows,
    common_errors,
    shrunk_correlation,
    spread,
    torque_uncertainty,
)

RHO = 0.9
"""Of the AR(1) noise: e_k = rho e_{k-1} + w_k."""
GAIN = 2e-4
PERIOD = 1e-3


def coloured(rng, count, sigma=1.0, width=1, rho=RHO):
    """(count, width) stationary AR(1) noise of standard deviation sigma."""
    white = rng.normal(size=(count + 500, width)) * np.sqrt(1.0 - rho**2)
    return sigma * lfilter([1.0], [1.0, -rho], white, axis=0)[500:]


def a_joint(error, stride=4, rows=None, segments=None, period=PERIOD):
    """What `torque_uncertainty` reads of a joint whose model errs by `error` [N m]."""
    rows = np.arange(error.size) * stride if rows is None else rows
    segments = (slice(0, int(rows[-1]) + 1),) if segments is None else segments
    samples = SimpleNamespace(rows=rows, segments=segments, signals=SimpleNamespace(period=period))
    drive = {"gain": SimpleNamespace(value=GAIN)}
    return SimpleNamespace(
        heldout=SimpleNamespace(samples=samples, after=GAIN * error), final_parameters={"drive": drive}
    )


def a_result(**joints):
    return SimpleNamespace(joints=joints, rig_file="rigs/leg.yaml", heldout_files=("a/held.npz",))


def test_known_covariance_of_coloured_noise_comes_back():
    rng = np.random.default_rng(1)
    mixing = np.array([[2.0, 0.0, 0.0], [0.9, 0.5, 0.0], [-0.1, 0.2, 0.3]])
    wanted = mixing @ mixing.T
    count = 40_000
    errors = coloured(rng, count, width=3) @ mixing.T
    found = torque_uncertainty(a_result(**{name: a_joint(errors[:, i]) for i, name in enumerate("abc")}))
    effective = count * (1.0 - RHO**2) / (1.0 + RHO**2)
    square = np.outer(np.diag(wanted), np.diag(wanted))
    deviation = np.sqrt((square + wanted**2) / effective)  # of the estimate, for Gaussian noise
    assert_allclose((found.covariance - wanted) / deviation, np.zeros((3, 3)), atol=4.0)
    assert np.array_equal(found.covariance, found.covariance.T)
    assert np.linalg.eigvalsh(found.covariance)[0] > 0.0
    assert found.shrinkage < 0.01
    # rows are 4 samples apart; the estimate of tau has a deviation of sqrt(2 (2 M + 1)/T) = 10 %, M = 5 tau (Sokal)
    assert_allclose(found.correlation_time, 4 * PERIOD * (1 + RHO) / (1 - RHO), rtol=0.35)
    assert_allclose(found.effective_samples, effective, rtol=0.25)
    assert found.common_effective_samples < effective


def test_the_interval_of_sigma_holds_it_in_95_of_100():
    rng = np.random.default_rng(2)
    inside = naive = 0
    for _ in range(300):
        found = spread(coloured(rng, 1500)[:, 0])
        inside += found.ci95[0] <= 1.0 <= found.ci95[1]
        naive += abs(found.sigma - 1.0) <= 1.96 / np.sqrt(2 * 1500)
    assert 0.90 <= inside / 300 <= 0.99  # 4 binomial deviations about 0.95, and the estimated tau is somewhat low
    assert naive / 300 < 0.65  # the same without the correlation in time


def test_heavy_tails_widen_the_interval():
    rng = np.random.default_rng(3)
    normal, heavy = rng.normal(size=4000), rng.laplace(size=4000)
    one, other = spread(normal), spread(heavy)
    assert_allclose(one.effective_samples, 4000, rtol=0.15)
    assert_allclose(other.effective_samples, 4000 * 2.0 / 5.0, rtol=0.25)  # kurtosis 6: var e^2 = 5 (mean e^2)^2


def test_a_mean_counts_in_sigma_and_is_told():
    error = 3.0 + coloured(np.random.default_rng(4), 20_000)[:, 0]
    found = torque_uncertainty(a_result(knee=a_joint(error)))
    assert_allclose(found.mean, [3.0], atol=0.15)
    assert_allclose(found.covariance, [[10.0]], rtol=0.08)


def test_independent_joints_are_drawn_to_the_diagonal_and_equal_ones_are_not():
    rng = np.random.default_rng(5)
    errors = coloured(rng, 600, width=8)
    correlation, share, effective = shrunk_correlation(errors, [600])
    raw = np.corrcoef(errors.T)
    beside = ~np.eye(8, dtype=bool)
    assert share > 0.6
    assert np.sum(correlation[beside] ** 2) < 0.2 * np.sum(raw[beside] ** 2)
    assert effective < 150
    same, share, _ = shrunk_correlation(errors[:, [0, 0]] * [1.0, -2.0], [600])
    assert_allclose(same, [[1.0, -1.0], [-1.0, 1.0]], atol=1e-6)
    assert share < 1e-6


def test_joints_that_err_together_give_a_file_that_loads(tmp_path):
    error = coloured(np.random.default_rng(6), 5000)[:, 0]
    found = torque_uncertainty(a_result(a=a_joint(error), b=a_joint(2.0 * error), c=a_joint(-error)))
    loaded = load_torque_uncertainty(save_torque_uncertainty(found, tmp_path / "torque_uncertainty.yaml"))
    assert_allclose(loaded.covariance, found.covariance, rtol=0, atol=0)
    assert_allclose(loaded.correlation, [[1, 1, -1], [1, 1, -1], [-1, -1, 1]], atol=1e-6)
    assert loaded.provenance["holdout"] == ["held.npz"]


def test_joints_of_other_clocks_or_that_never_move_together_have_a_diagonal():
    error = coloured(np.random.default_rng(7), 4000)[:, 0]
    apart = a_joint(error, period=2 * PERIOD)
    early = a_joint(error[:2000], rows=np.arange(2000) * 4, segments=(slice(0, 16_000),))
    late = a_joint(error[2000:], rows=8000 + np.arange(2000) * 4, segments=(slice(0, 16_000),))
    clocks = torque_uncertainty(a_result(a=a_joint(error), b=apart))
    turns = torque_uncertainty(a_result(a=early, b=late))
    for found in (clocks, turns):
        assert found.covariance[0, 1] == 0.0
        assert found.common_effective_samples == 0.0
        assert found.sigma.min() > 0.5


def test_rows_of_two_strides_meet_on_a_straight_line():
    index = np.arange(0, 3000, 6)
    other = np.arange(1, 3000, 4)
    none = np.zeros(other.size, dtype=np.int64)
    rows = [Rows(0.5 * index, index, 6, np.zeros(index.size, dtype=np.int64)), Rows(2.0 * other, other, 4, none)]
    errors, lengths = common_errors(rows)
    assert_allclose(errors[:, 1], 4.0 * errors[:, 0], rtol=1e-12)  # both are straight lines in time
    assert errors.shape[0] == sum(lengths) > 490


def test_nothing_is_taken_across_a_gap():
    index = np.concatenate([np.arange(0, 1000, 4), np.arange(2000, 3000, 4)])
    stretch = (index >= 2000).astype(np.int64)
    full = np.arange(0, 3000, 4)
    whole = Rows(np.zeros(full.size), full, 4, (full >= 2000).astype(np.int64))
    rows = [whole, Rows(np.ones(index.size), index, 4, stretch)]
    errors, lengths = common_errors(rows)
    assert errors.shape[0] == index.size
    assert lengths == [250, 250]


def test_a_joint_without_error_is_certain():
    assert spread(np.zeros(50)).ci95 == (0.0, 0.0)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), count=st.integers(120, 400), width=st.integers(1, 6), scale=st.floats(1e-6, 1e6))
def test_any_errors_give_a_covariance(seed, count, width, scale):
    rng = np.random.default_rng(seed)
    errors = scale * coloured(rng, count, width=width, rho=0.5) @ rng.normal(size=(width, width))
    found = torque_uncertainty(a_result(**{f"j{i}": a_joint(errors[:, i]) for i in range(width)}))
    lowest = np.linalg.eigvalsh(found.covariance)[0]
    assert lowest >= -1e-12 * np.abs(found.covariance).max()
    assert_allclose(found.sigma**2, np.mean(errors**2, axis=0), rtol=1e-9)
    assert np.all((found.ci95[:, 0] <= found.sigma) & (found.sigma <= found.ci95[:, 1]))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_rows_give_a_wide_interval(count):
    found = spread(np.arange(1.0, count + 1.0))
    assert np.isfinite(found.sigma)
    assert found.ci95[1] > 1.5 * found.sigma
