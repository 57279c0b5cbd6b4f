"""A tick always has a finite torque, within its budget, and its status says what it is: every measure, every use."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import drake_tc.models
from drake_tc.robot.plant import joint_limits
from drake_tc.tsid import tick as module
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.controller import RobustTsid
from drake_tc.tsid.fused import LARGEST
from drake_tc.tsid.law import PreviousTick, Status
from drake_tc.tsid.qp import Outcome
from drake_tc.tsid.robust.scaled import Budget, Options, TorqueError, p_box, p_ind
from drake_tc.tsid.tick import TickInput, problem_at, solve_tick

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
BOTH = (True, True)
PAIRS = [
    (measure, use)
    for measure in ("classic", "individual", "box", "rectangle")
    for use in ("trade_off", "constraint", "null_space")
]


@pytest.fixture(scope="module")
def law():
    return load_law(FILE)


def of(law, measure="individual", use="trade_off", share=0.003, **values):
    error = TorqueError((share * joint_limits(law.model.robot).effort) ** 2)
    return replace(law, error=error, formulation=replace(law.formulation, measure=measure, use=use, **values))


def rests(law):
    return [task.rest(law.starting_terms()) for task in law.tasks]


def state_of(law, q=0.0, v=0.0, rng=None):
    rng = np.random.default_rng(0) if rng is None else rng
    state = np.concatenate((law.model.start, np.zeros(law.model.nv)))
    state[7:37] += q * rng.normal(size=30)
    state[43:] += v * rng.normal(size=30)
    return state


def nothing_before(law):
    return PreviousTick(np.zeros(law.model.n), None)


def finite(tick):
    return all(np.isfinite(part).all() for part in (tick.torque, tick.acceleration, tick.force, tick.status))


@pytest.mark.parametrize(("measure", "use"), PAIRS)
def test_no_numbers_raise_or_let_a_nan_out(law, measure, use):
    """Random states, references, sigmas, weights and bounds, far beyond what can be met, one tick after the other."""
    rng = np.random.default_rng(PAIRS.index((measure, use)))
    scratch = law.model.create_scratch()
    for _ in range(8):
        some = of(
            law,
            measure,
            use,
            share=10.0 ** rng.uniform(-5, -0.3),
            minimum=10.0 ** rng.uniform(-8, 1.5),
            weight=10.0 ** rng.uniform(-12, 8),
            options=Options(budget=Budget(100)),
        )
        before, size = nothing_before(law), 10.0 ** rng.uniform(-2, 0)
        for _ in range(3):
            references = rests(law)
            references[0][:3] += 0.3 * size * rng.normal(size=3)
            active = tuple(bool(one) for one in rng.random(2) < 0.9)
            tick = solve_tick(
                some, scratch, TickInput(state_of(law, 0.1 * size, 0.3 * size, rng), references, active), before
            )
            assert finite(tick)
            before = PreviousTick(tick.torque, tick.start)


@pytest.mark.parametrize("measure", ["individual", "rectangle"])
def test_a_weight_that_ran_away_is_no_start(law, measure):
    """What an R_min far from all that can be had leaves behind does not spoil the next tick."""
    some = of(law, measure, "constraint", minimum=0.05)
    scratch = law.model.create_scratch()
    good = solve_tick(some, scratch, TickInput(state_of(law), rests(law), BOTH), nothing_before(law))
    for weight in (1e-316, 1e-43, 1e43):
        before = PreviousTick(good.torque, good.start._replace(weight=weight))
        tick = solve_tick(some, scratch, TickInput(state_of(law), rests(law), BOTH), before)
        assert tick.status[Status.OUTCOME] == Outcome.SOLVED
        assert tick.status[Status.ROBUSTNESS] <= 0.05 * (1.0 + 1e-5)
        assert tick.start.weight == 0.0 or 1e-44 < tick.start.weight < 1e44  # 0: the bound is not active


@pytest.mark.parametrize("minimum", [1e-4, 1e-6, 1e-7])
def test_a_small_bound_that_can_be_had_is_had(law, minimum):
    some = of(law, use="constraint", minimum=minimum)
    scratch, rng = law.model.create_scratch(), np.random.default_rng(1)
    for _ in range(3):
        tick = solve_tick(
            some, scratch, TickInput(state_of(law, 0.01, 0.05, rng), rests(law), BOTH), nothing_before(law)
        )
        assert tick.status[Status.OUTCOME] == Outcome.SOLVED
        assert tick.status[Status.ROBUSTNESS] <= minimum * (1.0 + 1e-5)


@pytest.mark.parametrize("measure", ["box", "rectangle"])
def test_where_the_bound_cannot_be_had_the_safest_torque_is_kept_and_flagged(law, measure):
    """Sigma is ten times the paper's: the limits can be kept, R <= R_min cannot."""
    bound, best = of(law, measure, "constraint", 0.05, minimum=1e-3), of(law, measure, "trade_off", 0.05, weight=1e8)
    scratch = law.model.create_scratch()
    found, safest = (
        solve_tick(each, scratch, TickInput(state_of(law), rests(law), BOTH), nothing_before(law))
        for each in (bound, best)
    )
    assert found.status[Status.OUTCOME] == Outcome.RISKY
    assert found.status[Status.FALLBACK] == 0.0
    assert found.status[Status.P_IND] > 0.0
    assert 1e-3 < found.status[Status.ROBUSTNESS] < LARGEST
    assert_allclose(found.status[Status.ROBUSTNESS], safest.status[Status.ROBUSTNESS], rtol=1e-2)
    polytope = problem_at(bound, scratch, TickInput(state_of(law), rests(law), BOTH)).reduced.polytope
    assert polytope.violation(found.torque) < 1e-4


@pytest.mark.parametrize("measure", ["individual", "rectangle"])
@pytest.mark.parametrize("iterations", [1, 3, 8, 100])
def test_the_budget_is_that_of_the_whole_solve_and_a_bound_that_is_not_kept_is_told(law, measure, iterations):
    """Three ticks: with one or three steps the rectangle's first misses the bound, with a hundred no tick does."""
    bound = 0.01
    some = of(law, measure, "constraint", 0.01, minimum=bound, options=Options(budget=Budget(iterations)))
    scratch, before, told = law.model.create_scratch(), nothing_before(law), []
    for _ in range(3):
        tick = solve_tick(some, scratch, TickInput(state_of(law), rests(law), BOTH), before)
        assert tick.status[Status.ITERATIONS] <= iterations + 5  # each program takes one step at least
        kept = tick.status[Status.ROBUSTNESS] <= bound * (1.0 + 1e-5)
        assert tick.status[Status.OUTCOME] == (Outcome.SOLVED if kept else Outcome.RISKY)
        if not kept:
            assert tick.status[Status.CONVERGED] == 0.0
        told.append(bool(kept))
        before = PreviousTick(tick.torque, tick.start)
    if measure == "individual" or iterations == 100:
        assert all(told)
    elif iterations <= 3:
        assert not told[0]


def test_a_time_budget_of_the_file_is_kept():
    """A nanosecond: every program ends after its first step, and the tick says that it was cut short."""
    given = {"measure": "rectangle", "use": "constraint", "minimum": 2.0}
    found = {}
    for seconds in (1e-9, 1e3):
        law = load_law(FILE, {"sigma": 0.01, "formulation": {**given, "seconds": seconds}})
        tick = solve_tick(
            law, law.model.create_scratch(), TickInput(state_of(law), rests(law), BOTH), nothing_before(law)
        )
        assert finite(tick)
        found[seconds] = tick.status
    assert found[1e-9][Status.ITERATIONS] <= 5 < found[1e3][Status.ITERATIONS]
    assert (found[1e-9][Status.CONVERGED], found[1e3][Status.CONVERGED]) == (0.0, 1.0)


@pytest.mark.parametrize("measure", ["box", "rectangle"])
def test_an_infinite_risk_is_told_as_a_number(law, measure):
    references = rests(law)
    references[0][:3] += [0.3, 0.0, 0.0]
    some = of(law, measure, weight=1e-9)
    tick = solve_tick(some, law.model.create_scratch(), TickInput(state_of(law), references, BOTH), nothing_before(law))
    assert finite(tick) and tick.status[Status.ROBUSTNESS] <= LARGEST


def test_an_error_anywhere_in_a_tick_is_a_lost_tick(law, monkeypatch):
    def broken(*args):
        raise IndexError("nobody thought of this")

    monkeypatch.setattr(module, "_found", broken)
    before = PreviousTick(np.full(30, 2.0), None)
    tick = solve_tick(law, law.model.create_scratch(), TickInput(state_of(law), rests(law), BOTH), before)
    assert_allclose(tick.torque, 2.0 * np.exp(-law.period / law.fade))
    assert (tick.status[Status.OUTCOME], tick.status[Status.FALLBACK]) == (Outcome.FAILED, 1.0)
    assert isinstance(tick.error, IndexError)


def test_rows_that_do_not_err_count_alike_everywhere():
    """Half of the joints do not err, and their torque limits hold the torque: by rounding on either side."""
    sigma = [0.0] * 12 + [0.3] * 18
    law = load_law(FILE, {"sigma": sigma, "limits": {"torque": {"share": 0.35}}, "formulation": {"weight": 1e-5}})
    scratch, rng = law.model.create_scratch(), np.random.default_rng(3)
    held = 0
    for _ in range(40):
        references = rests(law)
        references[0][:3] += 0.1 * rng.normal(size=3)
        state = state_of(law, 0.05, 0.1, rng)
        tick = solve_tick(law, scratch, TickInput(state, references, BOTH), nothing_before(law))
        if tick.status[Status.OUTCOME] != Outcome.SOLVED:
            continue
        polytope = problem_at(law, scratch, TickInput(state, references, BOTH)).reduced.polytope
        held += bool((np.abs(tick.torque[:12]) >= polytope.upper[:12] - 1e-5).any())
        assert_allclose(p_ind(polytope, tick.torque, law.error), tick.status[Status.P_IND], rtol=1e-6)
        assert p_box(polytope, tick.torque, law.error) <= tick.status[Status.P_IND] * (1.0 + 1e-6)
    assert held >= 10


@pytest.mark.parametrize("switches", [[np.nan, np.nan], [np.nan, 1.0], [np.inf, 1.0]])
def test_contact_switches_that_are_no_numbers_are_a_lost_tick(law, switches):
    system = RobustTsid(law)
    context = system.CreateDefaultContext()
    system.GetInputPort("estimated_state").FixValue(context, state_of(law))
    system.GetInputPort("active_contacts").FixValue(context, switches)
    status = system.GetOutputPort("status").Eval(context)
    assert (status[Status.OUTCOME], status[Status.FALLBACK]) == (Outcome.FAILED, 1.0)


def test_time_that_goes_back_begins_a_new_tick(law):
    system = RobustTsid(law)
    context = system.CreateDefaultContext()
    port = system.GetInputPort("estimated_state")
    port.FixValue(context, state_of(law))
    context.SetTime(5.0)
    memory = system.EvalUniquePeriodicDiscreteUpdate(context)
    context.get_mutable_discrete_state().SetFrom(memory)
    context.SetTime(0.0)
    port.FixValue(context, np.full(73, np.nan))
    assert system.GetOutputPort("status").Eval(context)[Status.FALLBACK] == 1.0
