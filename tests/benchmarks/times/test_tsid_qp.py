"""What limits and the quadratic program of a tick cost on the 30-joint robot; printed as rows (run with -s)."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from tsid.problems import SOLES, Setup, model, problems, state

from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.fallbacks import diagnose, safe_torque
from drake_tc.tsid.limits import AccelerationLimit, CapturePointLimit
from drake_tc.tsid.qp import solver
from tests.benchmarks.qp import MOTIONS, humanoid_controller, record, timed

from .machine import require

pytestmark = pytest.mark.benchmark


def repeated(call: Callable[[], object], count: int = 200) -> list[float]:
    seconds = []
    for _ in range(count):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return seconds


@pytest.mark.parametrize(("motion", "goal"), [(MOTIONS[0], 35e-6), (MOTIONS[1], 60e-6)])
def test_the_quadratic_program_of_a_tick(motion, goal):
    problems, row = record(load_law(humanoid_controller()), motion, 300), f"QP, {motion.name}, warm"

    def solved():
        seconds, unsolved, _ = timed(solver(), problems, warm=True)
        assert unsolved == 0
        return {row: seconds}

    require({row: goal}, solved)


def test_limits_of_a_tick():
    it = model()
    terms = it.terms(it.create_scratch(), *state(np.random.default_rng(0), Setup()))
    acceleration = AccelerationLimit.of(it, period=1e-3)
    capture = CapturePointLimit(SOLES, period=1e-3)
    calls = {
        "acceleration limits, 30 joints": lambda: acceleration.rows(terms),
        "capture point, two soles": lambda: capture.rows(terms),
    }
    goals = dict(zip(calls, (6e-6, 25e-6), strict=True))
    require(goals, lambda: {row: repeated(call) for row, call in calls.items()})


def test_a_tick_without_solution():
    problem = next(iter(problems(1, 0, Setup(torque_share=0.05))))
    polytope = problem.polytope
    polytope.lower[polytope.labels.index("left_sole normal force")] = 500.0
    assert diagnose(polytope).labels
    calls = {
        "diagnosis of a conflict": lambda: diagnose(polytope),
        "safe torque": lambda: safe_torque(problem.terms, 1.0),
    }
    goals = dict(zip(calls, (350e-6, 75e-6), strict=True))
    require(goals, lambda: {row: repeated(call) for row, call in calls.items()})
