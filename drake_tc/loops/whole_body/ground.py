"""A floor, walls, tables, and what touches them: spheres at the corners of contacts, or soft layers of spheres."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import ContactModel, CoulombFriction, DiscreteContactApproximation, MultibodyPlant

from drake_tc.errors import ParamsError
from drake_tc.loops.whole_body.ground_spec import Approximation, GroundSpec
from drake_tc.tsid.contacts import Contact
from drake_tc.types import FloatArray

WIDE, THICK = 20.0, 1.0
"""The floor is the top of a block [m]."""
_APPROXIMATIONS: dict[Approximation, Any] = {
    "lagged": DiscreteContactApproximation.kLagged,
    "sap": DiscreteContactApproximation.kSap,
    "similar": DiscreteContactApproximation.kSimilar,
}


RIGID = 1e12
"""Of a floor under soft soles [N/m]."""
GREY: Any = np.array([0.6, 0.6, 0.62, 1.0])


def add_ground(plant: MultibodyPlant, contacts: Sequence[Contact], spec: GroundSpec) -> None:
    """Floor z = 0, supports and spheres; before `Finalize`, with a SceneGraph. Nothing else of the robot touches.

    The lowest points of the spheres are z = 0 in the contact's frame: the sole's corners, moved out by the margin, or a
    grid between them where the soles are soft. All contacts of the plant become point contacts, also those of shapes
    that others have given a pressure field.

    Args:
        plant: Holds the robot.
        contacts: Of the controller.
        spec: Material and solver.

    Raises:
        ParamsError: see `touching_points`.
    """
    below: Any = np.array([0.0, 0.0, -0.5 * THICK])
    block, place = Box(WIDE, WIDE, THICK), RigidTransform(below)
    _fix(plant, "ground", block, place, spec, spec.friction)
    for number, item in enumerate(spec.supports):
        centre: Any = np.array(item.xyz)
        name, pose = f"support_{number}", RigidTransform(RollPitchYaw(*item.rpy), centre)
        _fix(plant, name, Box(*item.size), pose, spec, item.friction)
        plant.RegisterVisualGeometry(plant.world_body(), pose, Box(*item.size), f"{name}_visual", GREY)
    for contact in contacts:
        body, points = plant.GetBodyByName(contact.frame.link), touching_points(contact, spec)
        material = _material(spec.friction, spec.stiffness, spec.dissipation)
        if spec.sole is not None:
            material = _material(spec.friction, spec.sole.stiffness / len(points), spec.sole.dissipation)
        for number, point in enumerate(points):
            middle: Any = point + np.array([0.0, 0.0, spec.radius])
            pose = contact.frame.pose.transform.multiply(RigidTransform(middle))
            plant.RegisterCollisionGeometry(body, pose, Sphere(spec.radius), f"{contact.name}_{number}", material)
    plant.set_contact_model(ContactModel.kPoint)  # without a search for pressure fields, which no shape has
    plant.set_discrete_contact_approximation(_APPROXIMATIONS[spec.solver])
    plant.set_stiction_tolerance(spec.stiction_tolerance)


def touching_points(contact: Contact, spec: GroundSpec) -> FloatArray:
    """(m, 3) of a sole in the contact's frame, where it may touch the ground [m]; a point, soft or not, has one.

    Args:
        contact: Of the controller.
        spec: Of the floor.

    Raises:
        ParamsError: a margin so negative that nothing of the sole is left.
    """
    corners = contact.corners + spec.margin * np.sign(contact.corners)
    reach = np.abs(contact.corners[contact.corners != 0.0])
    least = reach.min(initial=np.inf)
    if not least + spec.margin > 0.0:
        raise ParamsError(
            f"ground.margin: expected more than {-least:g} m, where nothing is left of contact {contact.name!r},"
            f" got {spec.margin:g}"
        )
    if spec.sole is None or contact.kind == "point":
        return np.asarray(corners)
    ends = corners.min(axis=0), corners.max(axis=0)
    x, y = (np.linspace(ends[0][axis], ends[1][axis], spec.sole.points[axis]) for axis in (0, 1))
    return np.stack([*(grid.ravel() for grid in np.meshgrid(x, y)), np.zeros(x.size * y.size)], axis=1)


def _fix(plant: MultibodyPlant, name: str, box: Box, pose: RigidTransform, spec: GroundSpec, friction: float) -> None:
    """A box of the world: rigid under soft soles, else as hard as the step allows."""
    if spec.sole is None:
        plant.RegisterCollisionGeometry(plant.world_body(), pose, box, name, CoulombFriction(friction, friction))
    else:
        plant.RegisterCollisionGeometry(plant.world_body(), pose, box, name, _material(friction, RIGID, 0.0))


def _material(friction: float, stiffness: float | None, dissipation: float) -> ProximityProperties:
    """Of point contact."""
    rough = CoulombFriction(friction, friction)
    material = ProximityProperties()
    AddContactMaterial(properties=material, friction=rough, dissipation=dissipation, point_stiffness=stiffness)
    return material
