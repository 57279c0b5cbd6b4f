"""Whether a robot's postures keep a distance between its links, by Drake's minimum-distance constraint."""

from typing import Any

import numpy as np
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.geometry import SceneGraph
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_tc.robot.plant import add_robot
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

INFLUENCE = 0.05
"""Distance beyond the bound from which on a pair enters the constraint [m]."""


class SelfCollision:
    """Distances between the links of a fixed-base robot, from the primitive collision shapes of its URDF."""

    def __init__(self, robot: Robot, bound: float) -> None:
        """The constraint that all distances are at least `bound` [m]; a robot without shapes keeps any."""
        builder = DiagramBuilder()
        plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        add_robot(plant, robot, collisions=True, rotors=False)
        plant.Finalize()
        self._plant, self._diagram = plant, builder.Build()
        self._root: Any = self._diagram.CreateDefaultContext()
        self._context: Any = plant.GetMyMutableContextFromRoot(self._root)
        self._order = [int(plant.GetJointByName(name).position_start()) for name in robot.joints]
        self.pairs = _pairs(scene_graph)
        self._constraint: Any = None
        if self.pairs:
            self._constraint = MinimumDistanceLowerBoundConstraint(
                plant, bound, self._context, influence_distance_offset=INFLUENCE
            )

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
        q = np.zeros(self._plant.num_positions())
        q[self._order] = position
        return q


def _pairs(scene_graph: SceneGraph) -> int:
    """Number of pairs of shapes that may touch."""
    return len(scene_graph.model_inspector().GetCollisionCandidates())
