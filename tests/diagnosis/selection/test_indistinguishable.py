"""What the data cannot tell apart is listed; what merely contains the chosen effect is not."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.problem.columns import Term
from drake_tc.diagnosis.problem.regression import fit
from drake_tc.diagnosis.selection import indistinguishable as module
from drake_tc.diagnosis.selection.joint_problem import Search, share_better
from drake_tc.diagnosis.thresholds import CERTAINLY_BETTER
from drake_tc.effects.base import Parameter, Plausible, Signature, TorqueEffect
from drake_tc.effects.library import LIBRARY, effect

from ..rigs import Joint, Problem, floor_of, problem

JOINT = Joint(torque_noise=0.25, extra=lambda m: 0.8 * np.ones_like(m.q))


class Twin(TorqueEffect):
    """The bias under another name: the same column."""

    id = "twin"
    title = "twin"
    kind = "load"
    coefficients = (Parameter("twin", "N*m"),)
    signature = Signature("time", "", "nothing")
    linear = True

    def columns(self, signals, shape):
        return -np.ones((len(signals), 1))


class Superset(Twin):
    """The bias and a column that explains nothing."""

    id = "superset"
    coefficients = (Parameter("level", "N*m"), Parameter("useless", "N*m"))

    def columns(self, signals, shape):
        wave = np.sin(2 * np.pi * 0.9 * signals.time)
        return np.stack([-np.ones(len(signals)), wave], axis=-1)


class Stranger(Twin):
    """A column of its own."""

    id = "stranger"

    def columns(self, signals, shape):
        return signals.position[:, None] ** 3


@pytest.fixture(scope="module")
def biased() -> Problem:
    return problem(JOINT, runs=2)


def ties_with(p: Problem, library) -> tuple[tuple[str, str], ...]:
    chosen = fit(p.columns, [*p.declared, Term(effect("torque_sensor_bias"))])
    return module.indistinguishable(p.columns, Search(p.baseline, chosen), p.context, floor_of(p), library)


def test_two_identical_columns_are_a_tie(biased):
    assert ties_with(biased, [Twin(), Stranger()]) == (("torque_sensor_bias", "twin"),)


@pytest.mark.parametrize(("sign", "listed"), [(1.0, False), (-1.0, True)])
def test_an_effect_with_impossible_values_is_no_alternative(biased, sign, listed):
    value = fit(biased.columns, [*biased.declared, Term(Twin())]).beta[-1]

    class Positive(Twin):
        """The twin with a range; its value is that of the twin times -sign."""

        id = "positive" if listed else "negative"
        coefficients = (Parameter("level", "N*m", plausible=Plausible(0.0, 10.0, "it only adds")),)

        def columns(self, signals, shape):
            return sign * np.sign(value) * np.ones((len(signals), 1))

    assert (ties_with(biased, [Positive()]) == (("torque_sensor_bias", Positive.id),)) == listed


def test_a_nested_superset_is_no_tie(biased):
    assert ties_with(biased, [Superset(), Stranger()]) == ()


@pytest.mark.parametrize(
    ("size", "special_case", "listed"), [(0.01, "", False), (0.08, "", True), (0.08, "torque_sensor_bias", False)]
)
def test_a_larger_effect_that_fits_certainly_better_is_listed_unless_it_contains_the_chosen_one(
    size, special_case, listed
):
    """The smaller one is chosen where the errors agree within 2 %, although the logs speak for the other."""

    class Larger(Superset):
        """The bias, and a column that explains a little."""

        id = "larger"

        def columns(self, signals, shape):
            return np.stack([-np.ones(len(signals)), signals.position**3], axis=-1)

    Larger.special_case = special_case
    weak = problem(replace(JOINT, extra=lambda m: 0.8 + size * m.q**3), runs=2)
    assert (ties_with(weak, [Larger()]) == (("torque_sensor_bias", "larger"),)) == listed


def test_of_the_library_only_a_constant_in_motion_is_a_biass_twin(biased):
    pairs = ties_with(biased, LIBRARY)
    assert {p[0] for p in pairs} <= {"torque_sensor_bias"}
    # the Coulomb form of the one is 1 wherever the joint moves, the other one everywhere
    assert {p[1] for p in pairs} <= {"asymmetric_friction", "effort_bias"}


def test_nothing_found_leaves_nothing_to_tie(biased):
    nothing = Search(biased.baseline, biased.baseline)
    assert module.indistinguishable(biased.columns, nothing, biased.context, floor_of(biased)) == ()


def test_a_weak_effect_that_another_imitates_within_the_noise_is_a_tie():
    class Neighbour(Twin):
        """The bias, 20 % more of it at the largest angles."""

        id = "neighbour"

        def columns(self, signals, shape):
            return -(1.0 + 0.2 * np.tanh(3.0 * signals.position))[:, None]

    weak = problem(replace(JOINT, extra=lambda m: 0.05 * np.ones_like(m.q), torque_noise=1.0), seed=3)
    strong = problem(replace(JOINT, extra=lambda m: 3.0 * np.ones_like(m.q), torque_noise=0.1))
    assert ties_with(weak, [Neighbour()]) == (("torque_sensor_bias", "neighbour"),)
    assert ties_with(strong, [Neighbour()]) == ()


class Odd(Twin):
    """A constant that differs from the bias by a third of a noise floor's worth at the largest angles."""

    id = "odd"

    def columns(self, signals, shape):
        return -(1.0 + 0.05 * np.tanh(3.0 * signals.position))[:, None]


@pytest.mark.parametrize(
    ("chosen", "other", "listed"),
    [("current_lag", "delay", True), ("delay", "current_lag", True), ("delay", "odd", False), ("one", "odd", False)],
)
def test_a_delay_and_a_lag_are_told_apart_by_half_a_noise_floor(chosen, other, listed):
    """The better one is certainly better in the resamples: for any other two effects that decides."""
    p = problem(Joint(torque_noise=0.3, duration=120.0, extra=lambda m: 0.8 * np.ones_like(m.q)))
    terms = {name: Term(type(name, (base,), {"id": name})()) for name, base in ((chosen, Twin), (other, Odd))}
    small, large = (fit(p.columns, [*p.declared, terms[name]]) for name in (other, chosen))
    assert share_better(small, large) >= CERTAINLY_BETTER
    assert 0.1 * floor_of(p) < np.sqrt(small.cv_rms**2 - large.cv_rms**2) < 0.5 * floor_of(p)
    effects = (terms[other].effect,)
    pairs = module.indistinguishable(p.columns, Search(p.baseline, large), p.context, floor_of(p), effects)
    assert pairs == (((chosen, other),) if listed else ())


@pytest.mark.parametrize(("corrected", "plain", "tie"), [(1.3, 0.95, True), (1.05, 1.3, True), (1.3, 1.3, False)])
def test_a_lag_and_a_delay_tie_where_their_order_rests_on_the_noise_of_the_effort(corrected, plain, tie):
    """The chosen one leaves 1 with the noise charged and without; half a noise floor of 1 more makes 1.118."""
    assert module._within_resolution(np.ones((1, 2)), np.array([[corrected, plain]]), 1.0) is tie


def test_one_run_that_tells_a_lag_from_a_delay_is_enough():
    other = np.array([[1.05, 1.05], [1.0, 1.0], [1.3, 1.3]])
    assert module._within_resolution(np.ones((3, 2)), other, 1.0) is False
    assert module._within_resolution(np.ones((2, 2)), other[:2], 1.0) is True


def test_the_errors_of_the_runs_are_those_of_all_rows_together(biased):
    fitted = fit(biased.columns, [*biased.declared, Term(effect("torque_sensor_bias"))])
    whole, *runs = module._errors(fitted, biased.columns)
    rows = np.bincount(biased.columns.samples.run)
    assert len(runs) == 2
    np.testing.assert_allclose(whole**2, rows @ np.square(runs) / rows.sum(), rtol=1e-9)


@pytest.mark.parametrize(("form", "listed"), [(np.sin, True), (lambda angle: np.abs(angle / 3.0) ** 3, False)])
def test_a_wave_that_was_not_seen_to_repeat_is_listed_beside_the_curve_that_stands_for_it(form, listed):
    """1.3 periods of a ripple, between two points of its grid; a load of another form is no wave."""
    span = np.ptp(problem(JOINT).columns.samples.signals.position)
    cycles = 1.3 * 2.0 * np.pi / span
    p = problem(Joint(torque_noise=0.02, extra=lambda m: 0.9 * form(cycles * m.q)), runs=2)
    start, end = p.context.position_span
    curve = Term(effect("position_dependent_load"), {"curve_start": start, "curve_end": end})
    found = Search(p.baseline, fit(p.columns, [*p.declared, curve]))
    pairs = module.indistinguishable(p.columns, found, p.context, floor_of(p), [effect("torque_ripple")])
    assert (("position_dependent_load", "torque_ripple") in pairs) == listed


@pytest.mark.parametrize(
    ("chosen", "other", "tie"),
    [(1.05, 1.35, False), (1.3, 1.6, True), (1.3, 2.2, False)],
    ids=["the better one fits", "neither fits", "one leaves much more"],
)
def test_a_delay_and_a_lag_tie_where_neither_is_the_whole_cause(chosen, other, tie):
    """Errors in noise floors; the difference alone would count as an effect."""
    fits = [np.full((2, 2), each) for each in (chosen, other)]
    assert module._within_resolution(*fits, 1.0) is tie
