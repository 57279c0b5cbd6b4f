"""`bench qp`: the recorded motion is one that the robot can make, and the rows are what they say."""

import json
from itertools import pairwise

import numpy as np
import pytest

from drake_tc.tsid.configuration import load_law
from drake_tc.tsid.qp import Outcome, solver
from tests.benchmarks.__main__ import run
from tests.benchmarks.qp import MOTIONS, humanoid_controller, record, residual, timed

from .quadratic import Residuals


@pytest.fixture(scope="module")
def law():
    return load_law(humanoid_controller())


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.name)
def test_problems_along_a_motion_change_little_by_little_and_are_solvable(law, motion):
    problems = record(law, motion, 30)
    assert len(problems) >= 25
    chosen = solver("daqp")
    answers = [chosen.solve(problem) for problem in problems]
    assert all(answer.outcome is Outcome.SOLVED for answer in answers)
    for one, other in pairwise(problems):
        assert np.abs(one.matrix - other.matrix).max() <= 0.1 * np.abs(one.matrix).max()
    lowest = np.linalg.eigvalsh(problems[0].hessian)[0]
    assert (lowest > 1e-10) == motion.held


def test_timings_and_residuals(law):
    problems = record(law, MOTIONS[1], 20)
    seconds, unsolved, worst = timed(solver("daqp"), problems, warm=True)
    assert seconds.size == len(problems) and (seconds > 0.0).all() and unsolved == 0
    answer = solver("daqp").solve(problems[-1])
    ours = Residuals.of(problems[-1], answer)
    assert residual(problems[-1], answer) == pytest.approx(max(ours.dual, ours.primal, ours.complementarity), abs=1e-15)
    assert worst <= 1e-8


def test_the_command_prints_rows(capsys):
    assert run(["qp", "--solver", "daqp", "--ticks", "20", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["name"] == "qp" and len(printed["rows"]) == 2 * 3 * len(MOTIONS)
    assert {"name", "unit", "median", "p99", "n"} == set(printed["rows"][0])
    assert run(["qp", "--solver", "simplex", "--ticks", "20"]) == 2
    assert "expected one of" in capsys.readouterr().err
