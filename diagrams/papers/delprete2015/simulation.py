"""Simulations of Del Prete and Mansard (2015).

V += dt vdot, q after it on its manifold, vdot from the torques through the held contacts.
"""

import time as wall
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from drake_tc.diagrams.papers.delprete2015.setup import DT, Way, force_task
from drake_tc.tsid.assembly import Reduced, reduce
from drake_tc.tsid.fallbacks import diagnose
from drake_tc.tsid.model import Scratch, TsidModel, moved
from drake_tc.tsid.qp import Outcome, solver
from drake_tc.tsid.robust.convex import RobustSolution, Start
from drake_tc.tsid.robust.scaled import TorqueError
from drake_tc.tsid.rows import Limit, Task
from drake_tc.types import FloatArray

Reference = Callable[[float], FloatArray]
"""Of a time [s]."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What one robot is asked to do.

    Attributes:
        model: As the controller knows it; the same as the robot's own where nothing is wrong with it.
        tasks: Each with its reference; the main one first, with weight 1.
        limits: Of the problem.
    """

    model: TsidModel
    tasks: tuple[tuple[Task, Reference], ...]
    limits: tuple[Limit, ...]

    def problem(self, scratch: Scratch, q: FloatArray, v: FloatArray, time: float, way: Way) -> Reduced:
        """Over the torques, at a state."""
        terms = self.model.terms(scratch, q, v)
        rows = [task.rows(terms, reference(time)) for task, reference in self.tasks]
        if way.force_weight:
            rows.append(force_task(self.model, way.force_weight).rows(terms, np.zeros(self.model.force_size)))
        return reduce(terms, rows, [limit.rows(terms) for limit in self.limits])


@dataclass(frozen=True, eq=False)
class Moment:
    """One tick of a simulation.

    Attributes:
        time: [s].
        q, v: The state.
        problem: Of the controller.
        truth: The same of the robot as it is.
        solution: Of the controller; its torque acts, or the one that misses least where there is no solution.
        torque: (n,) what acts [N m].
        seconds: That the solution took.
    """

    time: float
    q: FloatArray
    v: FloatArray
    problem: Reduced
    truth: Reduced
    solution: RobustSolution
    torque: FloatArray
    seconds: float

    @property
    def solved(self) -> bool:
        """Whether the controller's limits could be kept."""
        return self.solution.outcome is Outcome.SOLVED

    def task_error(self, rows: int) -> float:
        """|J vdot + Jdot v - xdd_d| of the main task's rows, the first ones of the cost [m/s^2]."""
        cost = self.problem.cost
        return float(np.linalg.norm(cost.matrix[:rows] @ self.torque - cost.target[:rows]))


def follow(
    scene: Scene,
    way: Way,
    weight: float,
    error: TorqueError,
    duration: float,
    *,
    begin: float = 0.0,
    truth: Scene | None = None,
) -> Iterator[Moment]:
    """The motion that the controller makes of its scene, tick by tick, from the robot's posture at rest.

    Args:
        scene: Of the controller.
        way: Which torques it chooses.
        weight: w.
        error: That it reckons with; nothing errs in the simulation itself.
        duration: [s].
        begin: Time of the first tick [s].
        truth: The same scene of the robot as it is, where the controller's model is wrong.
    """
    form, qp, start = way.formulation(weight), solver(), None
    real = scene if truth is None else truth
    scratch, own = scene.model.create_scratch(), real.model.create_scratch()
    q, v = real.model.start.copy(), np.zeros(real.model.nv)
    for tick in range(round(duration / DT)):
        time = begin + tick * DT
        problem = scene.problem(scratch, q, v, time, way)
        true = problem if truth is None else truth.problem(own, q, v, time, way)
        before = wall.perf_counter()
        solution = form.solve(problem.cost, problem.polytope, error, qp, start)
        seconds = wall.perf_counter() - before
        start = solution.start
        torque = solution.torque
        if solution.outcome is not Outcome.SOLVED:
            torque = diagnose(problem.polytope, solver=qp).torque
        yield Moment(time, q, v, problem, true, solution, torque, seconds)
        v = v + DT * true.full(torque)[0]
        q = moved(real.model, q, v, DT)


def solve_again(
    scene: Scene, way: Way, weight: float, error: TorqueError, states: Sequence[Moment]
) -> Iterator[Moment]:
    """What another way would have chosen at the states of a motion, each from its solution at the state before."""
    form, qp, scratch = way.formulation(weight), solver(), scene.model.create_scratch()
    start: Start | None = None
    for state in states:
        problem = scene.problem(scratch, state.q, state.v, state.time, way)
        before = wall.perf_counter()
        solution = form.solve(problem.cost, problem.polytope, error, qp, start)
        seconds = wall.perf_counter() - before
        start = solution.start
        yield Moment(state.time, state.q, state.v, problem, problem, solution, solution.torque, seconds)
