"""What a chosen effect must withstand: possible values, the sensor's resolution, every training and held-out run."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from drake_tc.diagnosis.data.preparation import context_of
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.regression import bounds_of, fit
from drake_tc.diagnosis.selection.confirmation import Confirmed, confirm, exchanged, left_out
from drake_tc.diagnosis.selection.runs_against import heldout_against, speaks_against
from drake_tc.diagnosis.selection.withdrawal import (
    ImpossibleValues,
    LargerOnHeldOut,
    TrainingRunAgainst,
    UncertainOnHeldOut,
)
from drake_tc.diagnosis.thresholds import FEW_RUNS, RUN_ACTS
from drake_tc.effects.library import effect

from ..rigs import Joint, record, rig_of
from .runs import BIAS, DECLARED, LEAST_GAIN, PLAIN, QUADRATIC, columns_of, drag, offset


def confirmed(train: Sequence[Joint], held: Sequence[Joint], *added: Term, least_gain: float = LEAST_GAIN) -> Confirmed:
    """Confirm the declared model with `added`, fitted to the training runs."""
    first = columns_of(train, "train")
    beta = fit(first, DECLARED).beta
    columns = first.with_model(DECLARED, beta, servo=False)
    out = columns_of(held, "held", 10, first.samples.light.width_s).with_model(DECLARED, beta, servo=False)
    context = context_of(columns.samples, rig_of(train[0]), "joint")
    floor = fit(columns, DECLARED).gain * columns.samples.floor.torque(float(beta[0]), float(beta[1]))
    baseline, chosen = fit(columns, DECLARED), fit(columns, [*DECLARED, *added])
    return confirm(lambda c: (columns, out, c), chosen, baseline, context, floor, least_gain)


def reasons(found: Confirmed) -> dict[str, str]:
    return {d.id: d.reason for d in found.withdrawn}


def test_an_effect_of_every_run_is_confirmed():
    joint = replace(PLAIN, extra=drag)
    found = confirmed([joint] * 3, [joint], QUADRATIC)
    assert found.withdrawn == ()
    assert [t.effect.id for t in found.fit.terms] == ["viscous", "coulomb", "quadratic_viscous"]
    assert_allclose(found.fit.beta[3], 1.5, rtol=0.1)


def test_effects_that_raise_the_training_error_by_one_drive_gain_leave_the_declared_model():
    """The held-out run likes a bias that the training runs do not have: the coefficients are those of the former."""
    biased = replace(PLAIN, extra=offset(1.5))
    columns = columns_of([PLAIN] * 3, "train")
    out = columns_of([biased], "held", 10, columns.samples.light.width_s)
    baseline, chosen = fit(columns, DECLARED), fit(columns, [*DECLARED, BIAS])
    bent = replace(chosen, beta=fit(out, [*DECLARED, BIAS]).beta)
    context = context_of(columns.samples, rig_of(PLAIN), "joint")
    found = confirm(
        lambda c: (columns, out, bent if len(c.terms) == 3 else c), chosen, baseline, context, 0.01, LEAST_GAIN
    )
    assert reasons(found) == {"torque_sensor_bias": "worse_than_declared"}
    assert found.fit is baseline


def test_an_effect_of_one_training_run_in_three_is_withdrawn():
    biased = replace(PLAIN, extra=offset(1.5))
    found = confirmed([biased, PLAIN, PLAIN], [biased], BIAS)
    assert reasons(found) == {"torque_sensor_bias": "training_run_against"}
    assert found.withdrawn[0].objection in (TrainingRunAgainst("train1"), TrainingRunAgainst("train2"))
    assert [t.effect.id for t in found.fit.terms] == ["viscous", "coulomb"]
    assert_allclose(found.fit.beta, fit(found.train, DECLARED).beta, rtol=1e-9)


def test_an_effect_of_one_training_run_in_two_is_withdrawn():
    assert FEW_RUNS == 3
    biased = replace(PLAIN, extra=offset(1.5))
    found = confirmed([biased, PLAIN], [biased], BIAS)
    assert reasons(found) == {"torque_sensor_bias": "training_run_against"}


def test_a_single_training_run_speaks_against_nothing():
    biased = replace(PLAIN, extra=offset(1.5))
    assert reasons(confirmed([biased], [biased], BIAS)) == {}


def test_an_effect_exchanged_between_two_runs_is_fitted_on_the_other_one():
    """One coefficient beside the fixed rest: theta = theta_fit - phi'e/phi'phi over the other run, nearly."""
    columns = columns_of([PLAIN, replace(PLAIN, extra=drag)], "train")
    chosen = fit(columns, [*DECLARED, QUADRATIC])
    left = columns.target - columns.design(chosen.terms) @ chosen.beta
    phi, run = columns.of(QUADRATIC)[:, 0], columns.samples.run
    out = exchanged(columns, chosen, QUADRATIC)
    for r in range(2):
        others = run != r
        change = -(phi[others] @ left[others]) / (phi[others] @ phi[others])
        rows = run == r
        assert_allclose(out[rows], left[rows] + phi[rows] * change, atol=5e-3 * np.abs(phi[rows] * change).max())


def test_a_level_of_a_curve_that_the_other_run_does_not_reach_stays_as_fitted():
    columns = columns_of([PLAIN] * 2, "train")
    spring = Term(effect("position_dependent_load"), {"curve_start": -50.0, "curve_end": 50.0})
    chosen = fit(columns, [*DECLARED, QUADRATIC, spring])
    assert np.abs(exchanged(columns, chosen, spring)).max() < 10.0 * np.abs(columns.target).max()


@pytest.mark.parametrize(("size", "speaks"), [(49, False), (50, True)])
def test_a_run_of_few_rows_does_not_speak(size, speaks):
    made = SimpleNamespace(run=np.zeros(size, int), block=np.arange(size) // 2, runs=("run",))
    found = speaks_against(cast(Samples, made), np.ones(size), np.full(size, 2.0), 1e-6)
    assert found == ("run" if speaks else "")


def test_each_held_out_run_must_confirm_and_not_only_all_of_them(samples):
    """Of three runs the effect helps greatly in two; in the third its gain is that of one loud half second."""
    without = np.ones(samples.rows.size)
    last = samples.run == 2
    first = last & (samples.block == samples.block[last][0])
    without[first] = 3.0
    helps = np.where(last, 1.003, 0.5)
    helps[first] = 2.0
    assert np.mean(helps[last] ** 2) < np.mean(without[last] ** 2)
    against = heldout_against(samples, without, helps, 1e-3)
    assert isinstance(against, UncertainOnHeldOut)
    assert (against.run, against.least) == ("train2", 0.9)
    assert 0.0 < against.certain < against.least


@pytest.mark.parametrize(("least_gain", "stays"), [(LEAST_GAIN, True), (0.95, False)])
def test_what_an_effect_explains_is_asked_again_once_another_one_was_withdrawn(least_gain, stays):
    both = replace(PLAIN, extra=lambda m: drag(m) + 1.0)
    found = confirmed([both] * 3, [replace(PLAIN, extra=drag)], QUADRATIC, BIAS, least_gain=least_gain)
    expected = {"torque_sensor_bias": "heldout_run_against"}
    assert reasons(found) == (expected if stays else expected | {"quadratic_viscous": "no_longer_needed"})
    alone = confirmed([replace(PLAIN, extra=drag)] * 3, [replace(PLAIN, extra=drag)], QUADRATIC, least_gain=least_gain)
    assert alone.withdrawn == ()


def test_an_effect_that_the_others_explain_is_withdrawn():
    """A search may add a sensor's gain while it looks for the drag, and keep it beside the drag that explains all."""
    joint = replace(PLAIN, extra=drag)
    found = confirmed([joint] * 3, [joint], Term(effect("torque_sensor_gain")), QUADRATIC)
    assert reasons(found) == {"torque_sensor_gain": "superfluous"}
    assert [t.effect.id for t in found.fit.terms] == ["viscous", "coulomb", "quadratic_viscous"]


@pytest.mark.parametrize("runs", [2, 3])
def test_an_effect_that_the_held_out_run_lacks_is_withdrawn(runs):
    biased = replace(PLAIN, extra=offset(1.0))
    found = confirmed([biased] * runs, [PLAIN], BIAS)
    assert reasons(found) == {"torque_sensor_bias": "heldout_run_against"}
    assert found.withdrawn[0].heldout_gain < 0.0
    objection = found.withdrawn[0].objection
    assert isinstance(objection, LargerOnHeldOut)
    assert objection.run == "held0"
    assert objection.growth > 0.0


def test_one_held_out_run_is_enough_to_speak_against_it():
    """The other held-out run has twice as much of it: all together are better with the effect."""
    biased = replace(PLAIN, extra=offset(1.0))
    found = confirmed([biased] * 3, [replace(PLAIN, extra=offset(2.0), duration=24.0), PLAIN], BIAS)
    assert reasons(found) == {"torque_sensor_bias": "heldout_run_against"}
    assert found.withdrawn[0].heldout_gain > 0.0
    objection = found.withdrawn[0].objection
    assert isinstance(objection, LargerOnHeldOut)
    assert objection.run == "held1"


def test_a_run_in_which_the_effect_does_not_act_does_not_speak():
    """Quadratic friction is nothing at a tenth of the speed: that run neither has nor lacks it."""
    joint = replace(PLAIN, extra=drag)
    slow = record(joint, "slow", 5.0)
    still = replace(slow, columns={n: 1e-3 * x if "position" in n else x for n, x in slow.columns.items()})
    assert np.ptp(still.columns["joint/position"]) < 0.01
    samples = columns_of([joint] * 2, "train").samples
    floor = 1.0
    without = np.where(samples.run == 1, 0.5, 2.0)
    with_it = without + np.where(samples.run == 1, 0.99 * RUN_ACTS * floor, -1.0)
    assert speaks_against(samples, without, with_it, floor) == ""
    with_it = without + np.where(samples.run == 1, 1.01 * RUN_ACTS * floor, -1.0)
    assert speaks_against(samples, without, with_it, floor) == "train1"


def test_an_impossible_value_comes_before_all_other_reasons():
    """A spring that pushes the joint away from its middle."""
    pushes = replace(PLAIN, extra=lambda m: -6.0 * m.q + 1.5)
    spring = Term(effect("cable_spring"))
    found = confirmed([pushes] * 3, [PLAIN], spring)
    assert reasons(found)["cable_spring"] == "implausible"
    objection = found.withdrawn[0].objection
    assert isinstance(objection, ImpossibleValues)
    assert "N*m/rad" in objection.statement


def test_effects_are_withdrawn_one_by_one_and_the_rest_fitted_anew():
    both = replace(PLAIN, extra=lambda m: drag(m) + 1.0)
    found = confirmed([both] * 3, [replace(PLAIN, extra=drag)], QUADRATIC, BIAS)
    assert reasons(found) == {"torque_sensor_bias": "heldout_run_against"}
    assert [t.effect.id for t in found.fit.terms] == ["viscous", "coulomb", "quadratic_viscous"]
    assert_allclose(found.fit.beta, fit(found.train, [*DECLARED, QUADRATIC]).beta, rtol=1e-9)


def test_declared_effects_are_not_questioned():
    """No Coulomb friction in the held-out run: the owner declared it all the same."""
    found = confirmed([PLAIN] * 3, [replace(PLAIN, coulomb=0.0)])
    assert found.withdrawn == ()
    assert len(found.fit.terms) == 2


def test_a_left_out_run_is_predicted_by_the_fit_to_the_others():
    columns = columns_of([PLAIN, replace(PLAIN, viscous=9.0), replace(PLAIN, gain=0.1)], "train")
    terms = [*DECLARED, QUADRATIC]
    x, z, run = columns.design(terms), columns.target, columns.samples.run
    low, _ = bounds_of(terms)
    out = left_out(columns, terms)
    for r in range(3):
        beta = np.linalg.lstsq(x[run != r], z[run != r], rcond=None)[0]
        assert np.all(beta >= low)  # so that plain least squares is the solution
        assert_allclose(out[run == r], (z - x @ beta)[run == r], atol=1e-6)


@pytest.fixture(scope="module")
def samples() -> Samples:
    return columns_of([PLAIN] * 3, "train").samples


@settings(max_examples=30, deadline=None)
@given(st.floats(1e-6, 1e6), st.sampled_from([-1.0, 1.0]), st.integers(0, 5))
def test_who_speaks_against_depends_on_neither_unit_nor_sign(samples, scale, sign, seed):
    rng = np.random.default_rng(seed)
    without = rng.standard_normal(samples.rows.size)
    with_it = without + rng.uniform(-0.8, 0.8, 3)[samples.run]
    factor = sign * scale
    plain = speaks_against(samples, without, with_it, 1.0)
    assert speaks_against(samples, factor * without, factor * with_it, scale) == plain


def test_a_loss_that_chance_may_have_made_does_not_count(samples):
    """One loud half second of twenty: in a third of the resamples it is not drawn."""
    without = np.ones(samples.rows.size)
    with_it = np.where(samples.run == 0, 0.9, without)
    first = samples.block == samples.block[samples.run == 0][0]
    with_it = np.where(first, 3.0, with_it)
    assert np.mean(with_it[samples.run == 0] ** 2) > 1.0
    assert speaks_against(samples, without, with_it, 0.01, certain=0.9) == ""
    assert speaks_against(samples, without, with_it, 0.01, certain=0.0) == "train0"


def test_a_held_out_gain_that_chance_may_have_made_does_not_confirm(samples):
    """The effect helps in one loud half second alone, which a third of the resamples lack, or a little everywhere."""
    without = np.ones(samples.rows.size)
    without[samples.block == samples.block[0]] = 3.0
    once = np.where(samples.run == 0, 1.003, 1.0)
    once[samples.block == samples.block[0]] = 2.0
    assert np.mean(once**2) < np.mean(without**2)
    assert isinstance(heldout_against(samples, without, once, 1e-3), UncertainOnHeldOut)
    assert heldout_against(samples, without, once, 1e3) is None  # it does not act
    assert heldout_against(samples, without, 0.97 * without, 1e-3) is None


def chance_vetoes(memory: float, blocks: int = 240, trials: int = 200) -> float:
    """Share of trials in which a run speaks against an effect that changes its error by chance alone.

    The squared error changes by an AR(1) series of coefficient `memory` over the half-second blocks, of mean 0.
    """
    rng = np.random.default_rng(5)
    run = cast(Samples, SimpleNamespace(run=np.zeros(blocks, int), block=np.arange(blocks), runs=("run",)))
    against = 0
    for _ in range(trials):
        noise = rng.standard_normal(blocks + 200)
        change = lfilter([1.0], [1.0, -memory], noise)[200:]
        without = np.full(blocks, 10.0)
        against += bool(speaks_against(run, without, np.sqrt(without**2 + change), 1e-6))
    return against / trials


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.8])
def test_chance_seldom_speaks_against_an_effect_however_long_its_memory(memory):
    """2 % are asked for, and few stretches make it a little more. Blocks drawn one by one make it 20 % at 0.8."""
    assert chance_vetoes(memory) <= 0.08
