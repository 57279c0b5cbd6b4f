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

from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, bounds_of, fit
from drake_tc.diagnosis.selection.confirmation import (
    Confirmed,
    confirm,
    exchanged,
    heldout_against,
    left_out,
    speaks_against,
)
from drake_tc.diagnosis.selection.plausible_values import crossed_steps, objection_to_values, share_of_known_load
from drake_tc.diagnosis.thresholds import FEW_RUNS, RUN_ACTS
from drake_tc.effects.base import Context
from drake_tc.effects.library import effect

from ..rigs import Joint, Motion, record, rig_of

DECLARED = (Term(effect("viscous")), Term(effect("coulomb")))
LEAST_GAIN = 0.05
KNOWN = frozenset({"viscous", "coulomb"})
PLAIN = Joint(duration=12.0, period=4e-3, torque_noise=0.2)
BIAS, QUADRATIC = Term(effect("torque_sensor_bias")), Term(effect("quadratic_viscous"))


def offset(size: float):
    """Constant torque of this size: what a biased torque sensor looks like."""
    return lambda m: size * np.ones_like(m.q)


def drag(m: Motion) -> np.ndarray:
    return 1.5 * m.v * np.abs(m.v)


def columns_of(joints: Sequence[Joint], names: str, first: int = 0, width: float | None = None) -> Columns:
    made = [record(j, f"{names}{k}", 0.37 * (first + k), first + k) for k, j in enumerate(joints)]
    return Columns(build_samples(made, rig_of(joints[0]), "joint", width_s=width))


def confirmed(train: Sequence[Joint], held: Sequence[Joint], *added: Term, least_gain: float = LEAST_GAIN) -> Confirmed:
    """Confirm the declared model with `added`, fitted to the training runs."""
    first = columns_of(train, "train")
    beta = fit(first, DECLARED).beta
    columns = first.with_model(DECLARED, beta, servo=False)
    out = columns_of(held, "held", 10, first.samples.light.width_s).with_model(DECLARED, beta, servo=False)
    context = context_of(columns.samples, rig_of(train[0]), "joint")
    floor = fit(columns, DECLARED).gain * columns.samples.floor.torque(float(beta[0]), float(beta[1]))
    return confirm(lambda c: (columns, out, c), fit(columns, [*DECLARED, *added]), KNOWN, context, floor, least_gain)


def reasons(found: Confirmed) -> dict[str, str]:
    return {d.id: d.reason for d in found.withdrawn}


def test_an_effect_of_every_run_is_confirmed():
    joint = replace(PLAIN, extra=drag)
    found = confirmed([joint] * 3, [joint], QUADRATIC)
    assert found.withdrawn == ()
    assert [t.effect.id for t in found.fit.terms] == ["viscous", "coulomb", "quadratic_viscous"]
    assert_allclose(found.fit.beta[3], 1.5, rtol=0.1)


def test_an_effect_of_one_training_run_in_three_is_withdrawn():
    biased = replace(PLAIN, extra=offset(1.5))
    found = confirmed([biased, PLAIN, PLAIN], [biased], BIAS)
    assert reasons(found) == {"torque_sensor_bias": "training_run_against"}
    assert "train1" in found.withdrawn[0].why or "train2" in found.withdrawn[0].why
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
    why = heldout_against(samples, without, helps, 1e-3)
    assert "of train2 by" in why
    assert why.endswith("% of the block resamples.")


def test_a_curve_that_is_a_multiple_of_the_known_load_is_withdrawn():
    """A torque sensor whose scale is wrong, on a joint whose load is a spring: the load is a function of the angle."""
    load = replace(PLAIN, extra=offset(0.0))
    columns = columns_of([load] * 2, "train")
    term = Term(effect("position_dependent_load"), {"curve_start": -1.0, "curve_end": 1.0})
    design = columns.of(term)
    known = np.linalg.lstsq(design, columns.samples.reduce(columns.samples.signals.load_torque), rcond=None)[0]
    for theta, like in ((0.3 * known, True), (np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]), False)):
        made = Fit((*DECLARED, term), np.array([12.5, 6.0, 3.0, *theta]), np.zeros(1), 1.0, 1.0, np.zeros(1))
        share = share_of_known_load(made, term, columns)
        assert (share > 0.5) == like, share


@pytest.mark.parametrize(("least_gain", "stays"), [(LEAST_GAIN, True), (0.95, False)])
def test_what_an_effect_explains_is_asked_again_once_another_one_was_withdrawn(least_gain, stays):
    both = replace(PLAIN, extra=lambda m: drag(m) + 1.0)
    found = confirmed([both] * 3, [replace(PLAIN, extra=drag)], QUADRATIC, BIAS, least_gain=least_gain)
    expected = {"torque_sensor_bias": "heldout_run_against"}
    assert reasons(found) == (expected if stays else expected | {"quadratic_viscous": "no_longer_needed"})
    alone = confirmed([replace(PLAIN, extra=drag)] * 3, [replace(PLAIN, extra=drag)], QUADRATIC, least_gain=least_gain)
    assert alone.withdrawn == ()


@pytest.mark.parametrize("runs", [2, 3])
def test_an_effect_that_the_held_out_run_lacks_is_withdrawn(runs):
    biased = replace(PLAIN, extra=offset(1.0))
    found = confirmed([biased] * runs, [PLAIN], BIAS)
    assert reasons(found) == {"torque_sensor_bias": "heldout_run_against"}
    assert found.withdrawn[0].heldout_gain < 0.0
    assert "held0" in found.withdrawn[0].why


def test_one_held_out_run_is_enough_to_speak_against_it():
    """The other held-out run has twice as much of it: all together are better with the effect."""
    biased = replace(PLAIN, extra=offset(1.0))
    found = confirmed([biased] * 3, [replace(PLAIN, extra=offset(2.0), duration=24.0), PLAIN], BIAS)
    assert reasons(found) == {"torque_sensor_bias": "heldout_run_against"}
    assert found.withdrawn[0].heldout_gain > 0.0
    assert "held1" in found.withdrawn[0].why


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
    assert "N*m/rad" in found.withdrawn[0].why


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
    assert heldout_against(samples, without, once, 1e-3).endswith("% of the block resamples.")
    assert heldout_against(samples, without, once, 1e3) == ""  # it does not act
    assert heldout_against(samples, without, 0.97 * without, 1e-3) == ""


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


def made_fit(term: Term, theta: Sequence[float]) -> Fit:
    terms = (*DECLARED, term)
    return Fit(terms, np.array([12.5, 6.0, 3.0, *theta]), np.zeros(1), 1.0, 1.0, np.zeros(1))


def resolving(columns: Columns, step: float, noise: float) -> Columns:
    return Columns(replace(columns.samples, resolution=Resolution(step, noise, 0.1, 0.01)))


@pytest.fixture(scope="module")
def columns(samples) -> Columns:
    return Columns(samples)


@pytest.fixture(scope="module")
def context(samples) -> Context:
    return context_of(samples, rig_of(PLAIN), "joint")


@pytest.mark.parametrize(("step", "noise"), [(1e-5, 4e-6), (0.0, 1e-5)])
@pytest.mark.parametrize("size", [0.2, 0.9, 1.1])
def test_an_offset_of_the_encoder_must_reach_one_step_however_long_the_log(columns, context, step, noise, size):
    """An encoder that cuts off reads half a step less than one that rounds: 2 urad on steps of 10 urad is no error."""
    term = Term(effect("encoder_offset"))
    theta = np.linalg.solve(_physical(term), [size * 1e-5])
    found = objection_to_values(made_fit(term, theta), term, context, resolving(columns, step, noise))
    assert (found is None) == (size > 1.0)
    if found is not None:
        assert found[0] == "below_resolution"
        assert f"is {size * 1e-5:.2g} rad; the encoder resolves 1e-05 rad" in found[1]


STEP = 2.9e-3


def encoder_wave(amplitude: float, cycles: float = 12.0) -> Columns:
    """A position servo with a coarse encoder that errs by a wave, 3-4-5 in sine and cosine."""

    def reading(q: np.ndarray) -> np.ndarray:
        error = amplitude * (0.6 * np.sin(cycles * q) - 0.8 * np.cos(cycles * q))
        return np.round((q + error) / STEP) * STEP

    joint = replace(PLAIN, gain=2e-2, drive="current", duration=40.0)
    runs = [record(joint, f"run{k}", 0.37 * k, k) for k in range(2)]
    runs = [replace(r, columns=r.columns | {"joint/position": reading(r.columns["joint/position"])}) for r in runs]
    runs = [replace(r, steps={"joint/position": STEP}) for r in runs]
    first = Columns(build_samples(runs, rig_of(joint), "joint"))
    return first.with_model(DECLARED, fit(first, DECLARED).beta, servo=False)


@pytest.mark.parametrize(("amplitude", "resolved"), [(1.3e-3, True), (0.0, False)])
def test_a_wave_of_the_encoder_is_resolved_below_one_step(amplitude, resolved):
    columns = encoder_wave(amplitude)
    term = Term(effect("encoder_ripple"), {"cycles_per_turn": 12.0})
    found = fit(columns, [*DECLARED, term])
    context = context_of(columns.samples, rig_of(PLAIN), "joint")
    objection = objection_to_values(found, term, context, columns)
    assert (objection is None) == resolved
    if objection is not None:
        assert objection[0] == "below_resolution"
        assert "these logs resolve" in objection[1]


def with_target(columns: Columns, target: np.ndarray) -> Columns:
    return Columns(columns.samples, columns.gain, columns.floor, target)


def test_rounding_limits_a_wave_even_where_the_fit_is_exact(columns, context):
    """sigma^2 >= (step^2/12)(2/n): what least squares leaves of a wave fitted to n readings with rounding errors."""
    step = 3.0 * STEP
    exact = resolving(columns, step, 0.0)
    crossed = crossed_steps(exact.samples)
    signals = columns.samples.signals
    assert_allclose(crossed, np.abs(signals.velocity[columns.samples.rows]).sum() * columns.samples.row_period / step)
    least = 4.0 * step / np.sqrt(12.0) * np.sqrt(2.0 / crossed)
    assert 0.0 < least < 0.3 * step
    for cycles in (12.0, 2.0):  # of the second the motion, of 2 rad, covers less than a period
        term = Term(effect("encoder_ripple"), {"cycles_per_turn": cycles})
        for size in (0.9, 1.1):
            theta = np.linalg.solve(_physical(term), [0.6 * size * least, -0.8 * size * least])
            made = made_fit(term, theta)
            perfect = with_target(exact, exact.design(made.terms) @ made.beta)
            resolved = size > 1.0 and cycles == 12.0
            assert (objection_to_values(made, term, context, perfect) is None) == resolved


def _physical(term: Term) -> np.ndarray:
    """(k, k): reported values of the coefficients, which are linear in them at the gain of `made_fit`."""
    size = len(term.effect.coefficients)
    values = [term.effect.physical(row, term.shape, 0.08) for row in np.eye(size)]
    return np.array([[v[p.name] for v in values] for p in term.effect.coefficients])


def test_an_eccentricity_of_a_radian_is_impossible_however_fine_the_encoder(columns, context):
    member = effect("encoder_eccentricity")
    shape = {p.name: 1.0 for p in member.shapes}
    term = Term(member, shape)
    found = objection_to_values(made_fit(term, [0.78, 0.0]), term, context, resolving(columns, 1e-6, 1e-6))
    assert found is not None
    assert found[0] == "implausible"


@pytest.mark.parametrize(("value", "possible"), [(0.5, True), (-0.1, False)])
def test_friction_that_drives_is_impossible(columns, context, value, possible):
    found = objection_to_values(made_fit(QUADRATIC, [value]), QUADRATIC, context, columns)
    assert (found is None) == possible
