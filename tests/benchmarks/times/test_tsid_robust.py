"""What the robust programs cost, warm, along a motion: 30 joints, double support; printed as rows (run with -s)."""

import time

import numpy as np
import pytest
from tsid.problems import Setup, problem_at, state

from drake_tc.tsid.qp import Outcome, solver
from drake_tc.tsid.robust.formulation import Formulation
from drake_tc.tsid.robust.scaled import TorqueError

from .machine import require

pytestmark = pytest.mark.benchmark
TICKS = 150


@pytest.fixture(scope="module")
def motion():
    """A tick each ms: joints and base move, and the centre of mass is asked for a circle of 2 cm."""
    rng, setup = np.random.default_rng(1), Setup()
    (q0, v0), (q1, v1) = state(rng, setup), state(rng, setup)
    problems = []
    for k in range(TICKS):
        share, angle = 0.5e-3 * k, 2e-3 * np.pi * k
        q = q0 + share * (q1 - q0)
        q[:4] /= np.linalg.norm(q[:4])
        error = np.array([0.02 * np.sin(angle), 0.015 * np.cos(angle), 0.01 * np.sin(2 * angle)])
        problem = problem_at(q, v0 + share * (v1 - v0), error, setup)
        problems.append((problem.cost, problem.polytope))
    return problems, TorqueError(problem.sigma**2)


def ticks(motion, formulation) -> list[float]:
    """Seconds of each solve but the first, which alone is cold."""
    problems, error = motion
    qp, seconds, start = solver(), [], None
    for cost, polytope in problems:
        begin = time.perf_counter()
        solution = formulation.solve(cost, polytope, error, qp, start)
        seconds.append(time.perf_counter() - begin)
        assert solution.outcome is Outcome.SOLVED
        start = solution.start
    return seconds[1:]


@pytest.mark.parametrize(
    ("measure", "weight", "budget"),
    [
        ("classic", 1.0, 65e-6),
        ("individual", 1.0, 90e-6),
        ("individual", 1e-3, 60e-6),
        ("individual", 1e-5, 65e-6),
        ("box", 1.0, 85e-6),
        ("box", 1e-3, 85e-6),
        ("rectangle", 1.0, 110e-6),
        ("rectangle", 1e-3, 110e-6),
    ],
)
def test_solve(motion, measure, weight, budget):
    row, formulation = f"TSID, 30 joints, {measure}, w = {weight:g}", Formulation(measure, weight=weight)
    require({row: budget}, lambda: {row: ticks(motion, formulation)})
