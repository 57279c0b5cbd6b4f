"""Strict priorities of a controller file: what a level leaves alone, where robustness stands, what is refused."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import drake_tc.models
from drake_tc.errors import ParamsError
from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.law import PreviousTick, Status
from drake_tc.tsid.qp import Outcome
from drake_tc.tsid.tick import TickInput, problem_at, solve_tick

FILE = Path(drake_tc.models.__file__).parent / "hrp2_like" / "hrp2_like_tsid.yaml"
BOTH = (True, True)
BY_LEVEL = {"use": None, "weight": None}


def law_of(tasks, **formulation):
    levels = {name: {"priority": level} for name, level in tasks.items()}
    return load_law(FILE, {"tasks": levels, "sigma": 0.02, "formulation": {**BY_LEVEL, **formulation}})


def tick_of(law, shift=0.004):
    """Standing, the centre of mass asked 4 mm to the side, beyond what posture and forces would like."""
    references = [task.rest(law.starting_terms()) for task in law.tasks]
    references[0][1] += shift
    state = np.concatenate((law.model.start, np.zeros(law.model.nv)))
    scratch, before = law.model.create_scratch(), PreviousTick(np.zeros(law.model.n), None)
    tick = solve_tick(law, scratch, TickInput(state, references, BOTH), before)
    assert tick.status[Status.OUTCOME] == Outcome.SOLVED
    problem = problem_at(law, scratch, TickInput(state, references, BOTH))
    errors = {
        rows.name: float(np.linalg.norm(rows.matrix.vdot @ tick.acceleration - rows.target))
        for rows in problem.tasks
        if rows.matrix.vdot is not None
    }
    return tick, errors


def test_a_higher_level_is_exact_whatever_the_weights():
    """The posture's weight is 1e6 times that of the file, so that it wins by weight and loses by priority."""
    heavy = {"posture": {"weight": 1e3}}
    by_weight = load_law(FILE, {"tasks": heavy})
    by_level = load_law(
        FILE, {"tasks": {"posture": {"weight": 1e3, "priority": 2}, "force": {"priority": 2}}, "formulation": BY_LEVEL}
    )
    (_, weighted), (_, strict) = tick_of(by_weight), tick_of(by_level)
    assert weighted["com"] > 1e-2
    assert strict["com"] < 1e-6


@pytest.mark.parametrize("level", [2, 3])
def test_robustness_is_as_good_as_the_levels_above_leave_it(level):
    """Above posture it raises p, below it cannot move what the posture has fixed."""
    posture = 5 - level
    tick, errors = tick_of(law_of({"posture": posture, "force": posture}, priority=level))
    other, _ = tick_of(law_of({"posture": 2, "force": 2}, measure="classic"))
    assert errors["com"] < 1e-6
    if level == 2:
        assert tick.status[Status.ROBUSTNESS] < -0.01 * np.log(other.status[Status.P_IND])
    else:
        assert_allclose(tick.status[Status.P_IND], other.status[Status.P_IND], rtol=1e-3)


def test_robustness_stands_below_all_tasks_unless_told_otherwise():
    law = law_of({"posture": 2})
    assert (law.priorities.tasks, law.priorities.robustness) == ((1, 2, 1), 3)
    assert law_of({"posture": 2}, measure="classic").priorities.robustness is None
    assert load_law(FILE).priorities is None


@pytest.mark.parametrize(
    ("tasks", "formulation", "wanted"),
    [
        ({"posture": 0}, BY_LEVEL, r"tasks\.posture\.priority: expected 1, 2, \.\.\., got 0"),
        ({"posture": 1.5}, BY_LEVEL, r"tasks\.posture\.priority: expected 1, 2"),
        ({"posture": 2}, {}, r"formulation\.use: expected none \(null\) beside strict priorities, got 'trade_off'"),
        ({"posture": 2}, {**BY_LEVEL, "priority": 2}, "expected a level of its own for robustness"),
        ({"posture": 2}, {**BY_LEVEL, "measure": "box"}, "priorities: expected individual"),
        ({"posture": 2}, {**BY_LEVEL, "measure": "classic", "priority": 3}, "priorities: expected individual"),
    ],
)
def test_what_does_not_go_together_is_refused_in_one_line(tasks, formulation, wanted):
    levels = {name: {"priority": level} for name, level in tasks.items()}
    with pytest.raises(ParamsError, match=wanted) as caught:
        load_law(FILE, {"tasks": levels, "formulation": formulation})
    assert "\n" not in str(caught.value)


def test_numbers_that_are_none_are_a_lost_tick():
    law = law_of({"posture": 2})
    state = np.full(law.model.nq + law.model.nv, np.nan)
    references = [task.rest(law.starting_terms()) for task in law.tasks]
    tick = solve_tick(
        law, law.model.create_scratch(), TickInput(state, references, BOTH), PreviousTick(np.ones(30), None)
    )
    assert np.isfinite(tick.torque).all() and tick.status[Status.FALLBACK] == 1.0


def levels_by_null_spaces(law, problem):
    """(n,) independent: pseudo-inverses within null spaces from singular values, level by level, without limits."""
    from scipy.linalg import null_space

    from drake_tc.tsid.assembly import cost_of

    tau, free = np.zeros(law.model.n), np.eye(law.model.n)
    for level in sorted(set(law.priorities.tasks)):
        own = [rows for rows, of in zip(problem.tasks, law.priorities.tasks, strict=True) if of == level]
        cost = cost_of(own, problem.reduced.causes)
        inside = cost.matrix @ free
        tau = tau + free @ np.linalg.lstsq(inside, cost.target - cost.matrix @ tau, rcond=1e-10)[0]
        free = free @ null_space(inside, rcond=1e-10)
    assert free.shape[1] == 0
    return tau


@pytest.mark.parametrize("seed", range(4))
def test_levels_that_no_limit_holds_are_those_of_null_spaces(seed):
    """One call solves them; where a limit holds one, the programs of the levels do, and go on as before."""
    law = law_of({"com": 1, "posture": 2, "force": 3})
    rng = np.random.default_rng(seed)
    references = [task.rest(law.starting_terms()) for task in law.tasks]
    state = np.concatenate((law.model.start, 1e-3 * rng.normal(size=law.model.nv)))
    scratch, before = law.model.create_scratch(), PreviousTick(np.zeros(law.model.n), None)
    problem = problem_at(law, scratch, TickInput(state, references, BOTH))
    expected = levels_by_null_spaces(law, problem)
    limits = problem.reduced.polytope
    value = limits.matrix @ expected
    assert (limits.lower <= value).all() and (value <= limits.upper).all()
    tick = solve_tick(law, scratch, TickInput(state, references, BOTH), before)
    assert_allclose(tick.torque, expected, atol=1e-6)
    far = [*references]
    far[0] = references[0].copy()
    far[0][1] += 0.3  # the centre of mass is asked beyond what the soles can push
    held = solve_tick(law, scratch, TickInput(state, far, BOTH), before)
    assert held.status[Status.OUTCOME] == Outcome.SOLVED
    polytope = problem_at(law, scratch, TickInput(state, far, BOTH)).reduced.polytope
    moved = polytope.matrix @ held.torque
    assert max((polytope.lower - moved).max(), (moved - polytope.upper).max()) < 1e-6
