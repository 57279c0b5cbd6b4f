"""What pydrake's calls for the terms of a tick cost: a reference that no change of this library moves."""

from typing import Any

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable

from drake_tc.robot.plant import make_plant
from drake_tc.tsid.model import TsidModel
from drake_tc.types import FloatArray


class DrakeTerms:
    """M, C v and gravity, the centre of mass, and J and Jdot v of each contact's link, by Drake's own functions."""

    def __init__(self, model: TsidModel) -> None:
        """Build the plant of the same robot.

        Args:
            model: Of the robot.
        """
        plant: Any = make_plant(model.robot, 0.0)
        self._plant, self._context, self._world = plant, plant.CreateDefaultContext(), plant.world_frame()
        self._links = [plant.GetBodyByName(contact.frame.link).body_frame() for contact in model.contacts]
        self._origin = np.zeros((3, 1))

    def __call__(self, state: FloatArray) -> None:
        """All of them at [q; v]."""
        plant, context, world, by = self._plant, self._context, self._world, JacobianWrtVariable.kV
        plant.SetPositionsAndVelocities(context, state)
        plant.CalcMassMatrix(context)
        plant.CalcBiasTerm(context)
        plant.CalcGravityGeneralizedForces(context)
        plant.CalcCenterOfMassPositionInWorld(context)
        plant.CalcJacobianCenterOfMassTranslationalVelocity(context, by, world, world)
        plant.CalcBiasCenterOfMassTranslationalAcceleration(context, by, world, world)
        for link in self._links:
            plant.CalcJacobianSpatialVelocity(context, by, link, self._origin, world, world)
            plant.CalcBiasSpatialAcceleration(context, by, link, self._origin, world, world)
