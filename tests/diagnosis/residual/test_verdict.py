"""The verdict follows from what is left: exactly at the thresholds, from both splits, with or without effects."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.diagnose import joint_model
from drake_tc.diagnosis.evidence import Evidence
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.problem.regression import fit, noise_floor
from drake_tc.diagnosis.residual.over_time import loud_stretches
from drake_tc.diagnosis.residual.unexplained import SEVERITY, DataSplit, Unexplained
from drake_tc.diagnosis.residual.verdict import verdict_of, visible_share, what_is_left
from drake_tc.diagnosis.result.errors import run_errors
from drake_tc.effects.library import effect

from ..rigs import Joint, problem, record, rig_of

DECLARED = (Term(effect("viscous")), Term(effect("coulomb")))
JOINT = Joint(duration=20.0, period=4e-3, torque_noise=0.25)
LEFT = Unexplained(1.0, 1.0, False, 0.01, 0.0, False, ())


@pytest.mark.parametrize("found", [False, True])
def test_structure_comes_before_excess_and_excess_before_effects(found):
    assert verdict_of(replace(LEFT, structured=True, excess=True), found=found) == "unexplained_structure"
    assert verdict_of(replace(LEFT, structured=True), found=found) == "unexplained_structure"
    assert verdict_of(replace(LEFT, excess=True), found=found) == "unexplained_residual"
    assert verdict_of(LEFT, found=found) == ("effects_found" if found else "no_missing_effect")


def test_a_rig_has_the_gravest_verdict_of_its_joints():
    made = {verdict_of(replace(LEFT, structured=s, excess=e), found=f) for s in (0, 1) for e in (0, 1) for f in (0, 1)}
    assert made == set(SEVERITY) - {"cannot_tell"}  # which needs no residual: the logs show too little
    assert len(set(SEVERITY)) == len(SEVERITY)
    assert SEVERITY[0] == "unexplained_structure"
    assert SEVERITY[-1] == "no_missing_effect"


@pytest.fixture(scope="module")
def columns() -> tuple[Columns, Columns]:
    rig = rig_of(JOINT)
    train = build_samples([record(JOINT, "one"), record(JOINT, "two", 0.9, 1)], rig, "joint")
    held = build_samples([record(JOINT, "held", 2.3, 2)], rig, "joint", width_s=train.light.width_s)
    return Columns(train), Columns(held)


def splits(columns: tuple[Columns, Columns], train: float, held: float) -> tuple[DataSplit, DataSplit]:
    """White residuals of these RMS [effort]; before, three times as much."""
    made = []
    for k, (each, rms) in enumerate(zip(columns, (train, held), strict=True)):
        noise = np.random.default_rng(k).standard_normal(each.target.size)
        noise *= rms / np.sqrt(np.mean(noise**2))
        made.append(DataSplit(each.samples, 3.0 * noise, noise))
    return made[0], made[1]


@pytest.mark.parametrize(
    ("train", "held", "excess"),
    [pytest.param(2.9, 2.9, False, marks=pytest.mark.slow), (3.1, 2.9, True), (2.9, 3.1, True)],
)
def test_white_residuals_are_judged_by_their_floors_on_both_splits(columns, train, held, excess):
    chosen = fit(columns[0], DECLARED)
    context = replace(context_of(columns[0].samples, rig_of(JOINT), "joint"), load="pendulum")
    left, floor, notes = what_is_left(splits(columns, train, held), chosen, 1.0, context, DiagnosisOptions())
    assert_allclose((left.floors, left.floors_anywhere), (held, max(train, held)), rtol=1e-9)
    assert (left.structured, left.excess) == (False, excess)
    assert notes == ()
    assert_allclose(floor, 1.0, rtol=1e-9)  # of a current without noise, rounding alone
    effort = columns[1].samples.signals.effort[columns[1].samples.rows]
    assert_allclose(left.share_of_signal, held / np.sqrt(np.mean(effort**2)), rtol=1e-9)


@pytest.mark.parametrize(("loud", "excess"), [pytest.param(1.0, False, marks=pytest.mark.slow), (4.5, True)])
def test_quiet_held_out_runs_do_not_excuse_a_loud_one(columns, loud, excess):
    """Five held-out runs at one floor, one of them perhaps at 4.5: 2.2 floors all together."""
    rig, train = rig_of(JOINT), columns[0]
    runs = [record(JOINT, f"held_{k}", 2.3, 2 + k) for k in range(5)]
    held = build_samples(runs, rig, "joint", width_s=train.samples.light.width_s)
    made = splits((train, Columns(held)), 1.0, 1.0)
    louder = np.where(held.run == 3, loud, 1.0)
    made = made[0], DataSplit(held, 3.0 * louder * made[1].after, louder * made[1].after)
    context = replace(context_of(train.samples, rig, "joint"), load="pendulum")
    left, _, _ = what_is_left(made, fit(train, DECLARED), 1.0, context, DiagnosisOptions())
    assert left.floors < 2.5
    assert left.excess == excess
    assert_allclose(left.floors_anywhere, loud, rtol=0.1)


def test_what_is_not_assessed_is_not_flagged(columns):
    chosen = fit(columns[0], DECLARED)
    context = context_of(columns[0].samples, rig_of(JOINT), "joint")
    options = DiagnosisOptions(assess_residual=False)
    left, floor, _ = what_is_left(splits(columns, 9.0, 9.0), chosen, 1.0, context, options)
    assert (left.structured, left.excess, floor) == (False, False, 1.0)


def test_what_could_have_been_seen_is_an_effort_of_four_standard_deviations_or_half_a_floor():
    """Of the coefficient of a column that is the whitened effort itself: a log likelihood of 4^2/2."""
    prepared = prepare_joint([record(JOINT, "one")], [record(JOINT, "held", 2.3, 2)], rig_of(JOINT), "joint")
    evidence = Evidence(joint_model(prepared))
    evidence = evidence.tempered(evidence.model.declared)
    scored, train = evidence.score(evidence.model.declared), evidence.model.train
    effort = train.recorded.effort(())
    size = np.sqrt(np.mean(effort[train.rows.index] ** 2))
    white = train.rows.whitened((effort / size)[:, None], evidence.noise)[0][:, 0]
    deviation = np.sqrt(scored.posterior.variance / np.sum(white**2))  # of that coefficient alone
    seen = visible_share(evidence, scored, 0.0) * evidence.model.scale
    assert_allclose(seen, 4.0 * deviation, rtol=1e-9)
    loud = 100.0 * seen
    assert_allclose(visible_share(evidence, scored, loud) * evidence.model.scale, 0.5 * loud, rtol=1e-9)


def test_the_floor_counts_the_inertia_that_was_found():
    """A rotor inertia of the model lets J k'' of the encoder's noise through, declared or found."""
    p = problem(replace(JOINT, inertia=0.0, torque_noise=0.0, encoder_noise=1e-4))
    found = fit(p.columns, [*DECLARED, Term(effect("rotor_inertia"))])
    sum_of_both = p.samples.floor.torque(float(found.beta[0]), float(found.beta[1]), 0.8)
    with_08 = replace(found, beta=np.array([*found.beta[:3], 0.8]))
    assert_allclose(noise_floor(p.columns, with_08), sum_of_both / found.beta[0], rtol=1e-9)
    assert noise_floor(p.columns, with_08) > 2.0 * noise_floor(p.columns, fit(p.columns, DECLARED))


def test_errors_by_run_are_those_of_its_rows(columns):
    made = splits(columns, 2.0, 5.0)
    found = list(run_errors(made))
    assert [(e.run, e.heldout) for e in found] == [("one", False), ("two", False), ("held", True)]
    for e in found:
        split = made[int(e.heldout)]
        after = split.after[split.samples.run == split.samples.runs.index(e.run)]
        assert e.rows == after.size
        assert_allclose((e.after, e.mean_absolute_after), (np.sqrt(np.mean(after**2)), np.mean(abs(after))), rtol=1e-9)
        assert_allclose((e.before, e.mean_absolute_before), (3 * e.after, 3 * e.mean_absolute_after), rtol=1e-9)
    pooled = sum(e.rows * e.after**2 for e in found[:2]) / sum(e.rows for e in found[:2])
    assert_allclose(np.sqrt(pooled), 2.0, rtol=1e-9)


def touched(split: DataSplit, start: float, end: float, size: float, run: int = 0) -> DataSplit:
    time = split.samples.signals.time[split.samples.rows]
    inside = (time >= start) & (time < end) & (split.samples.run == run)
    sign = np.where(np.arange(time.size) % 2 == 0, 1.0, -1.0)
    return replace(split, after=split.after + np.where(inside, size * sign, 0.0))


def test_a_touch_is_one_stretch_of_its_run(columns):
    split = touched(splits(columns, 1.0, 1.0)[0], 6.0, 8.0, 15.0, run=1)
    found = loud_stretches(split, 3.0, 2.0)
    assert {s.run for s in found} == {"two"}
    assert_allclose((found[0].start, found[-1].end), (6.0, 8.0), atol=0.5)  # half-second blocks
    assert loud_stretches(split, 3.0, 40.0) == ()  # less than what matters
    assert loud_stretches(splits(columns, 1.0, 1.0)[0], 3.0, 0.0) == ()


def test_what_is_loud_for_a_third_of_the_time_is_not_confined(columns):
    split = splits(columns, 1.0, 1.0)[0]
    for run in (0, 1):
        split = touched(split, 4.0, 12.0, 15.0, run)
    assert loud_stretches(split, 3.0, 2.0) == ()


def test_a_few_rows_at_a_reversal_are_no_touch(columns):
    """A block whose RMS is loud by five rows alone: the median of its absolute residual is as ever."""
    split = splits(columns, 1.0, 1.0)[0]
    block = split.samples.block
    size = np.bincount(block).max()
    rows = np.flatnonzero(np.isin(block, np.flatnonzero(np.bincount(block) == size)[:3]))
    after = split.after.copy()
    after[rows[:: max(2, size // 5)]] = 60.0
    assert loud_stretches(replace(split, after=after), 3.0, 2.0) == ()


@settings(max_examples=25, deadline=None)
@given(st.floats(1e-6, 1e6), st.sampled_from([-1.0, 1.0]))
def test_stretches_depend_on_neither_unit_nor_sign(columns, unit, sign):
    split = touched(splits(columns, 1.0, 1.0)[0], 6.0, 8.0, 15.0)
    scaled = replace(split, after=sign * unit * split.after)
    assert loud_stretches(scaled, 3.0, 2.0 * unit) == loud_stretches(split, 3.0, 2.0) != ()
