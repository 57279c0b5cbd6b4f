"""A tick whose problem is found in one call against the stages one after the other, and against Drake's own solver.

The stages themselves are held against the whole program in `test_kernel_oracle`, by orthogonal factors.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import drake_tc.models
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.fused import entry_of
from drake_tc.tsid.law import Law, PreviousTick, Status
from drake_tc.tsid.program_solver import ProgramSolver
from drake_tc.tsid.qp import Outcome
from drake_tc.tsid.rows import LimitRows, TaskRows
from drake_tc.tsid.tasks import AngularMomentumTask, ComTask, CopTask, FrameTask, OrientationTask, TorqueTask
from drake_tc.tsid.tick import TickInput, solve_tick

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
BOTH = (True, True)
TORQUE = 1e-8
"""[N m]."""
FORMS = [
    ("classic", "trade_off"),
    ("individual", "trade_off"),
    ("box", "trade_off"),
    ("rectangle", "trade_off"),
    ("individual", "null_space"),
    ("box", "null_space"),
    ("box", "constraint"),
]


@pytest.fixture(scope="module")
def law():
    return load_law(FILE, {"limits": {"torque": {"share": 1.0}}})


def of(law, measure="classic", use="trade_off", **values):
    return replace(law, formulation=replace(law.formulation, measure=measure, use=use, **values))


def by_stages(law):
    """The same law, whose ticks are solved stage by stage."""
    other = replace(law)
    other.__dict__["fused"] = None
    return other


def moved(law, rng, q=0.02, v=0.05):
    state = np.concatenate((law.model.start, np.zeros(law.model.nv)))
    state[:7] += 0.02 * rng.normal(size=7)
    state[7:37] += q * rng.normal(size=30)
    state[37:] += v * rng.normal(size=36)
    return state


def references_of(law, rng=None, size=0.0):
    references = [task.rest(law.starting_terms()) for task in law.tasks]
    if rng is not None:
        references[0][:3] += size * rng.normal(size=3)
    return references


def same(one, other, torque=TORQUE):
    assert one.error is other.error is None
    parts = [Status.OUTCOME, Status.FALLBACK, Status.LIMIT, Status.RELAXED]
    assert_array_equal(one.status[parts], other.status[parts])
    scale = max(1.0, np.abs(other.torque).max())
    assert_allclose(one.torque, other.torque, rtol=0, atol=torque * scale)
    assert_allclose(one.acceleration, other.acceleration, rtol=1e-7, atol=1e-6)
    assert_allclose(one.force, other.force, rtol=1e-7, atol=1e-5)
    assert_allclose(one.status[Status.P_IND], other.status[Status.P_IND], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("measure", "use"), FORMS)
def test_a_motion_with_a_lifted_foot_is_that_of_the_stages(law, measure, use):
    """Warm ticks, and a contact that goes and comes."""
    fast = of(law, measure, use)
    slow, rng = by_stages(fast), np.random.default_rng(1)
    scratch, references = law.model.create_scratch(), references_of(law, rng, 0.005)
    swing, base = moved(law, rng) - moved(law, rng), np.concatenate((law.model.start, np.zeros(law.model.nv)))
    before = PreviousTick(np.zeros(30), None)
    for number in range(40):
        active = (True, number < 15 or number > 25)
        state = base + swing * np.sin(0.02 * number)
        tick = solve_tick(fast, scratch, TickInput(state, references, active), before)
        same(tick, solve_tick(slow, scratch, TickInput(state, references, active), before))
        before = PreviousTick(tick.torque, tick.start)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    size=st.floats(0.0, 0.2),
    speed=st.floats(0.0, 0.3),
    form=st.sampled_from(FORMS),
    lifted=st.booleans(),
)
def test_cold_starts_anywhere_have_the_same_outcome(law, seed, size, speed, form, lifted):
    fast, rng = of(law, *form), np.random.default_rng(seed)
    state, references = moved(law, rng, 0.05, speed), references_of(law, rng, size)
    before, active = PreviousTick(np.zeros(30), None), (True, not lifted)
    ticks = [solve_tick(each, law.model.create_scratch(), TickInput(state, references, active), before)
             for each in (fast, by_stages(fast))]  # fmt: skip
    same(*ticks)


@pytest.mark.parametrize("seed", range(3))
def test_the_torque_is_that_of_drakes_program(law, seed):
    """Of J; the accuracy is that of Drake's solver."""
    fast, rng = of(law), np.random.default_rng(seed)
    state, references = moved(law, rng, 0.01, 0.02), references_of(law, rng, 0.01)
    one, other = (
        solve_tick(
            each, law.model.create_scratch(), TickInput(state, references, BOTH), PreviousTick(np.zeros(30), None)
        )
        for each in (fast, replace(fast, solver=ProgramSolver()))
    )
    assert one.status[Status.OUTCOME] == other.status[Status.OUTCOME] == Outcome.SOLVED
    assert_allclose(one.acceleration, other.acceleration, rtol=0, atol=1e-4)


def test_a_bound_that_is_active_is_met_as_by_the_stages(law):
    """R at the cheapest torque is larger than R_min."""
    fast = of(load_law(FILE, {"sigma": 0.02}), "individual", "constraint", minimum=1e-4)
    rng, scratch, before = np.random.default_rng(0), law.model.create_scratch(), PreviousTick(np.zeros(30), None)
    for _ in range(6):
        state, references = moved(law, rng, 1e-3, 1e-3), references_of(law)
        tick = solve_tick(fast, scratch, TickInput(state, references, BOTH), before)
        other = solve_tick(by_stages(fast), scratch, TickInput(state, references, BOTH), before)
        assert tick.status[Status.OUTCOME] == other.status[Status.OUTCOME] == Outcome.SOLVED
        assert tick.status[Status.ROBUSTNESS] <= 1e-4 * (1.0 + 1e-6)
        assert_allclose(tick.torque, other.torque, rtol=0, atol=TORQUE * np.abs(other.torque).max())
        before = PreviousTick(tick.torque, tick.start)


class Tired(ComTask):
    """A subclass with rows of its own: they count, and not the numbers of its parent."""

    def rows(self, terms, reference):
        rows = super().rows(terms, reference)
        return replace(rows, target=0.5 * rows.target)


class Plain:
    """A task or limit without numbers: the same rows, asked for at each state."""

    def __init__(self, inner):
        self.inner, self.name = inner, inner.name
        for key in ("weight", "reference_size", "group"):
            if hasattr(inner, key):
                setattr(self, key, getattr(inner, key))

    def rest(self, terms):
        return self.inner.rest(terms)

    def rows(self, *given) -> TaskRows | LimitRows:
        return self.inner.rows(*given)


def all_tasks(model) -> list:
    return [
        AngularMomentumTask(3.0, weight=[0.1, 0.2, 0.3], mask=[True, False, True]),
        CopTask(model, "left_sole", weight=1e-3),
        FrameTask(model, "right_palm", 50.0, 10.0, weight=0.1, mask=[True, True, False, True, True, True]),
        FrameTask(model, "l_hand", 20.0, 5.0, weight=0.05, axes_of="reference", name="hand in its reference"),
        FrameTask(model, "head", 20.0, 5.0, weight=0.05, axes_of="frame", name="head in its axes"),
        OrientationTask(model, "torso", 30.0, 8.0, weight=0.2),
        TorqueTask(model, weight=1e-5),
    ]


def test_every_task_and_limit_gives_the_same_numbers_as_rows(law):
    """All of the library's, as tables and as rows of their own, with both feet and with one."""
    tabled = of(law.with_tasks(*all_tasks(law.model)), "individual")
    asked = replace(
        tabled, tasks=tuple(Plain(task) for task in tabled.tasks), limits=tuple(Plain(limit) for limit in tabled.limits)
    )
    assert not tabled.fused.asks
    assert asked.fused.asks
    rng = np.random.default_rng(5)
    for active in (BOTH, (True, False)):
        state, references = moved(law, rng), references_of(tabled)
        references[0][:3] += 0.01
        ticks = [
            solve_tick(
                each, law.model.create_scratch(), TickInput(state, references, active), PreviousTick(np.zeros(30), None)
            )
            for each in (tabled, asked, by_stages(tabled))
        ]
        same(ticks[0], ticks[2])
        same(ticks[1], ticks[2])


def test_a_subclass_with_other_rows_is_asked_for_them(law):
    tired = Tired(100.0, 20.0)
    contacts = law.model.create_scratch().select(None)
    assert entry_of(tired, contacts) is None
    assert entry_of(ComTask(1.0, 1.0), contacts).kind == "com"
    fast = of(law.with_tasks(tired))
    references = references_of(fast, np.random.default_rng(0), 0.01)
    ticks = [
        solve_tick(each, law.model.create_scratch(), TickInput(moved(law, np.random.default_rng(1)), references, BOTH),
                   PreviousTick(np.zeros(30), None))
        for each in (fast, by_stages(fast), of(law))
    ]  # fmt: skip
    same(*ticks[:2])
    assert np.abs(ticks[0].torque - ticks[2].torque).max() > 1e-3


def test_a_law_that_needs_more_has_no_single_call(law):
    assert isinstance(law, Law)
    assert replace(law, solver=ProgramSolver()).fused is None
    assert law.fused is not None
