"""Sensors' errors within tolerance: the textbook posterior, coverage of the intervals, what is named."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.signal import lfilter

from drake_tc.diagnosis.problem.columns import FOLDS
from drake_tc.diagnosis.problem.shared.causes import Cause
from drake_tc.diagnosis.problem.shared.columns_of_runs import column_filter
from drake_tc.diagnosis.problem.shared.covariance import covariance, intervals
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import CUT_OFF, fit_stacked
from drake_tc.diagnosis.selection.shared import active, search_shared
from drake_tc.estimation.off_line import OffLineFilter

N = 2400
BIAS = (0.3, 0.3)
CAUSES = (
    Cause("link_mass", "thigh", ("mass",), ("kg",), slice(0, 1)),
    Cause("ft_bias", "foot", ("one", "two"), ("N", "N"), slice(1, 3), BIAS),
    Cause("imu_bias", "trunk", ("one", "two"), ("N", "N"), slice(3, 5), (0.2, 0.2)),
    Cause("imu_alignment", "trunk", ("turn",), ("rad",), slice(5, 6), (0.5,)),
)
ALL = np.array([0.3, 0.3, 0.2, 0.2, 0.5])
NOISE = (0.4, 0.6, 0.3)


def columns(number, time):
    """(N, 6): the F/T sensor's bias is nearly that of the IMU, which are nearly constant."""
    slow = np.stack([np.cos(0.3 * time + number), np.sin(0.2 * time + 2.0 * number)], axis=1)
    mass = 2.0 + np.sin(1.7 * time + number)
    return np.column_stack([mass, slow, slow + 0.2 * np.sin(1.1 * time)[:, None], np.cos(0.9 * time - number)])


def joints(seed, delta, correlation=0.95):
    """Three joints' rows with AR(1) noise of this correlation, on the clock of the causes."""
    rng = np.random.default_rng(seed)
    time = np.arange(N) * 0.01
    out = []
    for number in range(3):
        v = np.sin(2.0 * np.pi * (0.3 + 0.1 * number) * time)
        load = 40.0 * np.sin(2.0 * np.pi * 0.17 * time + number)
        own = np.stack([load + 20.0 * v + 15.0 * np.sign(v), -v, -np.sign(v)], axis=1)
        shared = columns(number, time)
        white = np.sqrt(1.0 - correlation**2) * rng.standard_normal(N + 500)
        noise = NOISE[number] * lfilter([1.0], [1.0, -correlation], white)[500:]
        out.append(rows_of(number, own, shared, load + noise + shared @ delta))
    return out


def rows_of(number, own, shared, target):
    block = (np.arange(target.size) // 50).astype(np.int64)
    every = np.column_stack([own, shared, target])
    fold = (block // 2) % FOLDS
    grams = np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)])
    samples = SimpleNamespace(run=np.zeros(target.size, dtype=np.int64))
    scaling = np.concatenate([np.full(c.size, c.scales) for c in CAUSES])
    return JointRows(f"j{number}", samples, own, shared, target, block, grams, scaling)


def drawn(seed, mass=0.0):
    """True errors: a mass, and sensors' errors from their tolerances."""
    return np.concatenate([[mass], ALL * np.random.default_rng([seed, 1]).standard_normal(5)])


def dense(rows, sigma, share, prior):
    """Mean of the joints' own parameters and all of delta: (X' W X + P)^-1 X' W z."""
    blocks = []
    for number, row in enumerate(rows):
        own = np.zeros((N, 9))
        own[:, 3 * number : 3 * number + 3] = row.own
        block = np.column_stack([own, row.shared, row.target])
        blocks.append(block * np.sqrt(share[number]) / sigma[number])
    everything = np.concatenate(blocks)
    precision = everything[:, :-1].T @ everything[:, :-1]
    precision[9:, 9:] += np.diag(1.0 / prior**2)
    return np.linalg.solve(precision, everything[:, :-1].T @ everything[:, -1])


def test_the_estimate_of_biases_is_the_textbook_posterior():
    rows = [replace(r, scaling=np.zeros(6, dtype=bool)) for r in joints(0, drawn(0, 0.5))]
    share = np.array([0.1, 0.05, 0.2])
    used, tolerance = active(CAUSES, CAUSES[:1])
    fitted = fit_stacked(rows, used, tolerance, effective=share)
    mean = dense(rows, fitted.sigma, share, tolerance)
    assert np.abs(mean[10:] / ALL).max() < CUT_OFF
    assert_allclose(fitted.delta, mean[9:], rtol=1e-4)  # the weights have settled to less
    assert_allclose(np.concatenate(fitted.beta), mean[:9], rtol=1e-4)


def test_the_estimate_minimises_the_stated_objective():
    rows = [replace(r, scaling=None) for r in joints(0, drawn(0, 0.5))]
    share = np.array([0.1, 0.05, 0.2])
    used, tolerance = active(CAUSES, CAUSES[:1])

    def objective(delta):
        total = float(np.sum((delta / tolerance) ** 2))
        for part, row in zip(share, rows, strict=True):
            target = row.target - row.shared[:, used] @ delta
            beta = np.linalg.lstsq(row.own, target, rcond=None)[0]
            total += part * N * np.log(np.sum((target - row.own @ beta) ** 2) / beta[0] ** 2)
        return total

    fitted = fit_stacked(rows, used, tolerance, effective=share)
    best = minimize(objective, fitted.delta + 0.01, method="Nelder-Mead", options={"xatol": 1e-7, "maxfev": 6000})
    assert objective(fitted.delta) <= best.fun + 1e-3  # of a standard deviation, 0.03
    assert_allclose(fitted.delta, best.x, atol=0.05 * ALL.min())


def test_shrinking_torques_and_drive_gains_together_explains_nothing():
    """One gain of all that the torque is made of: the data say nothing of it, so that its prior stays.

    Least squares in torque takes all of it away (a delta of 1); a twelfth of that is the columns' unknown noise.
    """
    rows = []
    for number, row in enumerate(joints(2, np.zeros(6), 0.0)):
        shared = row.shared.copy()
        shared[:, 5] = row.target
        rows.append(replace(rows_of(number, row.own, shared, row.target), scaling=None))
    used, tolerance = np.array([5]), np.array([0.5])
    fitted = fit_stacked(rows, used, tolerance)
    assert abs(fitted.delta[0]) < 1e-9
    assert_allclose(
        covariance(rows, fitted)[0], [[0.25 + 1.0 / 12.0]], rtol=1e-4
    )  # 2400 rows of noise against the prior


def test_the_covariance_is_the_posterior_s_where_noise_is_white():
    ratios = []
    for seed in range(10):
        rows = joints(seed, drawn(seed), correlation=0.0)
        fitted = fit_stacked(rows, *active(CAUSES, CAUSES[:1]), effective=np.ones(3))
        precision = np.diag(1.0 / fitted.tolerance**2)
        for number, row in enumerate(rows):
            rest = row.shared - row.own @ np.linalg.lstsq(row.own, row.shared, rcond=None)[0]
            precision += rest.T @ rest / NOISE[number] ** 2
        ratios.append(np.diag(covariance(rows, fitted)[0]) / np.diag(np.linalg.inv(precision)))
    # 48 half seconds a draw: the variance of one sandwich scatters by a fifth, the mean of ten by 7 %
    assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.25)


def test_a_huge_error_is_cut_off_at_three_tolerances():
    delta = np.zeros(6)
    delta[5] = 10.0
    fitted = fit_stacked(joints(3, delta), *active(CAUSES, []))
    assert_allclose(np.abs(fitted.delta[-1]), CUT_OFF * 0.5, rtol=1e-9)


@pytest.mark.parametrize("correlation", [0.9, 0.95])
def test_intervals_hold_the_truth_as_often_as_they_say(correlation):
    inside = []
    for seed in range(100):
        delta = drawn(seed, 0.3)
        rows = joints(seed, delta, correlation)
        fitted = fit_stacked(rows, *active(CAUSES, CAUSES[:1]))
        inside.append(np.abs(fitted.delta - delta) <= intervals(rows, fitted))
    share = np.mean(inside, axis=0)
    assert share[0] >= 0.90 and share[0] <= 0.99  # the mass
    assert np.all(share >= 0.88) and np.mean(share) >= 0.90  # a share of 100 scatters by 2.2 % about 0.95


def test_without_the_correlation_in_time_noise_overrules_the_prior():
    """The weights n_j/N_j: without them the sensors' errors are estimated worse than their tolerance is wide."""
    errors: list[list[float]] = [[], []]
    for seed in range(30):
        delta = drawn(seed)
        rows = joints(seed, delta, 0.99)
        for each, share in zip(errors, (None, np.ones(3)), strict=True):
            fitted = fit_stacked(rows, *active(CAUSES, []), effective=share)
            each.append(float(np.mean(((fitted.delta - delta[1:]) / ALL) ** 2)))
    assert np.mean(errors[0]) < 0.8 * np.mean(errors[1])


def test_errors_within_tolerance_are_not_named_and_others_are():
    floor = np.full(3, 0.02)
    for seed in range(20):
        rows = joints(seed, drawn(seed), 0.9)
        assert search_shared(rows, CAUSES, floor).chosen == ()
    large = drawn(3)
    large[1:3] = [6.0, -5.0]
    assert [c.key for c in search_shared(joints(3, large, 0.9), CAUSES, floor).chosen] == ["ft_bias@foot"]
    heavy = drawn(4, 1.5)
    assert [c.key for c in search_shared(joints(4, heavy, 0.9), CAUSES, floor).chosen] == ["link_mass@thigh"]


def test_a_mass_that_no_link_can_have_is_not_named():
    """A link of 1 kg cannot weigh 1.5 kg less; the interval of the mass does not reach down to 1 kg."""
    light, floor = drawn(4, 1.5), np.full(3, 0.02)
    for least, named in ((-1.0, []), (-1.49, ["link_mass@thigh"])):
        bounded = (replace(CAUSES[0], possible=(least, 10.0)), *CAUSES[1:])
        found = search_shared(joints(4, light, 0.9), bounded, floor)
        assert [c.key for c in found.chosen if c.id == "link_mass"] == named


def gain_rows(error, seed):
    """Three joints under one sensor, of whose gain 1 % is declared and `error` is true.

    The first two bear a load beside what the sensor reads, which shows its gain. The third bears nothing else, and has
    white noise: it shows the gain of the sensor and of the drive together only.
    """
    cause = Cause("ft_gain", "foot", ("force",), ("-",), slice(0, 1), (0.01,))
    time, rows = np.arange(N) * 0.01, []
    for number, (beside, noise) in enumerate([(10.0, 0.1), (6.0, 0.1), (0.0, 3.0)]):
        rng = np.random.default_rng([seed, number])
        v = np.sin(2.0 * np.pi * (0.3 + 0.1 * number) * time)
        read, rest = 40.0 * np.sin(2.0 * np.pi * 0.17 * time + number), beside * np.sin(0.8 * time + 2.0 * number)
        own = np.stack([read + rest + 20.0 * v + 15.0 * np.sign(v), -v, -np.sign(v)], axis=1)
        reading = (1.0 + error) * (read + noise * rng.standard_normal(N))
        rows.append(replace(rows_of(number, own, reading[:, None], reading + rest), scaling=np.array([True])))
    return rows, (cause,)


def test_a_gain_beyond_its_tolerance_is_named_by_the_joints_that_show_it():
    """What it leaves of them is slow, so that by the model without it they weigh a hundredth of the third joint."""
    floor = np.full(3, 0.02)
    for seed in range(5):
        rows, causes = gain_rows(0.08, seed)
        found = search_shared(rows, causes, floor)
        assert found.baseline.effective[0] < 0.03 * found.baseline.effective[2]
        assert [c.key for c in found.chosen] == ["ft_gain@foot"]
        assert_allclose(found.fit.delta, 0.08 / 1.08, rtol=0.02)
        rows, causes = gain_rows(0.0, seed)
        assert search_shared(rows, causes, floor).chosen == ()


def test_what_is_known_exactly_stays_out():
    exact = [replace(c, tolerance=tuple(0.0 for _ in c.tolerance)) for c in CAUSES]
    columns_used, _ = active(exact, [])
    assert columns_used.size == 0


def mass_errors(scaling, noise, trials=60):
    """(trials,) errors of a mass whose column resembles the load and holds no noise; z has white noise."""
    time = np.arange(600) * 0.05
    load, other = 40.0 * np.sin(1.1 * time), np.sin(2.3 * time + 1.0)
    own = np.stack([load, -other], axis=1)
    shared = np.column_stack([0.1 * load + 0.3 * np.sin(3.1 * time), np.zeros((600, 5))])
    out = []
    for seed in range(trials):
        target = load + shared[:, 0] * 0.5 + noise * np.random.default_rng(seed).standard_normal(600)
        row = replace(rows_of(0, own, shared, target), scaling=np.full(6, scaling))
        out.append(fit_stacked([row], np.array([0]), effective=np.ones(1)).delta[0] - 0.5)
    return np.array(out)


def test_a_column_without_noise_counts_in_torque():
    """In effort, noise of z that the column does not hold draws the mass by g sigma^2 over the mean of C~^2.

    1/K grows with the mass by a tenth, g = 0.1 at K = 1, and the own columns leave of C the wave of 0.3.
    """
    torque, effort = mass_errors(False, 1.0), mass_errors(True, 1.0)
    assert abs(torque.mean()) < 3.0 * torque.std(ddof=1) / np.sqrt(torque.size)
    assert_allclose(np.mean(effort - torque), -0.1 / (0.5 * 0.3**2), rtol=0.05)  # 1 % of scatter, 2 % of second order


def test_the_columns_motion_is_smoothed_three_times_as_wide():
    narrow = OffLineFilter.of(31)
    assert column_filter(narrow, 6000) == OffLineFilter.of(91)
    for samples, widest in ((40, 39), (41, 41)):  # of a short stretch, odd
        assert column_filter(narrow, samples) == OffLineFilter.of(widest)
