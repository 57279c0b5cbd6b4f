"""Whether a robot's postures keep a distance between its links and from its surroundings, by Drake's geometry.

The program of a robot's motion: limits of every joint, torques, and the distance between its links.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions
from pydrake.systems.framework import DiagramBuilder

from drake_tc.diagnosis.search import Progress
from drake_tc.errors import ParamsError
from drake_tc.experiments.design.lead import growing_sinusoids
from drake_tc.experiments.design.motions import JointLimits, MotionBasis, shrunk
from drake_tc.experiments.design.robot_goal import InformationCriterion, RobotGoal
from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf import links_without_solids
from drake_tc.types import FloatArray

INFLUENCE = 0.05
"""Distance beyond the bound from which on a pair enters the constraint [m]."""


class Collisions:
    """Distances between the links of a fixed-base robot, and from a scene, by Drake's minimum-distance constraint.

    The robot's shapes are the primitive ones of its URDF. Bodies of the scene that no joint holds are fixed to the
    world where the file places them; joints inside the scene stay at their default positions.
    """

    def __init__(self, robot: Robot, bound: float, scene: Path | None = None) -> None:
        """The constraint that all distances are at least `bound` [m]; without `pairs` that could touch all keep it.

        Args:
            robot: From `load_robot`.
            bound: Least distance [m].
            scene: URDF, SDF or MJCF of what stands around the robot, in the coordinates of the robot's world.

        Raises:
            ParamsError: A scene that cannot be read, or that has no shape; a robot without shapes in a scene.
        """
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        add_robot(plant, robot, collisions=True, rotors=False)
        if scene is not None:
            _require_shapes(plant, robot, scene)
            _add_scene(plant, scene)
        plant.Finalize()
        self._plant, self._diagram = plant, builder.Build()
        self._root: Any = self._diagram.CreateDefaultContext()
        self._context: Any = plant.GetMyMutableContextFromRoot(self._root)
        self._default: FloatArray = np.asarray(plant.GetPositions(self._context), dtype=np.float64)
        self._order = [int(plant.GetJointByName(name).position_start()) for name in robot.joints]
        self.pairs = len(scene_graph.model_inspector().GetCollisionCandidates())
        self.left_out = tuple(links_without_solids(robot))
        self._constraint: Any = None
        if self.pairs:
            self._constraint = MinimumDistanceLowerBoundConstraint(
                plant, bound, self._context, influence_distance_offset=INFLUENCE
            )

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the distance leaves out, for the user; empty where nothing is."""
        warnings = []
        if not self.pairs:
            warnings.append("No distance between links was kept: the URDF has no pair of primitive collision shapes.")
        if self.left_out:
            names = ", ".join(self.left_out)
            warnings.append(f"The collision shapes of these links are meshes, which the design does not use: {names}.")
        check = "Check the motion for collisions before the robot runs it, or give these links primitive shapes."
        return (*warnings, check) if warnings else ()

    def value(self, position: FloatArray) -> float:
        """At most 1 where a posture (n,) [rad] keeps the distance."""
        if self._constraint is None:
            return 0.0
        return float(np.ravel(self._constraint.Eval(self._in_plant(position)))[-1])

    def allows(self, positions: FloatArray) -> bool:
        """Whether all postures (T, n) keep the distance."""
        return all(self.value(q) <= 1.0 + 1e-6 for q in positions)

    def gradient(self, position: FloatArray) -> tuple[float, FloatArray]:
        """(value, (n,) slope by the joints' positions) where shapes could touch."""
        at: Any = self._in_plant(position)[:, None]
        found = self._constraint.Eval(InitializeAutoDiff(at).ravel())
        slope = np.asarray(ExtractGradient(found))[-1]
        value = float(ExtractValue(found).ravel()[-1])
        if slope.size == 0:
            return value, np.zeros(position.size)
        return value, np.asarray(slope[self._order])

    def _in_plant(self, position: FloatArray) -> FloatArray:
        q = self._default.copy()
        q[self._order] = position
        return q


def _require_shapes(plant: Any, robot: Robot, scene: Path) -> None:
    if plant.num_collision_geometries() == 0:
        raise ParamsError(
            f"--scene {scene}: {robot.urdf} has no collision shape that is a box, sphere, cylinder or capsule, so that "
            "no distance from the scene can be kept; give its links such shapes"
        )


def _add_scene(plant: Any, scene: Path) -> None:
    """The models of a file, fixed to the world."""
    before = plant.num_collision_geometries()
    try:
        models = Parser(plant).AddModels(scene)
    except (RuntimeError, ValueError) as error:
        reason = " ".join(str(error).partition("error: ")[2].split()) or " ".join(str(error).split())
        raise ParamsError(f"--scene {scene}: expected a URDF, SDF or MJCF that Drake reads; {reason}") from None
    if plant.num_collision_geometries() == before:
        raise ParamsError(f"--scene {scene}: it has no collision shape; give its bodies a <collision>")
    held = {plant.get_joint(i).child_body().index() for i in plant.GetJointIndices()}
    for model in models:
        for index in plant.GetBodyIndices(model):
            body = plant.get_body(index)
            if index not in held:
                plant.WeldFrames(plant.world_frame(), body.body_frame(), plant.GetDefaultFloatingBaseBodyPose(body))


RANDOM_STARTS = 10
"""Random motions among which the best are taken as starts."""
STEP = 0.05
"""Time between the samples of a robot's motion [s]."""
COLLISION_SAMPLES, CHECKED_SAMPLES = 25, 100
"""Postures of one period at which the distance is constrained, and at which it is checked at the end."""


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

    def best(
        self, rng: np.random.Generator, starts: int, iterations: int, progress: Progress
    ) -> tuple[tuple[float, FloatArray], float]:
        """((value, x (n, m)) of the best motion, value of the best random one), from several starts of the solver."""
        tried = []
        for number in range(RANDOM_STARTS):
            x = self.within(0.5 * rng.normal(size=(len(self.bases), self.bases[0].size)))
            tried.append((self.value(x), x))
            progress("random motions", 0.1 * (number + 1) / RANDOM_STARTS)
        tried.sort(key=lambda pair: -pair[0])
        best = tried[0]
        for number, (_, start) in enumerate(tried[:starts]):
            x = self.within(self.solve(start, iterations))
            best = max(best, (self.value(x), x), key=lambda pair: pair[0])
            progress(f"start {number + 1} of {starts}", 0.1 + 0.9 * (number + 1) / starts)
        return best, tried[0][0]

    def default(self, duration: float) -> FloatArray:
        """(4, T, n) of a growing sinusoid of each joint, at frequencies that differ, within all limits."""
        return growing_sinusoids(self.limits, duration, STEP, self._within_torques, self.robot.posture)

    def within(self, x: FloatArray) -> FloatArray:
        """The motion shrunk about the posture until it keeps limits, torques and distances.

        Raises:
            ParamsError: Not even a motion of a thousandth of the size keeps them.
        """
        found = shrunk(self.bases, self.limits, x, self._allowed, self.robot.posture)
        if found is None:
            raise ParamsError(
                f"{self.robot.source}: no motion about the posture keeps the torque limits and the distance between "
                "links"
            )
        return found

    def _within_torques(self, motion: FloatArray) -> bool:
        return bool((np.abs(self.goal.torque(*motion[:3])) <= self.goal.effort).all())

    def _allowed(self, motion: FloatArray) -> bool:
        every = max(1, motion.shape[1] // CHECKED_SAMPLES)
        return self._within_torques(motion) and self.collision.allows(motion[0, ::every])

    def solve(self, start: FloatArray, iterations: int) -> FloatArray:
        """What the solver finds from a start (n, m)."""
        program: Any = MathematicalProgram()
        n, m = start.shape
        x = program.NewContinuousVariables(n * m, "x")
        for i, (basis, limits) in enumerate(zip(self.bases, self.limits, strict=True)):
            mine = x[i * m : (i + 1) * m]
            for order, (lower, upper) in enumerate(limits.bounds):
                if np.isfinite(upper):
                    rows = basis.matrices[order, ::3]
                    program.AddLinearConstraint(rows, np.full(len(rows), lower), np.full(len(rows), upper), mine)
        if self.collision.pairs:
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
