"""The program of a robot's motion: limits of every joint, torques, and the distance between its links."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.basis import MotionBasis
from drake_tc.experiments.design.collisions import Collisions
from drake_tc.experiments.design.lead import DEFAULT_HZ
from drake_tc.experiments.design.limits import JointLimits
from drake_tc.experiments.design.robot_criteria import InformationCriterion
from drake_tc.experiments.design.robot_goal import RobotGoal
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

STEP = 0.05
"""Time between the samples of a robot's motion [s]."""
COLLISION_SAMPLES, CHECKED_SAMPLES = 25, 100
"""Postures of one period at which the distance is constrained, and at which it is checked at the end."""

SHRINKING = 0.9
"""Factor by which a motion is made smaller until it keeps torques and distances."""


@dataclass(frozen=True, eq=False)
class RobotSearch:
    """The program of one robot."""

    robot: Robot
    bases: tuple[MotionBasis, ...]
    limits: tuple[JointLimits, ...]
    goal: RobotGoal
    criterion: InformationCriterion
    collision: Collisions

    def motions(self, x: FloatArray) -> FloatArray:
        """(4, T, n) of x (n, m)."""
        return np.stack([b.motion(row) for b, row in zip(self.bases, x, strict=True)], axis=-1)

    def value(self, x: FloatArray) -> float:
        """Of the criterion."""
        q, v, a, _ = self.motions(x)
        return self.goal.value(self.criterion, (q, v, a))

    def value_and_slope(self, x: FloatArray) -> tuple[float, FloatArray]:
        """(value, (n, m) its slope by x)."""
        q, v, a, _ = self.motions(x)
        value, slopes = self.goal.value_and_slopes(self.criterion, (q, v, a))
        rows = [np.einsum("otm,ot->m", b.matrices[:3], slopes[:, :, i]) for i, b in enumerate(self.bases)]
        return value, np.stack(rows)

    def random(self, rng: np.random.Generator) -> FloatArray:
        """A random motion about the robot's posture that keeps all limits."""
        x = rng.normal(size=(len(self.bases), self.bases[0].size)) * 0.5
        return self.within(x)

    def default(self, duration: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(q, v, a) (T, n) of a growing sinusoid of each joint, at frequencies that differ, within all limits."""
        time: FloatArray = np.asarray(np.arange(round(duration / STEP)) * STEP, dtype=np.float64)
        size = 1.0
        while True:
            made = []
            for i, (each, centre) in enumerate(zip(self.limits, self.robot.posture, strict=True)):
                low, high = each.position
                half = size * 0.5 * (high - low)
                bounds = MotionLimits(each.position, each.velocity, each.acceleration)
                middle = float(np.clip(centre, low + 0.05 * (high - low), high - 0.05 * (high - low)))
                grows = 0.95 * half / duration
                made.append(growing_sinusoid(time, DEFAULT_HZ * (1.0 + 0.1 * i), 0.05 * half, grows, bounds, middle))
            q, v, a = (
                np.stack([getattr(m, name) for m in made], axis=-1) for name in ("position", "velocity", "acceleration")
            )
            if (np.abs(self.goal.torque(q, v, a)) <= self.goal.effort).all() or size < 0.01:
                return q, v, a
            size *= 0.8

    def within(self, x: FloatArray) -> FloatArray:
        """The motion shrunk about the posture until it keeps limits, torques and distances.

        Raises:
            ParamsError: Not even a motion of a thousandth of the size keeps them.
        """
        centre = np.array([np.clip(p, *each.position) for p, each in zip(self.robot.posture, self.limits, strict=True)])
        rows = []
        for basis, limits, row, middle in zip(self.bases, self.limits, x, centre, strict=True):
            ones = np.linalg.lstsq(basis.matrices[0], np.ones(basis.matrices.shape[1]), rcond=None)[0]
            own = float(np.mean(basis.matrices[0] @ row))
            low, high = limits.position
            mean = float(
                np.clip(own if abs(own) > 1e-9 else middle, low + 0.05 * (high - low), high - 0.05 * (high - low))
            )
            swing = row - own * ones
            q, v, a, j = basis.matrices @ swing
            rooms = (
                (high - mean, q.max()), (mean - low, -q.min()), (limits.velocity, np.abs(v).max()),
                (limits.acceleration, np.abs(a).max()), (limits.jerk, np.abs(j).max()),
            )  # fmt: skip
            share = min([1.0, *(float(room / size) for room, size in rooms if size > 0.0)])
            rows.append((mean, ones, share * swing, middle))
        factor = 1.0
        while factor > 1e-3:
            tried = np.stack([(m + (1.0 - factor) * (c - m)) * one + factor * s for m, one, s, c in rows])
            if self._allowed(tried):
                return tried
            factor *= SHRINKING
        raise ParamsError(
            f"{self.robot.source}: no motion about the posture keeps the torque limits and the distance between links"
        )

    def _allowed(self, x: FloatArray) -> bool:
        q, v, a, _ = self.motions(x)
        if (np.abs(self.goal.torque(q, v, a)) > self.goal.effort).any():
            return False
        every = max(1, q.shape[0] // CHECKED_SAMPLES)
        return not self.collision.active or self.collision.allows(q[::every])

    def solve(self, start: FloatArray, iterations: int) -> FloatArray:
        """What the solver finds from a start (n, m)."""
        program: Any = MathematicalProgram()
        n, m = start.shape
        x = program.NewContinuousVariables(n * m, "x")
        for i, (basis, limits) in enumerate(zip(self.bases, self.limits, strict=True)):
            mine = x[i * m : (i + 1) * m]
            low, high = limits.position
            bounds = ((low, high), *((-b, b) for b in (limits.velocity, limits.acceleration, limits.jerk)))
            for order, (lower, upper) in enumerate(bounds):
                if np.isfinite(upper):
                    rows = basis.matrices[order, ::3]
                    program.AddLinearConstraint(rows, np.full(len(rows), lower), np.full(len(rows), upper), mine)
        if self.collision.active:
            self._add_distances(program, x, (n, m))
        program.AddCost(self._cost((n, m)), vars=x)
        options = SolverOptions()
        options.SetOption(SnoptSolver.id(), "Major iterations limit", iterations)
        options.SetOption(SnoptSolver.id(), "Timing level", 0)
        solver: Any = SnoptSolver()
        found = np.asarray(solver.Solve(program, start.ravel(), options).GetSolution(x)).reshape(n, m)
        return found if np.isfinite(found).all() else start

    def _cost(self, shape: tuple[int, int]) -> Callable[[Any], Any]:
        """-criterion."""

        def cost(at: Any) -> Any:
            if at.dtype != object:
                return -self.value(at.reshape(shape))
            plain: FloatArray = np.asarray(ExtractValue(at), dtype=np.float64)
            value, slope = self.value_and_slope(plain.reshape(shape))
            return AutoDiffXd(-value, -slope.ravel() @ ExtractGradient(at))

        return cost

    def _add_distances(self, program: Any, x: Any, shape: tuple[int, int]) -> None:
        """The minimum distance at samples of one period."""
        n, m = shape
        samples = np.linspace(0, self.bases[0].matrices.shape[1] - 1, COLLISION_SAMPLES).astype(int)
        for k in samples:
            rows = np.zeros((n, n * m))
            for i, basis in enumerate(self.bases):
                rows[i, i * m : (i + 1) * m] = basis.matrices[0, k]

            def distance(at: Any, rows: FloatArray = rows) -> Any:
                if at.dtype != object:
                    return np.array([self.collision.value(rows @ at)])
                value, slope = self.collision.gradient(rows @ ExtractValue(at).ravel())
                return np.array([AutoDiffXd(value, slope @ rows @ ExtractGradient(at))])

            program.AddConstraint(distance, lb=np.array([-np.inf]), ub=np.array([1.0]), vars=x)
