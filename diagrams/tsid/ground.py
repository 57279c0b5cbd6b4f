"""A floor, and soles that touch it: a sphere at each corner of every contact of the controller."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from drake_tc.diagrams.tsid.scenario import GroundSpec
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, DiscreteContactApproximation, MultibodyPlant

from drake_tc.tsid.contacts import Contact

WIDE, THICK = 20.0, 1.0
"""The floor is the top of a block [m]."""
_APPROXIMATIONS = {
    "sap": DiscreteContactApproximation.kSap,
    "tamsi": DiscreteContactApproximation.kTamsi,
    "similar": DiscreteContactApproximation.kSimilar,
    "lagged": DiscreteContactApproximation.kLagged,
}


def add_ground(plant: MultibodyPlant, contacts: Sequence[Contact], spec: GroundSpec) -> None:
    """The floor z = 0 and the spheres; before `Finalize`, with a SceneGraph. Nothing else of the robot touches.

    The lowest points of the spheres are the sole's corners, moved out by the margin, z = 0 in the contact's frame.

    Args:
        plant: Holds the robot.
        contacts: Of the controller.
        spec: Material and solver.
    """
    rough = CoulombFriction(spec.friction, spec.friction)
    material = ProximityProperties()
    AddContactMaterial(
        properties=material, friction=rough, dissipation=spec.dissipation, point_stiffness=spec.stiffness
    )
    below: Any = np.array([0.0, 0.0, -0.5 * THICK])
    plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(below), Box(WIDE, WIDE, THICK), "ground", rough)
    for contact in contacts:
        body = plant.GetBodyByName(contact.frame.link)
        for number, corner in enumerate(contact.corners):
            centre: Any = corner + spec.margin * np.sign(corner) + np.array([0.0, 0.0, spec.radius])
            pose = contact.frame.pose.transform.multiply(RigidTransform(centre))
            plant.RegisterCollisionGeometry(body, pose, Sphere(spec.radius), f"{contact.name}_{number}", material)
    plant.set_discrete_contact_approximation(_APPROXIMATIONS[spec.approximation])
