"""Stacked balances of made-up joints: least squares against a dense solution, selection, what is no evidence."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import FOLDS
from drake_tc.diagnosis.problem.shared.causes import Cause
from drake_tc.diagnosis.problem.shared.covariance import intervals, own_response
from drake_tc.diagnosis.problem.shared.gain_dilution import dilution, shared_variance, stiffness_to_hold
from drake_tc.diagnosis.problem.shared.rows import JointRows, fold_grams
from drake_tc.diagnosis.problem.shared.stacked import fit_stacked
from drake_tc.diagnosis.selection.shared import SharedProblem, search_shared

N, P = 1500, 6
NOISE = (0.1, 0.3, 0.05)
TRUE = np.array([0.8, -0.5])
CAUSES = (
    Cause("ft_bias", "a", ("one", "two"), ("N", "N"), slice(0, 2)),
    Cause("link_mass", "b", ("mass",), ("kg",), slice(2, 3)),
    Cause("ft_gain", "c", ("all",), ("-",), slice(3, 4)),
    Cause("link_com", "d", ("x", "y"), ("m", "m"), slice(4, 6)),
)


def joint(number, seed, delta, only=None, lonely=False):
    """Rows of one joint: own columns [effort, -v, -sign v], causes' columns, target with the shared part."""
    rng = np.random.default_rng([seed, number])
    t = np.arange(N) * 0.01
    v = np.sin(2.0 * np.pi * (0.3 + 0.1 * number) * t)
    load = 4.0 * np.sin(2.0 * np.pi * 0.17 * t + number) + 2.0 * rng.standard_normal()
    effort = load + 2.0 * v + 1.5 * np.sign(v)
    shared = np.stack([np.cos(2.0 * np.pi * (0.05 + 0.13 * k) * t + number + k) for k in range(P)], axis=1)
    if lonely and number:
        shared[:, 2] = 0.0
    target = load + NOISE[number] * rng.standard_normal(N)
    if only is None or number == only:
        target = target + shared[:, : delta.size] @ delta
    shared[:, 3] = target  # the cause that could explain everything away by shrinking it
    own = np.stack([effort, -v, -np.sign(v)], axis=1)
    block = (np.arange(N) // 50).astype(np.int64)
    every = np.column_stack([own, shared, target])
    fold = (block // 2) % FOLDS
    grams = np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)])
    samples = SimpleNamespace(run=np.zeros(N, dtype=np.int64))
    scaling = np.array([False, False, False, True, False, False])
    return JointRows(f"j{number}", samples, own, shared, target, block, grams, scaling)


def joints(seed=0, delta=TRUE, **kind):
    return [joint(number, seed, delta, **kind) for number in range(3)]


def test_a_prior_of_own_coefficients_is_that_of_ridge_regression():
    """Rows sqrt(p) below X with the target 0, of a precision p, are the same least squares, and the same response."""
    precision = np.array([0.0, 40.0, 0.0])
    with_prior = [
        replace(r, precision=precision, grams=fold_grams(r.own, r.shared, r.target, r.block, precision))
        for r in joints()
    ]
    fitted = fit_stacked(with_prior, np.zeros(0, dtype=np.int64))
    response = own_response(with_prior[0], replace(fitted, columns=np.array([0, 1])))
    for row, beta in zip(with_prior, fitted.beta, strict=True):
        below = np.vstack([row.own, np.diag(np.sqrt(precision))])
        expected = np.linalg.lstsq(below, np.append(row.target, np.zeros(3)), rcond=None)[0]
        assert_allclose(beta, expected, rtol=1e-9)
    below = np.vstack([with_prior[0].own, np.diag(np.sqrt(precision))])
    shared = np.vstack([with_prior[0].shared[:, :2], np.zeros((3, 2))])
    assert_allclose(response, np.linalg.lstsq(below, shared, rcond=None)[0], rtol=1e-9)


def test_elimination_equals_the_dense_solution():
    rows = joints()
    columns = np.array([0, 1, 4])
    fitted = fit_stacked(rows, columns)
    # the same weighted least squares in one matrix, at the weights of the last round but one
    before = fit_stacked(rows, columns, sigma=fit_stacked(rows, columns).sigma)
    weights = np.sqrt(before.effective) / before.sigma
    blocks = []
    for number, row in enumerate(rows):
        own = np.zeros((N, 9))
        own[:, 3 * number : 3 * number + 3] = row.own
        blocks.append(np.column_stack([own, row.shared[:, columns], row.target]) * weights[number])
    dense = np.concatenate(blocks)
    solution = np.linalg.lstsq(dense[:, :-1], dense[:, -1], rcond=None)[0]
    assert_allclose(fitted.delta, solution[9:], rtol=1e-5)  # weights settled to 1e-6
    assert_allclose(np.concatenate(fitted.beta), solution[:9], rtol=1e-5)
    assert_allclose(fitted.sigma, NOISE, rtol=0.08)  # 1500 rows: 1.8 % a standard deviation


def test_a_joint_whose_torque_falls_with_the_effort_at_first_does_not_stop_the_others():
    """By the robot's file the second joint's load has the wrong sign; the first one tells the parameter."""
    rng = np.random.default_rng(4)
    t = np.arange(N) * 0.01
    rows = []
    for number, factor in enumerate((0.2, 1.5)):
        v = np.cos(2.0 * np.pi * (0.3 + 0.1 * number) * t)
        load = (4.0, 0.5)[number] * np.sin(2.0 * np.pi * 0.17 * t + number)
        cause = factor * np.where(number == 0, np.sin(0.9 * t), -load)[:, None]
        effort = load + 2.0 * v + 1.5 * np.sign(v) + 0.02 * rng.standard_normal(N)
        own = np.stack([effort, -v, -np.sign(v)], axis=1)
        target = load + cause[:, 0]
        block = (np.arange(N) // 50).astype(np.int64)
        every = np.column_stack([own, cause, target])
        fold = (block // 2) % FOLDS
        grams = np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)])
        samples = SimpleNamespace(run=np.zeros(N, dtype=np.int64))
        rows.append(JointRows(f"j{number}", samples, own, cause, target, block, grams, np.array([True])))
    nominal = fit_stacked(rows, np.zeros(0, dtype=np.int64))
    assert nominal.beta[1][0] < 0.0
    fitted = fit_stacked(rows, np.array([0]), np.array([2.0]))
    assert_allclose(fitted.delta, [1.0], atol=0.01)  # 0.02 N m on 1500 rows of 0.14 N m: 0.004
    assert_allclose([beta[0] for beta in fitted.beta], [1.0, 1.0], rtol=0.02)


def test_the_bounds_of_a_drive_gain_hold_the_truth_where_the_effort_is_noisy():
    """Least squares leaves r^2 of 1/K = 2, in closed form noise over signal; a declared gain is not in doubt."""
    rng = np.random.default_rng(7)
    size, noise = 200_000, 0.8
    v, load = rng.standard_normal((2, size))
    effort = (load + 0.5 * v) / 2.0 + 0.5 * noise * rng.standard_normal(size)
    own, shared = np.stack([effort, -v], axis=1), np.zeros((size, 1))
    block = np.arange(size) // 50
    grams = np.zeros((FOLDS, 4, 4))
    row = JointRows("j", SimpleNamespace(), own, shared, load, block, grams)
    fitted = SimpleNamespace(columns=np.array([0]), delta=np.zeros(1), effective=np.ones(1))
    share = 1.0 / (1.0 + noise**2)
    assert_allclose(shared_variance(row, fitted, 0), share, rtol=0.01)  # 200000 rows: 0.3 %
    assert_allclose(dilution(row, fitted, 0), noise**2, rtol=0.02)
    found = np.linalg.lstsq(own, load, rcond=None)[0]
    assert_allclose(found * (1.0 + dilution(row, fitted, 0)), [2.0, 0.5], rtol=0.02)
    assert_allclose(stiffness_to_hold(row, SimpleNamespace(**vars(fitted), beta=(found,)), 0), found[0])  # r^2 0.61
    louder = replace(row, own=np.stack([effort + rng.standard_normal(size), -v], axis=1))
    assert_allclose(stiffness_to_hold(louder, fitted, 0), 2.0, rtol=0.02)  # r^2 0.18
    assert 0.0 < stiffness_to_hold(replace(row, target=-load), fitted, 0) < np.inf
    assert dilution(replace(row, held=2.0), fitted, 0) == 0.0
    assert shared_variance(replace(row, target=-load), fitted, 0) == 0.0


def test_intervals_hold_the_truth_as_often_as_they_say():
    inside = 0
    for seed in range(40):
        rows = joints(seed)
        fitted = fit_stacked(rows, np.array([0, 1]))
        inside += int(np.sum(np.abs(fitted.delta - TRUE) <= intervals(rows, fitted)))
    assert 70 <= inside <= 80  # of 80 at 95 %: mean 76, below 70 in one of 500


def test_the_cause_of_all_joints_is_found_alone():
    found = search_shared(joints(), CAUSES, np.full(3, 0.05))
    assert [c.key for c in found.chosen] == ["ft_bias@a"]
    assert_allclose(found.fit.delta, TRUE, atol=0.02)


def test_nothing_is_found_in_noise():
    for seed in range(5):
        found = search_shared(joints(seed, delta=np.zeros(2)), CAUSES, np.full(3, 0.05))
        assert found.chosen == ()


def test_what_one_joint_has_is_no_shared_cause():
    for only in range(3):
        found = search_shared(joints(1, only=only), CAUSES[:1], np.full(3, 0.05))
        assert found.chosen == ()


def test_a_cause_that_reaches_one_joint_only_needs_another_joint():
    rows = joints(2, delta=np.array([0.0, 0.0, 1.0]), lonely=True)
    assert search_shared(rows, CAUSES[1:2], np.full(3, 0.05)).chosen == ()


def test_shrinking_the_torques_explains_nothing():
    rows = joints(3, delta=np.zeros(2))
    plain, shrunk = fit_stacked(rows, np.zeros(0, dtype=np.int64)), fit_stacked(rows, np.array([3]))
    torque = [np.linalg.lstsq(np.column_stack([r.own, r.shared[:, 3]]), r.target, rcond=None)[1] for r in rows]
    assert np.concatenate([*torque, [0.0]]).max() < 1e-9  # least squares in torque takes it for an explanation
    assert_allclose(shrunk.cv_rms, plain.cv_rms, rtol=0.01)
    assert search_shared(rows, CAUSES[2:3], np.full(3, 0.05)).chosen == ()


def test_half_shrunk_torques_are_told_at_their_drive_gain():
    rows = joints(4, delta=np.zeros(2))
    plain = fit_stacked(rows, np.zeros(0, dtype=np.int64))
    scaled = [replace(r, target=0.5 * r.target, grams=_scaled(r.grams, 0.5)) for r in rows]
    half = fit_stacked(scaled, np.zeros(0, dtype=np.int64))
    assert_allclose(half.sigma, 0.5 * plain.sigma, rtol=1e-9)
    assert_allclose(half.cv_rms, plain.cv_rms, rtol=1e-9)


def _scaled(grams, factor):
    """Grams of [X, C, factor z]."""
    scale = np.ones(grams.shape[1])
    scale[-1] = factor
    return grams * np.outer(scale, scale)


@pytest.mark.parametrize("name", ["link_mass", "link_com", "ft_bias", "ft_gain", "imu_bias"])
def test_parameters_say_what_the_truth_has_more(name):
    cause = Cause(name, "x", ("p",), ("-",), slice(0, 1))
    physical = cause.physical(np.array([0.1]))[0]
    wanted = {"link_mass": -0.1, "link_com": -0.1, "ft_bias": 0.1, "imu_bias": 0.1, "ft_gain": 1.0 / 0.9 - 1.0}
    assert_allclose(physical, wanted[name], rtol=1e-12)


def test_a_fit_is_offered_without_each_of_its_new_causes():
    problem = SharedProblem(joints(), CAUSES, CAUSES, np.full(3, 0.05))
    small, large = problem.with_causes(CAUSES[:1]), problem.with_causes(CAUSES[:3])
    rest = list(problem.without_each(large, small))
    assert [[c.id for c in fit.causes] for fit in rest] == [["ft_bias", "ft_gain"], ["ft_bias", "link_mass"]]
    assert_allclose(rest[0].fit.delta, problem.with_causes([CAUSES[0], CAUSES[2]]).fit.delta)


def test_pooled_rows_weigh_alike_and_as_many_as_before():
    """A joint with a slow remainder counts no less than its neighbours; all rows together count as they did."""
    rows = joints()
    slow = np.cumsum(np.random.default_rng(3).standard_normal(N))
    rows[1] = replace(rows[1], target=rows[1].target + 0.3 * slow / np.std(slow))
    every = np.column_stack([rows[1].own, rows[1].shared, rows[1].target])
    fold = (rows[1].block // 2) % FOLDS
    rows[1] = replace(rows[1], grams=np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)]))
    each, pooled = (fit_stacked(rows, np.array([0, 1]), np.array([2.0, 2.0]), pooled=p) for p in (False, True))
    assert each.effective[1] < 0.2 * each.effective[[0, 2]].min()
    assert_allclose(each.share, each.effective)
    assert_allclose(pooled.share, pooled.effective.mean())  # of as many rows each
    assert_allclose(pooled.effective, each.effective, rtol=0.05)
