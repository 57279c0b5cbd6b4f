"""What limits and the quadratic program of a tick cost on the 30-joint robot; printed as rows (run with -s)."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from tsid.problems import SOLES, Setup, model, problems, robot, state

from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.infeasible import diagnose, safe_torque
from drake_tc.tsid.limits.acceleration import AccelerationLimit
from drake_tc.tsid.limits.capture_point import CapturePointLimit
from drake_tc.tsid.qp.choose import solver
from tests.benchmarks.qp import MOTIONS, humanoid_controller, record, timed

from .machine import slowness

pytestmark = pytest.mark.benchmark


def row(name: str, seconds) -> float:
    """Print a row and return the fastest tenth [us], which other work on the machine disturbs least."""
    best, median, p99 = 1e6 * np.percentile(seconds, [10, 50, 99])
    print(f"\n{name}: median {median:.1f} us, fastest tenth {best:.1f} us, p99 {p99:.1f} us, n {len(seconds)}")
    return float(best)


def repeated(call: Callable[[], object], count: int = 1000) -> list[float]:
    seconds = []
    for _ in range(count):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return seconds


@pytest.mark.parametrize("motion", MOTIONS[:2], ids=lambda motion: motion.name)
def test_the_quadratic_program_of_a_tick(motion):
    seconds, unsolved, _ = timed(solver(), record(load_law(humanoid_controller()), motion, 300), warm=True)
    assert unsolved == 0
    assert row(f"QP, {motion.name}, warm", seconds) <= 60.0 * slowness()


def test_limits_of_a_tick():
    it = model()
    terms = it.terms(it.create_scratch(), *state(np.random.default_rng(0), Setup()))
    acceleration = AccelerationLimit.of(robot(), it.actuated, it.nv, period=1e-3)
    capture = CapturePointLimit(SOLES, period=1e-3)
    slow = slowness()
    assert row("acceleration limits, 30 joints", repeated(lambda: acceleration.rows(terms))) <= 25.0 * slow
    assert row("capture point, two soles", repeated(lambda: capture.rows(terms))) <= 35.0 * slow


def test_a_tick_without_solution():
    problem = next(iter(problems(1, 0, Setup(torque_share=0.05))))
    polytope = problem.polytope
    polytope.lower[polytope.labels.index("left_sole normal force")] = 500.0
    assert diagnose(polytope).labels
    slow = slowness()
    assert row("diagnosis of a conflict", repeated(lambda: diagnose(polytope), 200)) <= 600.0 * slow
    assert row("safe torque", repeated(lambda: safe_torque(problem.terms, 1.0), 200)) <= 150.0 * slow
