"""Parameters by condition: what differs between runs, loads or directions moves, and what is constant does not."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.result.consistency import consistency, splits
from drake_tc.diagnosis.result.joint_result import ParameterByCondition
from drake_tc.effects.library import effect

from ..rigs import Joint, Motion, record, rig_of

DECLARED = (Term(effect("viscous")), Term(effect("coulomb")))
NOISY = Joint(duration=16.0, period=4e-3, torque_noise=0.3)


def fitted(joints: Sequence[Joint], seed: int = 0) -> tuple[Columns, Fit]:
    made = [record(j, f"run{k}", 0.37 * k + 0.1 * seed, 100 * seed + k) for k, j in enumerate(joints)]
    first = Columns(build_samples(made, rig_of(joints[0]), "joint"))
    columns = first.with_model(DECLARED, fit(first, DECLARED).beta, servo=False)
    return columns, fit(columns, DECLARED)


def table(joints: Sequence[Joint], seed: int = 0) -> dict[tuple[str, str, str], ParameterByCondition]:
    """By parameter and what parts the rows."""
    return {(p.effect, p.name, p.by): p for p in consistency(*fitted(joints, seed), "current")}


def moving(found: dict[tuple[str, str, str], ParameterByCondition]) -> set[tuple[str, str, str]]:
    return {key for key, p in found.items() if p.moves}


def test_a_drive_gain_that_differs_by_a_fifth_between_runs_moves_by_run():
    joints = [NOISY, replace(NOISY, gain=1.2 * NOISY.gain)]
    held = 0
    for seed in range(6):
        p = table(joints, seed)["drive", "gain", "run"]
        assert p.moves
        assert list(p.values) == ["run0", "run1"]
        assert_allclose([v[0] for v in p.values.values()], [0.08, 0.096], rtol=0.03)
        assert_allclose(p.change, 0.2 / 1.1, atol=0.03)
        held += sum(low <= j.gain <= high for j, (_, low, high) in zip(joints, p.values.values(), strict=True))
    assert held >= 10  # 95 % intervals: fewer than 10 of 12 hold the truth once in fifty


def test_a_constant_joint_moves_in_at_most_one_seed_of_twenty():
    moved = [moving(table([replace(NOISY, duration=8.0)] * 3, seed)) for seed in range(20)]
    assert sum(bool(m) for m in moved) <= 1


@pytest.mark.parametrize("seed", range(4))
def test_coulomb_friction_that_differs_between_runs_is_the_only_parameter_named(seed):
    """Alone, each of the others would be fitted apart too, as one Coulomb friction for both runs is wrong."""
    found = table([NOISY, replace(NOISY, coulomb=1.5 * NOISY.coulomb)], seed)
    assert moving(found) == {("coulomb", "coulomb", "run")}
    values = [v[0] for v in found["coulomb", "coulomb", "run"].values.values()]
    assert_allclose(values, [3.0, 4.5], rtol=0.05)
    for key, name, true in (("viscous", "viscous", 6.0), ("drive", "gain", 0.08)):
        assert_allclose([v[0] for v in found[key, name, "run"].values.values()], true, rtol=0.05)


def test_two_parameters_that_differ_between_runs_are_both_named():
    found = table([NOISY, replace(NOISY, coulomb=2.0 * NOISY.coulomb, gain=1.3 * NOISY.gain)])
    assert {key[0] for key in moving(found) if key[2] == "run"} == {"coulomb", "drive"}
    for key, name, true in (("coulomb", "coulomb", [3.0, 6.0]), ("drive", "gain", [0.08, 0.104])):
        assert_allclose([v[0] for v in found[key, name, "run"].values.values()], true, rtol=0.03)


def test_the_change_of_the_drive_gain_is_that_of_the_gain_and_not_of_its_inverse():
    gains = np.array([0.08, 0.1, 0.16])
    found = table([replace(NOISY, gain=float(gain)) for gain in gains])["drive", "gain", "run"]
    assert_allclose([v[0] for v in found.values.values()], gains, rtol=0.03)
    assert_allclose(found.change, np.ptp(gains) / gains.mean(), atol=0.03)  # of 1/K: 0.65


def test_friction_that_differs_between_directions_moves_by_direction():
    found = table([replace(NOISY, extra=lambda m: np.where(m.v > 0.0, 0.6 * m.v, -0.6 * m.v))] * 2)
    p = found["viscous", "viscous", "direction"]
    assert p.moves
    assert list(p.values) == ["backward", "forward"]
    assert_allclose([v[0] for v in p.values.values()], [5.4, 6.6], rtol=0.05)
    assert not found["viscous", "viscous", "run"].moves


def test_an_asymmetry_has_no_values_by_direction():
    """Its column is that of Coulomb friction in each direction: only rows at reversals would tell them apart."""
    columns, _ = fitted([replace(NOISY, extra=lambda m: np.full_like(m.v, 0.8))] * 2)
    final = fit(columns, (*DECLARED, Term(effect("asymmetric_friction.coulomb"))))
    found = {(p.effect, p.by) for p in consistency(columns, final, "current")}
    assert ("asymmetric_friction.coulomb", "run") in found
    assert not {("asymmetric_friction.coulomb", "direction"), ("coulomb", "direction")} & found
    assert ("viscous", "direction") in found


def test_a_gain_that_falls_with_the_load_moves_by_load():
    """Each further N m costs less current: K falls by 4 % for each N m of the load."""

    def less(m: Motion) -> np.ndarray:
        need = m.tau + NOISY.inertia * m.a + NOISY.viscous * m.v + NOISY.coulomb * np.sign(m.v)
        return -0.04 * np.abs(m.tau) * need

    found = table([replace(NOISY, extra=less)] * 2)
    p = found["drive", "gain", "load"]
    assert p.moves
    small, large = (v[0] for v in p.values.values())
    assert list(p.values) == ["small load", "large load"]
    assert small > 1.1 * large


def test_a_drive_gain_that_depends_on_the_gain_of_the_loop_moves_by_gain():
    joints = [replace(NOISY, gain=gain) for gain in (0.08, 0.1, 0.08, 0.1)]
    made = []
    for k, (joint, loop_gain) in enumerate(zip(joints, (40.0, 160.0) * 2, strict=True)):
        run = record(joint, f"run{k}", 0.37 * k, k)
        made.append(replace(run, columns=run.columns | {"joint/position_gain": np.full(run.time.size, loop_gain)}))
    columns = Columns(build_samples(made, rig_of(NOISY), "joint"))
    found = {(p.effect, p.by): p for p in consistency(columns, fit(columns, DECLARED), "current")}["drive", "gain"]
    assert found.moves and found.unit == "A/(N*m)"
    assert list(found.values) == ["40 A/rad", "160 A/rad"]
    assert_allclose([v[0] for v in found.values.values()], [0.08, 0.1], rtol=0.03)
    each_its_own = Columns(build_samples(made[:2], rig_of(NOISY), "joint"))
    assert "gain" not in {split.by for split in splits(each_its_own, "current")}  # the split by run says the same


def test_each_parts_value_is_that_of_a_regression_with_one_column_a_part():
    columns, final = fitted([NOISY, replace(NOISY, coulomb=4.0)])
    x, z, run = columns.design(final.terms), columns.target, columns.samples.run
    wide = np.column_stack([x[:, :2], x[:, 2] * (run == 0), x[:, 2] * (run == 1)])
    beta = np.linalg.lstsq(wide, z, rcond=None)[0]
    found = {(p.effect, p.by): p for p in consistency(columns, final, "current")}["coulomb", "run"]
    assert_allclose([v[0] for v in found.values.values()], beta[2:], rtol=1e-6)
    assert_allclose(found.change, abs(beta[3] - beta[2]) / np.mean(np.abs(beta[2:])), rtol=1e-6)
    assert all(low < value < high for value, low, high in found.values.values())


def test_every_row_is_in_one_part_and_parts_are_what_they_say():
    columns, _ = fitted([NOISY] * 2)
    s = columns.samples.signals.take(columns.samples.rows)
    made = {split.by: split for split in splits(columns, "current")}
    assert list(made) == ["run", "load", "direction"]
    assert_allclose(made["run"].part, columns.samples.run)
    assert_allclose(made["direction"].part, s.velocity > 0.0)
    load = np.abs(s.expected_torque)
    assert load[made["load"].part == 0].max() <= load[made["load"].part == 1].min()
    assert abs(np.mean(made["load"].part) - 0.5) < 0.01
    assert "run" not in [split.by for split in splits(fitted([NOISY])[0], "current")]


def test_parts_of_few_rows_are_left_out():
    columns, final = fitted([replace(NOISY, duration=8.0), replace(NOISY, duration=0.8)])
    assert np.bincount(columns.samples.run).min() < 200 < columns.samples.run.size
    assert "run" not in {p.by for p in consistency(columns, final, "current")}


def test_a_gain_that_one_part_does_not_identify_has_no_upper_end():
    """An interval of 1/K that reaches 0 leaves K without an upper end; it still holds its value.

    The second run's current and torque have nothing to do with each other.
    """
    columns, final = fitted([NOISY, NOISY])
    samples = columns.samples
    second = samples.run_of_sample == 1
    faint = replace(samples.signals, effort=np.where(second, 1e-2 * samples.signals.effort, samples.signals.effort))
    wander = np.cumsum(np.random.default_rng(0).standard_normal(columns.target.size))
    target = np.where(samples.run == 1, 0.1 * wander, columns.target)
    blind = Columns(replace(samples, signals=faint), columns.gain, columns.floor, target)
    found = {(p.effect, p.by): p for p in consistency(blind, final, "current")}["drive", "run"]
    value, low, high = found.values["run1"]
    assert low <= value <= high
    assert high == np.inf
