"""A tick by one call from the last one's torque against the stages that it consists of, and when it gives none."""

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.fused import NO_ROWS
from drake_tc.tsid.law import PreviousTick, Status
from drake_tc.tsid.qp import Outcome
from drake_tc.tsid.robust.scaled import Budget, Options
from drake_tc.tsid.tick import TickInput, solve_tick

from .test_fused_tick import BOTH, FILE, Plain, moved, of, references_of

MEASURES = ["classic", "individual", "box", "rectangle"]
TORQUE = 1e-10
"""[N m], of torques of some 100 N m: the calls are of the same functions on the same numbers."""


@pytest.fixture(scope="module")
def law():
    return load_law(FILE, {"limits": {"torque": {"share": 1.0}}})


def without_call(fast):
    """The same law, whose ticks are one call up to the problem, and stages from there on."""
    other = replace(fast)
    other.__dict__["warm"] = None
    return other


def same(one, other):
    assert one.error is other.error is None
    assert_allclose(one.torque, other.torque, rtol=0, atol=TORQUE)
    assert_allclose(one.acceleration, other.acceleration, rtol=0, atol=1e-8)
    assert_allclose(one.force, other.force, rtol=0, atol=1e-8)
    assert_allclose(one.status, other.status, rtol=1e-9, atol=1e-12)
    held, expected = one.start.active_set, other.start.active_set
    assert_array_equal(held.rows, expected.rows)
    assert_array_equal(held.sides, expected.sides)
    assert one.start.rows == other.start.rows
    assert (one.start.inner is None) == (other.start.inner is None)


def from_rest(fast, scratch, references, active=BOTH):
    """What a first tick leaves to the next one."""
    rest = np.concatenate((fast.model.start, np.zeros(fast.model.nv)))
    tick = solve_tick(fast, scratch, TickInput(rest, references, active), PreviousTick(np.zeros(30), None))
    return PreviousTick(tick.torque, tick.start)


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    size=st.floats(0.0, 0.05),
    speed=st.floats(0.0, 0.2),
    measure=st.sampled_from(MEASURES),
    lifted=st.booleans(),
)
def test_ticks_from_a_torque_that_is_known_are_those_of_the_stages(law, seed, size, speed, measure, lifted):
    """Near and far from the last tick, and with a contact less than it had."""
    fast, rng, scratch = of(law, measure), np.random.default_rng(seed), law.model.create_scratch()
    references = references_of(law, rng, size)
    before = from_rest(fast, scratch, references)
    state, active = moved(law, rng, 0.3 * size, speed), (True, not lifted)
    one = solve_tick(fast, scratch, TickInput(state, references, active), before)
    other = solve_tick(without_call(fast), scratch, TickInput(state, references, active), before)
    if one.start is None:
        assert other.start is None
        assert_array_equal(one.status, other.status)
        return
    same(one, other)


@pytest.mark.parametrize("measure", MEASURES)
def test_rows_that_are_written_out_go_into_the_call(law, measure):
    tabled = of(law, measure)
    asked = replace(tabled, limits=tuple(Plain(limit) for limit in tabled.limits))
    scratch, references = law.model.create_scratch(), references_of(law, np.random.default_rng(0), 0.005)
    state = moved(law, np.random.default_rng(1), 1e-3, 1e-3)
    ticks = [solve_tick(each, scratch, TickInput(state, references, BOTH), from_rest(each, scratch, references))
             for each in (asked, without_call(asked))]  # fmt: skip
    same(*ticks)


@pytest.mark.parametrize("measure", MEASURES)
def test_the_call_answers_along_a_motion(law, measure):
    """No tick of a slow motion falls back on the stages, but the first."""
    fast, scratch = of(law, measure), law.model.create_scratch()
    references, rng = references_of(law), np.random.default_rng(3)
    base = np.concatenate((law.model.start, np.zeros(law.model.nv)))
    swing, memory = moved(law, rng) - base, fast.memory
    before, after = memory.packed(from_rest(fast, scratch, references)), np.full(memory.size, np.nan)
    for number in range(1, 20):
        numbers = np.concatenate((base + 1e-3 * number * swing, *references))
        assert fast.warm(numbers, scratch.select(BOTH), NO_ROWS, before, after)
        status = after[memory.places["status"]]
        assert status[Status.OUTCOME] == Outcome.SOLVED
        assert status[Status.CONVERGED] == 1.0
        before, after = after, before


def test_formulations_of_several_programs_or_with_a_clock_have_no_such_call(law):
    assert of(law, "individual").warm is not None
    assert of(law, "classic", "constraint").warm is not None
    assert of(law, "rectangle").warm is not None
    assert of(law, "rectangle", "null_space").warm is None
    assert of(law, "individual", "constraint").warm is None
    assert of(law, "box", "null_space").warm is None
    timed = Options(budget=Budget(seconds=1.0, clock=time.perf_counter))
    assert of(law, "individual", options=timed).warm is None


def test_steps_that_are_spent_leave_the_tick_to_the_stages(law):
    """One step does not reach the minimum from far away; the tick says so as it did."""
    short = of(law, "individual", options=Options(accuracy=1e-12, budget=Budget(iterations=1)))
    scratch, references = law.model.create_scratch(), references_of(law)
    before = from_rest(of(law), scratch, references)
    references[0][:3] += 0.01
    state = moved(law, np.random.default_rng(2), 0.01, 0.01)
    tick = solve_tick(short, scratch, TickInput(state, references, BOTH), before)
    same(tick, solve_tick(without_call(short), scratch, TickInput(state, references, BOTH), before))
    assert tick.status[Status.CONVERGED] == 0.0


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e7])
def test_a_state_that_is_no_number_fades_the_torque_out(law, wrong):
    fast, scratch, references = of(law), law.model.create_scratch(), references_of(law)
    before = from_rest(fast, scratch, references)
    state = moved(law, np.random.default_rng(0))
    state[12] = wrong
    tick = solve_tick(fast, scratch, TickInput(state, references, BOTH), before)
    assert_allclose(tick.torque, np.exp(-law.period / law.fade) * before.torque, rtol=1e-15, atol=0)
    assert tick.status[Status.OUTCOME] == Outcome.FAILED
