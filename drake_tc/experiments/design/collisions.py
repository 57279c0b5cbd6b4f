"""Whether a robot's postures keep a distance between its links and from its surroundings, by Drake's geometry."""

from pathlib import Path
from typing import Any

import numpy as np
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.geometry import SceneGraph
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_tc.errors import ParamsError
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
        """The constraint that all distances are at least `bound` [m]; a robot without shapes keeps any.

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
        self.pairs = _pairs(scene_graph)
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
        if not self.active:
            warnings.append("No distance between links was kept: the URDF has no pair of primitive collision shapes.")
        if self.left_out:
            names = ", ".join(self.left_out)
            warnings.append(f"The collision shapes of these links are meshes, which the design does not use: {names}.")
        check = "Check the motion for collisions before the robot runs it, or give these links primitive shapes."
        return (*warnings, check) if warnings else ()

    @property
    def active(self) -> bool:
        """Whether there is a pair of shapes that could touch."""
        return self._constraint is not None

    def value(self, position: FloatArray) -> float:
        """At most 1 where a posture (n,) [rad] keeps the distance."""
        if self._constraint is None:
            return 0.0
        return float(np.ravel(self._constraint.Eval(self._in_plant(position)))[-1])

    def allows(self, positions: FloatArray) -> bool:
        """Whether all postures (T, n) keep the distance."""
        return all(self.value(q) <= 1.0 + 1e-6 for q in positions)

    def gradient(self, position: FloatArray) -> tuple[float, FloatArray]:
        """(value, (n,) slope by the joints' positions)."""
        if self._constraint is None:
            return 0.0, np.zeros(position.size)
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


def _pairs(scene_graph: SceneGraph) -> int:
    """Number of pairs of shapes that may touch."""
    return len(scene_graph.model_inspector().GetCollisionCandidates())
