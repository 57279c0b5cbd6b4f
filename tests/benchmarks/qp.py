"""`bench qp`: a whole robot's quadratic programs along a motion, by every solver, cold and from the last tick."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drake_tc.registry import tsid_entry
from drake_tc.tsid.assembly import reduce
from drake_tc.tsid.law import Law
from drake_tc.tsid.model import moved
from drake_tc.tsid.qp import Outcome, QpSolution, QpSolver, QuadraticProgram
from drake_tc.tsid.tasks import ComTask, ForceTask
from drake_tc.types import FloatArray
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.qp_solvers import solver
from tests.tsid.program_matrices import reduced_qp

Progress = Callable[[str, float], None]
STEP = 5e-3
"""Between the problems [s], the paper's."""
FAST = ("daqp", "quadprog")
FEWER = 8
"""The slower solvers take every eighth problem."""


@dataclass(frozen=True)
class Motion:
    """How the centre of mass sways while the problems are recorded.

    Attributes:
        name: Of the rows.
        sway: Amplitude [m].
        hertz: Of the sway.
        held: Whether the controller's tasks of contact forces are kept; without them internal forces are free.
    """

    name: str
    sway: tuple[float, float, float]
    hertz: float
    held: bool = True


MOTIONS = (
    Motion("sway", (0.02, 0.04, 0.02), 0.5),
    Motion("at its limits", (0.15, 0.25, 0.1), 1.0),
    Motion("free internal forces", (0.02, 0.04, 0.02), 0.5, held=False),
)


def record(law: Law, motion: Motion, ticks: int) -> list[QuadraticProgram]:
    """The reduced problems along a motion of the model itself, which follows the accelerations of their solutions.

    Where a problem has no solution the robot stays where it is for a tick, and the problem is left out.
    """
    model, found, last = law.model, list[QuadraticProgram](), None
    rests = [task.rest(law.starting_terms()) for task in law.tasks]
    scratch, q, v = model.create_scratch(), model.start.copy(), np.zeros(model.nv)
    for tick in range(ticks):
        terms = model.terms(scratch, q, v)
        phase = 2.0 * np.pi * motion.hertz * STEP * tick
        rows = []
        for task, rest in zip(law.tasks, rests, strict=True):
            if isinstance(task, ForceTask) and not motion.held:
                continue
            reference = rest.copy()
            if isinstance(task, ComTask):
                reference[:3] += np.array(motion.sway) * np.sin(phase * np.array([1.0, 0.7, 1.3]))
            rows.append(task.rows(terms, reference))
        reduced = reduce(terms, rows, [limit.rows(terms) for limit in law.limits], -20.0 * terms.contact_velocity)
        problem = reduced_qp(reduced)
        last = law.solver.solve(problem, last)
        if last.outcome is not Outcome.SOLVED:
            v = np.zeros_like(v)
            continue
        found.append(problem)
        vdot = reduced.full(last.x)[0]
        q, v = moved(model, q, v + 0.5 * STEP * vdot, STEP), v + STEP * vdot
    return found


def residual(problem: QuadraticProgram, solution: QpSolution) -> float:
    """The worst of: H x + c + A^T mu, a row's miss, mu times the room that its row has, each in the problem's units."""
    rows = problem.matrix @ solution.x
    above, below = rows - problem.upper, problem.lower - rows
    push = solution.multipliers
    room = np.where(push > 0.0, above, below)[push != 0.0]
    slope = problem.hessian @ solution.x + problem.gradient + problem.matrix.T @ push
    products = np.abs(push[push != 0.0] * room).max(initial=0.0)
    return float(max(np.abs(slope).max(), np.maximum(above, below).max(initial=0.0), products))


def timed(chosen: QpSolver, problems: Sequence[QuadraticProgram], *, warm: bool) -> tuple[FloatArray, int, float]:
    """Seconds of each on this thread's own core, how many were not solved, and the worst residual of the others."""
    seconds, unsolved, worst, last = [], 0, 0.0, None
    for problem in problems:
        begin = time.thread_time()
        solution = chosen.solve(problem, last)
        seconds.append(time.thread_time() - begin)
        last = solution if warm else None
        if solution.outcome is Outcome.SOLVED:
            worst = max(worst, residual(problem, solution))
        else:
            unsolved += 1
    return np.array(seconds), unsolved, worst


def humanoid_controller() -> Path:
    """The controller file of the humanoid's first scenario."""
    scenario = tsid_entry().scenario("balance")
    return scenario.path(scenario.controller)


def qp_rows(law: Law, names: Sequence[str], progress: Progress, ticks: int = 400) -> list[BenchmarkRow]:
    """Times from nothing (cold) and from the last tick's answer (warm), what was not solved, the worst residual.

    Args:
        law: A controller; its tasks and limits make the problems, its solver moves the model.
        names: Solvers of `qp_solvers.solver`.
        progress: Told what is timed and which share is done.
        ticks: Of each motion.

    Raises:
        ParamsError: a solver that is not there.
    """
    solvers = {name: solver(name) for name in names}
    rows, done, steps = [], 0, len(MOTIONS) * (1 + len(names))
    for motion in MOTIONS:
        progress(f"recording {motion.name}", done / steps)
        problems = record(law, motion, ticks)
        done += 1
        for name, chosen in solvers.items():
            progress(f"{name}, {motion.name}", done / steps)
            some = problems if name in FAST else problems[::FEWER]
            for way in ("cold", "warm"):
                seconds, unsolved, worst = timed(chosen, some, warm=way == "warm")
                label = f"{name}, {motion.name}, {way}"
                rows.append(BenchmarkRow.of_values(label, "us", seconds, 1e6))
                rows.append(BenchmarkRow(f"{label}: not solved", unsolved, "-", n=len(some)))
                rows.append(BenchmarkRow(f"{label}: worst residual", worst, "-", n=len(some) - unsolved))
            done += 1
    return rows
