"""What the plots show: bins, frames, reversals, periods, and the effect's own share of the residual."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import fit, predict
from drake_tc.diagnosis.residual.unexplained import TimeStretch
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.effects.library import all_effects, effect
from drake_tc.report.html import model_diff
from drake_tc.report.plots.residual_plots import contribution, signature_quantity
from drake_tc.report.plots.rows import LABELS, binned, evenly, frame, modulo, near_reversal, quantity, rows_of

PERIOD = 2e-3


def test_bins_give_medians_and_quartiles_of_a_known_law() -> None:
    rng = np.random.default_rng(0)
    x = rng.exponential(size=40_000)
    found = binned(x, 3.0 * x + rng.uniform(-1.0, 1.0, x.size), 20)
    near = found.x < 2.0  # narrow bins, so that x hardly changes within one
    assert_allclose(found.middle[near], 3.0 * found.x[near], atol=0.1)
    assert_allclose((found.high - found.low)[near], 1.0, atol=0.35)  # quartiles of a uniform of width 2


@pytest.mark.parametrize("size", [0, 5, 9])
def test_few_points_make_few_bins(size: int) -> None:
    values = np.arange(float(size))
    assert binned(values, values).x.size == size // 8


def test_bins_skip_what_is_not_finite() -> None:
    x = np.arange(100.0)
    y = np.where(x < 50, np.nan, 7.0)
    assert_allclose(binned(x, y, 4).middle, 7.0, rtol=1e-15)


@pytest.mark.parametrize("scattered", [0, 20])
def test_no_bin_lies_across_a_gap(scattered: int) -> None:
    """The two sides of a step never share a bin, also where a few points on one side belong to a bin of the other."""
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.uniform(-1.0, -0.2, scattered or 1003), rng.uniform(0.2, 1.0, 1010)])
    found = binned(x, np.sign(x), 24)
    known = np.isfinite(found.x)
    assert np.count_nonzero(~known) == (0 if scattered else 1)
    assert_allclose(found.low[known], found.high[known], rtol=0.0, atol=0.0)


def test_thinning_keeps_both_ends() -> None:
    index = evenly(100_000, 3000)
    assert (index[0], index[-1], index.size) == (0, 99_999, 3000)
    assert np.all(np.diff(index) > 0)
    assert evenly(7).tolist() == list(range(7))


def test_an_outlier_does_not_set_the_frame_but_the_floor_does() -> None:
    y = np.concatenate([np.random.default_rng(1).uniform(-1.0, 1.0, 10_000), [500.0]])
    low, high = frame(y)
    assert -1.3 < low < -1.0
    assert 1.0 < high < 2.0
    assert frame(y, 3.0)[1] > 3.0
    assert frame(np.zeros(0)) == (-1.0, 1.0)
    assert frame(np.zeros(4))[0] < 0.0 < frame(np.zeros(4))[1]


def test_rows_near_a_reversal_by_brute_force(joint: JointResult) -> None:
    samples = joint.train.samples
    sign = np.sign(samples.signals.direction)
    expected = np.zeros(samples.rows.size, dtype=bool)
    for s in samples.segments:
        turns = [i for i in range(s.start + 1, s.stop) if sign[i] != sign[i - 1]]
        for k, row in enumerate(samples.rows):
            if s.start <= row < s.stop:
                expected[k] = any(-50 <= row - t < 50 for t in turns)
    assert 0.0 < expected.mean() < 1.0
    assert np.array_equal(near_reversal(samples, 0.1), expected)


def test_no_direction_crosses_the_velocity(joint: JointResult) -> None:
    rows = rows_of(joint.heldout)
    velocity = joint.heldout.samples.signals.velocity[joint.heldout.samples.rows]
    assert np.mean(rows.direction == np.sign(velocity)) > 0.99


def test_an_unrecorded_signal_has_no_plot(joint: JointResult) -> None:
    assert quantity(joint.heldout, "temperature", "A") is None
    assert quantity(joint.heldout, "effort", "A").label == "effort [A]"  # type: ignore[union-attr]


def test_runs_follow_each_other_and_stretches_with_them(joint: JointResult) -> None:
    stretches = (TimeStretch("wide", 1.0, 2.0), TimeStretch("elsewhere", 0.0, 1.0))
    time = quantity(joint.train, "time", "A", stretches)
    assert time is not None
    assert_allclose(time.marks, [12.0 - PERIOD], atol=1e-9)
    assert_allclose(time.shaded, [(13.0 - PERIOD, 14.0 - PERIOD)], atol=1e-9)
    assert np.all(np.diff(time.values) > 0.0)


def test_position_modulo_the_ripple(joint: JointResult) -> None:
    found = modulo(joint.heldout, 20.0)
    position = joint.heldout.samples.signals.position[joint.heldout.samples.rows]
    assert found.values.min() >= 0.0
    assert found.values.max() <= 18.0
    assert_allclose(np.cos(np.radians(found.values) * 20.0), np.cos(20.0 * position), atol=1e-9)
    ripple = next(e for e in joint.effects if e.id == "torque_ripple")
    assert signature_quantity(joint.heldout, joint, ripple).key == "modulo-20"  # type: ignore[union-attr]


def test_an_effects_share_is_what_deleting_its_coefficients_costs(joint: JointResult) -> None:
    columns = Columns(joint.heldout.samples)
    for at, key in ((slice(3, 4), "stribeck"), (slice(4, 6), "torque_ripple")):
        beta = joint.final.beta.copy()
        beta[at] = 0.0
        without = predict(columns, replace(joint.final, beta=beta))
        assert_allclose(joint.heldout.after + contribution(joint.heldout, joint.final, key), without, atol=1e-12)


def test_a_drive_effects_share_is_what_leaving_its_transform_out_costs(joint: JointResult) -> None:
    columns = Columns(joint.train.samples)
    lagging = fit(columns, [*joint.final.terms, Term(effect("current_lag"), {"lag": 0.02})])
    without = predict(columns, replace(lagging, terms=lagging.terms[:-1]))
    side = replace(joint.train, after=lagging.residual)
    share = contribution(side, lagging, "current_lag")
    assert np.std(share) > 0.0
    assert_allclose(side.after + share, without, atol=1e-9)


def test_the_difference_can_be_applied() -> None:
    before, after = "a\nb\nc\nd\n", "a\nx\nc\nd\ne\n"
    lines = model_diff(before, after, context=10)
    assert [x["text"] for x in lines if x["kind"] in ("kept", "added")] == after.split()
    assert [x["text"] for x in lines if x["kind"] in ("kept", "removed")] == before.split()
    assert model_diff(before, before) == []


def test_every_signal_of_a_signature_has_a_label():
    drawn = {each.signature.x for each in all_effects()}
    assert {x for x in drawn if not x.startswith("position modulo")} <= set(LABELS)
