"""What other joints leave open of the links: one joint beside it has the solution of all joints together."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import FOLDS
from drake_tc.diagnosis.problem.shared import open_directions as module
from drake_tc.diagnosis.problem.shared.open_directions import NEGLIGIBLE, open_directions
from drake_tc.diagnosis.problem.shared.rows import JointRows
from drake_tc.diagnosis.problem.shared.stacked import fit_stacked

N, P, JOINTS = 400, 5, 3
TOLERANCE = np.array([0.5, 0.3, 1.0, 0.7, 0.4])
NOISE = np.array([0.2, 0.05, 0.1])
EFFECTIVE = np.array([0.5, 0.2, 1.0])
HELD = 2.5


def rows_of(number, *, held=True, blind=()):
    rng = np.random.default_rng([7, number])
    own, shared = rng.normal(size=(N, 2)), rng.normal(size=(N, P))
    shared[:, list(blind)] = 0.0
    delta = np.random.default_rng(8).normal(size=P) * TOLERANCE
    target = own @ [1.0, -0.5] + shared @ delta + NOISE[number] * rng.normal(size=N)
    block = (np.arange(N) // 20).astype(np.int64)
    return made(f"j{number}", own, shared, target, block, HELD if held else None)


def made(name, own, shared, target, block, held):
    fold = (block // 2) % FOLDS
    every = np.column_stack([own, shared, target])
    grams = np.stack([every[fold == f].T @ every[fold == f] for f in range(FOLDS)])
    samples = SimpleNamespace(run=np.zeros(N, dtype=np.int64))
    return JointRows(name, samples, own, shared, target, block, grams, np.ones(P, dtype=bool), held)


def dense(rows, fitted):
    """Own coefficients of all joints and delta: least squares with the prior, in one matrix."""
    weights = np.sqrt(fitted.effective) / fitted.sigma
    parts = []
    for number, row in enumerate(rows):
        own = np.zeros((N, 2 * len(rows)))
        own[:, 2 * number : 2 * number + 2] = row.own
        parts.append(np.column_stack([own, row.shared, row.target]) * weights[number])
    prior = np.column_stack([np.zeros((P, 2 * len(rows))), np.diag(1.0 / TOLERANCE), np.zeros(P)])
    matrix = np.concatenate([*parts, prior])
    return np.linalg.lstsq(matrix[:, :-1], matrix[:, -1], rcond=None)[0]


def beside(row, opened, fitted):
    """Least squares of one joint at the common estimate, beside the columns left open with their prior."""
    columns = row.shared @ opened.mix  # an effect's columns stand on the other side of the balance
    design = np.column_stack([row.own, -columns])
    rest = row.target - row.shared @ fitted.delta
    size = opened.mix.shape[1]
    gram = design.T @ design + np.diag([0.0, 0.0, *np.full(size, opened.prior.precision)])
    moment = design.T @ rest + np.concatenate([[0.0, 0.0], opened.prior.precision * opened.prior.mean])
    found = np.linalg.solve(gram, moment)
    return found[:2], fitted.delta - opened.mix @ found[2:]


@pytest.fixture
def every_direction(monkeypatch):
    """Keeps the directions that a joint hardly sees, so that the solutions are equal and not only nearly so."""
    monkeypatch.setattr(module, "NEGLIGIBLE", 0.0)


@pytest.mark.usefixtures("every_direction")
def test_one_joint_beside_what_is_open_has_the_posterior_of_all_joints():
    rows = [rows_of(number) for number in range(JOINTS)]
    fitted = fit_stacked(rows, np.arange(P), TOLERANCE, effective=EFFECTIVE)
    for number, row in enumerate(rows):
        opened = open_directions(rows, fitted)[f"j{number}"]
        assert opened.mix.shape == (P, P)
        beta, delta = beside(row, opened, fitted)
        solution = dense(rows, fitted)
        assert_allclose(beta, solution[2 * number : 2 * number + 2], rtol=1e-6)
        assert_allclose(delta, solution[2 * JOINTS :], rtol=1e-6, atol=1e-9)


@pytest.mark.usefixtures("every_direction")
def test_it_still_has_once_the_joint_has_an_effect_that_the_common_estimate_did_not_know():
    rows = [rows_of(number) for number in range(JOINTS)]
    fitted = fit_stacked(rows, np.arange(P), TOLERANCE, effective=EFFECTIVE)
    opened = open_directions(rows, fitted)["j1"]
    changed = replace(rows[1], target=rows[1].target + 0.3 * rows[1].shared[:, 2] + 0.2 * rows[1].own[:, 0])
    beta, delta = beside(changed, opened, fitted)
    solution = dense([rows[0], changed, rows[2]], fitted)
    assert_allclose(beta, solution[2:4], rtol=1e-6)
    assert_allclose(delta, solution[2 * JOINTS :], rtol=1e-6, atol=1e-9)


def test_directions_that_a_joint_does_not_see_are_left_out():
    rows = [rows_of(0), rows_of(1, blind=(0, 3, 4)), rows_of(2)]
    fitted = fit_stacked(rows, np.arange(P), TOLERANCE, effective=EFFECTIVE)
    opened = open_directions(rows, fitted)
    assert opened["j1"].mix.shape[1] <= 2
    for number, each in enumerate(opened.values()):
        columns = rows[number].shared @ each.mix
        assert (np.sqrt(np.mean(columns**2, axis=0)) > NEGLIGIBLE * fitted.sigma[number]).all()
        beta = beside(rows[number], each, fitted)[0]
        error = rows[number].own @ (beta - dense(rows, fitted)[2 * number : 2 * number + 2])
        assert np.sqrt(np.mean(error**2)) < 0.05 * fitted.sigma[number]  # a few directions of 0.02 each


def test_a_held_drive_gain_takes_no_part_in_the_fit():
    rows = [rows_of(number) for number in range(JOINTS)]
    fitted = fit_stacked(rows, np.arange(P), TOLERANCE, effective=EFFECTIVE)
    assert_allclose(np.concatenate([*fitted.beta, fitted.delta]), dense(rows, fitted), rtol=1e-4)  # weights settle
    for row, beta in zip(rows, fitted.beta, strict=True):
        assert row.stiffness(beta) == HELD
        assert not row.stiffness_response(np.ones((2, P))).any()
    free = rows_of(0, held=False)
    assert free.stiffness(np.array([1.5, 0.0])) == 1.5
    assert_allclose(free.stiffness_response(np.arange(2.0 * P).reshape(2, P)), np.arange(float(P)))
    # with the gain held, errors are told in effort by that gain
    half = [replace(r, held=2.0 * HELD) for r in rows]
    again = fit_stacked(half, np.arange(P), TOLERANCE, effective=EFFECTIVE)
    assert_allclose(again.cv_rms, 0.5 * fitted.cv_rms, rtol=1e-9)
