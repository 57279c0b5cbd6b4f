"""Values that an effect cannot have, and corrections of the encoder below what the logs resolve."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drake_tc.diagnosis.data.preparation import build_samples, context_of
from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.diagnosis.data.samples import Samples
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.diagnosis.selection.plausible_values import (
    crossed_steps,
    objection_to_values,
)
from drake_tc.diagnosis.selection.withdrawal import (
    BelowLeastAmplitude,
    CorrectsCurve,
    ImpossibleValues,
    NotSeenToRepeat,
    SizeMayBeZero,
)
from drake_tc.effects.base import Context
from drake_tc.effects.library import effect

from ..rigs import record, rig_of
from .runs import DECLARED, PLAIN, QUADRATIC, columns_of


@pytest.fixture(scope="module")
def samples() -> Samples:
    return columns_of([PLAIN] * 3, "train").samples


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
        assert found.reason == "below_resolution"
        assert_allclose((found.size, found.step), (size * 1e-5, 1e-5), rtol=1e-9)


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
        assert isinstance(objection, BelowLeastAmplitude)
        assert objection.amplitude < objection.least


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


@pytest.mark.parametrize(("exponent", "size", "stands"), [(2.0, 0.0, False), (2.0, 2.0, True), (1.2, 0.0, True)])
def test_a_shape_at_its_bound_needs_a_size_that_differs_from_zero(columns, context, exponent, size, stands):
    """A Stribeck friction of 0.02 N m is lost in noise of 1 N m, one of 2 N m is not; the exponent's bound is 2."""
    term = Term(effect("stribeck"), {"stribeck_velocity": 0.1, "stribeck_exponent": exponent})
    noise = np.random.default_rng(1).standard_normal(columns.target.size)
    rows = with_target(columns, columns.target - (size + 0.02) * columns.of(term)[:, 0] + noise)
    made = fit(rows, [*DECLARED, term])
    objection = objection_to_values(made, term, context, rows)
    assert (objection is None) == stands
    if objection is not None:
        assert isinstance(objection, SizeMayBeZero)
        assert objection.low <= 0.0 <= objection.high
        assert (objection.shape, objection.size) == ("stribeck_exponent", "stribeck")


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
    assert isinstance(found, ImpossibleValues)
    assert found.reason == "implausible"
    assert "0.78" in found.statement


@pytest.mark.parametrize(("value", "possible"), [(0.5, True), (-0.1, False)])
def test_friction_that_drives_is_impossible(columns, context, value, possible):
    found = objection_to_values(made_fit(QUADRATIC, [value]), QUADRATIC, context, columns)
    assert (found is None) == possible


@pytest.mark.parametrize(("periods", "beside_a_curve"), [(3.4, False), (3.6, True)])
def test_a_ripple_that_a_curve_beside_it_could_take_the_form_of_corrects_its_form(
    columns, context, periods, beside_a_curve
):
    """Seven coefficients hold waves of up to three and a half periods."""
    shape = {"curve_start": context.position_span[0], "curve_end": context.position_span[1]}
    curve = Term(effect("position_dependent_load"), shape)
    ripple = Term(effect("torque_ripple"), {"cycles_per_turn": periods / context.turns})
    alone = fit(columns, [*DECLARED, ripple])
    assert objection_to_values(alone, ripple, context, columns) is None
    both = fit(columns, [*DECLARED, curve, ripple])
    objection = objection_to_values(both, ripple, context, columns)
    assert (objection is None) == beside_a_curve
    if objection is not None:
        assert isinstance(objection, CorrectsCurve)
        assert (objection.coefficients, objection.reason) == (7, "implausible")
        assert_allclose(objection.periods, periods, rtol=1e-9)


@pytest.mark.parametrize(
    ("periods", "form", "objects"),
    [
        (1.6, np.sin, False),  # three numbers say more than the seven of a curve
        (1.6, lambda angle: np.sin(angle) + 0.5 * np.abs(angle / 4.0) ** 3, True),
        (2.1, lambda angle: np.sin(angle) + 0.5 * np.abs(angle / 4.0) ** 3, False),  # seen to repeat, whatever is left
    ],
)
def test_a_ripple_of_less_than_two_periods_must_leave_half_of_what_a_curve_leaves(periods, form, objects):
    joint = replace(PLAIN, torque_noise=0.05)
    span = np.ptp(Columns(build_samples([record(joint)], rig_of(joint), "joint")).samples.signals.position)
    cycles = 2.0 * np.pi * periods / span
    joint = replace(joint, extra=lambda m: 0.9 * form(cycles * m.q))
    samples = build_samples([record(joint, f"run{k}", 0.1 * k, k) for k in range(2)], rig_of(joint), "joint")
    columns, context = Columns(samples), context_of(samples, rig_of(joint), "joint")
    columns = columns.with_model(DECLARED, fit(columns, DECLARED).beta, servo=False)
    ripple = Term(effect("torque_ripple"), {"cycles_per_turn": cycles})
    objection = objection_to_values(fit(columns, [*DECLARED, ripple]), ripple, context, columns)
    assert (objection is not None) == objects
    assert objection is None or isinstance(objection, NotSeenToRepeat)
