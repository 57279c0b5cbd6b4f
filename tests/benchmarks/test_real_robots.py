"""`bench real-robots`: the plain least squares it compares with, and what its table says is met."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.parameters import Estimate
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.errors import ParamsError
from tests.benchmarks.pooled_least_squares import PlainRows, fit_and_predict, fit_each_run, fit_scaled
from tests.benchmarks.real_logs import chosen_sets
from tests.benchmarks.real_robots import CASES, HeldOut, RobotCase, payload_rows, ratio_interval, rows, table_rows


def made_up(rng: np.random.Generator, size: int, noise: tuple[float, float]) -> dict[str, PlainRows]:
    """Two joints that share three identifiable combinations of five link parameters."""
    mix = np.array([[1.0, 0, 0, 0.5, 0], [0, 1, 0, 0.2, 0], [0, 0, 1, -0.3, 0]])
    pi = np.array([1.0, -2.0, 0.5, 0.3, 7.0])
    sides = {}
    for joint, (spread, own) in {"a": (noise[0], [1.0, 2, 0, 0.4]), "b": (noise[1], [3.0, 0, 0.1, -1])}.items():
        links = rng.normal(size=(size, 3)) @ mix
        columns = rng.normal(size=(size, 4))
        columns[:, 3] = 1.0
        target = links @ pi + columns @ np.array(own) + spread * rng.normal(size=size)
        sides[joint] = PlainRows(target, links, columns, links @ pi)
    return sides


def test_least_squares_without_noise_leaves_nothing_although_parameters_are_redundant() -> None:
    rng = np.random.default_rng(1)
    residual = fit_and_predict(made_up(rng, 60, (0.0, 0.0)), made_up(rng, 40, (0.0, 0.0)))
    assert_allclose(np.concatenate([*residual.values()]), 0.0, atol=1e-9)


def test_least_squares_weighs_a_noisy_joint_less() -> None:
    """With joint b useless the shared parameters are those of joint a alone, up to b's weight of 1e-8."""
    rng = np.random.default_rng(2)
    train, held = made_up(rng, 300, (0.1, 1e3)), made_up(rng, 50, (0.1, 1e3))
    both, alone = fit_and_predict(train, held), fit_and_predict({"a": train["a"]}, {"a": held["a"]})
    assert_allclose(both["a"], alone["a"], rtol=0, atol=1e-3)
    by_hand = np.linalg.pinv(np.column_stack([train["a"].links, train["a"].own])) @ train["a"].target
    expected = held["a"].target - np.column_stack([held["a"].links, held["a"].own]) @ by_hand
    assert_allclose(alone["a"], expected, rtol=0, atol=1e-9)


def test_scaled_least_squares_knows_the_file_up_to_a_factor_and_nothing_else_of_the_links() -> None:
    """A load of 0.7 times the file's is predicted exactly; one with another centre of mass is not."""
    rng = np.random.default_rng(3)
    rows = made_up(rng, 80, (0.0, 0.0))["a"]
    scaled = replace(rows, target=rows.target - 0.3 * rows.nominal)
    assert_allclose(fit_scaled(scaled, scaled), 0.0, atol=1e-9)
    moved = replace(rows, target=rows.target + rows.links[:, 1])
    assert np.sqrt(np.mean(fit_scaled(moved, moved) ** 2)) > 0.2


def joint(name: str, plain: float, after: float) -> HeldOut:
    block, same = np.array([0, 0, 1, 1]), np.full(4, plain)
    left = np.full(4, after)
    return HeldOut(name, 1.0, same, 2.0 * same, same, left, 0.5 * left, 0.2 * left, (), block, 0.25 * plain)


def test_the_table_pools_torque_and_flags_a_joint_above_least_squares() -> None:
    case = RobotCase("set", "case", (9.0, 8.0))
    rows = {row.name: row for row in table_rows(case, [joint("a", 4.0, 3.0), joint("b", 0.1, 0.2)])}
    assert rows["set/case/a/ratio_pooled"].met is True and rows["set/case/b/ratio_pooled"].met is False
    assert rows["set/case/a/ratio_scaled"].met is None
    assert_allclose(rows["set/case/a/ratio_scaled"].value, 0.375)
    assert_allclose(rows["set/case/all_joints/ratio_pooled"].value, np.sqrt(9.04 / 16.01))
    assert rows["set/case/all_joints/ratio_pooled"].met is True
    assert_allclose(rows["set/case/all_joints/mean_ratio"].value, np.sqrt(0.75 * 2.0))
    assert "README, pooled, in its own filter: 9" in rows["set/case/a/pooled"].note
    assert rows["set/case/a/each_run_own"].value == 1.5
    assert_allclose(rows["set/case/a/in_view"].value, 0.6)
    assert_allclose(rows["set/case/all_joints/in_view"].value, 0.2 * np.sqrt(9.04 / 16.01))
    assert rows["set/case/a/over_before"].value == 0.75 and "0.25 of" in rows["set/case/a/over_before"].note


def test_runs_that_differ_in_friction_alone_are_explained_by_their_own() -> None:
    """Two runs with other coefficients leave their noise, whatever its size."""
    rng = np.random.default_rng(4)
    columns, run = rng.normal(size=(4000, 4)), np.repeat([0, 1], 2000)
    own = np.where(run == 0, columns @ [1.0, 0.2, 0.0, 0.1], columns @ [-0.5, 0.3, 0.1, 0.0])
    rows, samples = PlainRows(own, columns, columns, own), cast(Samples, SimpleNamespace(run=run))
    for spread in (0.01, 1.0):  # eight coefficients take 0.1 % of 4000 rows' noise, whose RMS scatters by 1.1 %
        left = fit_each_run(rows, samples, own + spread * rng.normal(size=4000))
        assert_allclose(np.std(left), spread, rtol=0.05)


def test_the_goal_is_against_the_kind_of_least_squares_that_the_readme_has() -> None:
    rows = {row.name: row for row in table_rows(RobotCase("set", "case", scaled=True), [joint("a", 4.0, 5.0)])}
    assert rows["set/case/a/ratio_scaled"].met is True and rows["set/case/a/ratio_pooled"].met is None
    assert rows["set/case/all_joints/ratio_scaled"].met is True


def test_the_interval_of_a_ratio_holds_the_ratio_of_the_spreads_in_19_of_20_draws() -> None:
    held = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        common = rng.normal(size=400)
        plain = common + 0.3 * rng.normal(size=400)
        after = 0.9 * common + 0.3 * rng.normal(size=400)
        low, high = ratio_interval(after, plain, np.arange(400) // 4 + 7)
        held += low <= np.sqrt((0.81 + 0.09) / 1.09) <= high
    assert held >= 52  # fewer have a probability of 1 % at 95 %
    assert ratio_interval(plain, plain, np.arange(400) // 4) == (1.0, 1.0)


def test_the_payload_is_met_within_three_percent() -> None:
    mass = Estimate(2.75, "kg", (2.7, 2.8), False)
    result = cast(CloseLoopResult, SimpleNamespace(links=FittedLinks((), (), {"run": {"m": mass}})))
    (row,) = payload_rows(RobotCase("set", "case", payload="run"), result)
    assert row.met is True and row.value == 2.75
    assert payload_rows(RobotCase("set", "case"), result) == []


def test_every_case_is_one_of_the_committed_ones() -> None:
    known = {(entry.name, case.name) for entry in chosen_sets() for case in entry.cases}
    assert {(case.data_set, case.case) for case in CASES} <= known


def test_an_unknown_set_is_refused(tmp_path):
    with pytest.raises(ParamsError, match=r"no data set 'ur10e' with a robot.*; sets: dfki-double-pendulum, .*ur10e-c"):
        rows(tmp_path, ["ur10e"])
