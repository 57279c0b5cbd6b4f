"""A floor, walls, tables, and what touches them: spheres at the corners of contacts, or soft layers of spheres.

The floor, soft soles and what else the robot may lean on, as data.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import ContactModel, CoulombFriction, DiscreteContactApproximation, MultibodyPlant

from drake_tc.config.records import Checked, FromZero, Positive, Range
from drake_tc.errors import ParamsError
from drake_tc.loops.scenarios import ObjectSpec
from drake_tc.tsid.contacts import Contact
from drake_tc.types import FloatArray

Approximation = Literal["lagged", "sap", "similar"]
"""How Drake's discrete plant solves for contact forces; `python -m tests.benchmarks floor` compares them."""
LONG = 0.1
"""The largest sphere under a sole, and how far soles may reach beyond what the controller takes for them [m]."""


@dataclass(frozen=True)
class SoleSpec(Checked):
    """A soft layer under each sole, that lets the foot sink, tilt and roll: springs in a grid, on a rigid floor.

    Each of nx ny points carries k/(nx ny) of its depth and never pulls. At rest under a force F, c [m] off the middle
    of a sole of 2a x 2b, the foot sinks by F/k and tilts by F c/(k r^2), r^2 = a^2 (nx + 1)/(3 (nx - 1)) along x and
    the like along y, as long as all points touch: |c| < r^2/a. Farther out it rolls onto its edge.

    Attributes:
        stiffness: Stiffness k of a whole sole [N/m]; E A/h for a layer of modulus E, area A and thickness h.
        points: Number of contact points along x and y of the sole, the outermost at its corners; a point foot has one.
        dissipation: Hunt and Crossley dissipation [s/m]: under a load F the damping is F times this value. "sap" uses a
            relaxation time instead.
    """

    stiffness: Positive
    points: Annotated[tuple[int, ...], Range("two numbers >= 2", 2, size=2)] = (5, 3)
    dissipation: FromZero = 10.0


@dataclass(frozen=True)
class GroundSpec(Checked):
    """The floor z = 0 and how soles and points touch it: a sphere at each corner, point contact.

    Attributes:
        friction: Coulomb friction coefficient of the pair of surfaces.
        stiffness: Stiffness of each sphere [N/m]; None: as stiff as the step allows.
        dissipation: Hunt and Crossley dissipation [s/m].
        radius: Radius of the spheres [m], at most `LONG`.
        margin: Distance by which the soles are larger than the controller assumes [m], at most `LONG`; negative:
            smaller.
        approximation: How the discrete plant solves for contact forces. None: "sap" for hard soles, which stand best
            on it, and "lagged" for soft ones, which rock and slide best on it (`python -m tests.benchmarks floor`).
        stiction_tolerance: Speed v_s [m/s] of the regularised friction mu f_n v/sqrt(v^2 + v_s^2): a sticking foot
            creeps more slowly than this. Used by "lagged" and "similar"; "sap" has a tolerance of its own.
        sole: Soft layer under each sole in place of the spheres at the corners; None: no layer.
        supports: Boxes beside the floor that are as hard as the floor, for example a wall or a table.
    """

    friction: FromZero = 0.8
    stiffness: Positive | None = None
    dissipation: FromZero = 1.0
    radius: Annotated[float, Range(f"a length above 0 and at most {LONG:g}", 0.0, LONG, above=True)] = 0.01
    margin: Annotated[float, Range(f"a length from {-LONG:g} to {LONG:g}", -LONG, LONG)] = 0.005
    approximation: Approximation | None = None
    stiction_tolerance: Positive = 1e-5
    sole: SoleSpec | None = None
    supports: tuple[ObjectSpec, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stiffness is not None and self.sole is not None:
            raise ParamsError("ground: expected either stiffness, of hard soles, or sole, got both")

    @property
    def solver(self) -> Approximation:
        """The approximation that is used."""
        return self.approximation or ("sap" if self.sole is None else "lagged")


WIDE, THICK = 20.0, 1.0
"""The floor is the top of a block [m]."""
APPROXIMATIONS: dict[Approximation, Any] = {
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
    plant.RegisterCollisionGeometry(plant.world_body(), place, block, "ground", _surface(spec, spec.friction))
    for number, item in enumerate(spec.supports):
        centre: Any = np.array(item.xyz)
        name, pose = f"support_{number}", RigidTransform(RollPitchYaw(*item.rpy), centre)
        box, surface = Box(*item.size), _surface(spec, item.friction)
        plant.RegisterCollisionGeometry(plant.world_body(), pose, box, name, surface)
        plant.RegisterVisualGeometry(plant.world_body(), pose, box, f"{name}_visual", GREY)
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
    plant.set_discrete_contact_approximation(APPROXIMATIONS[spec.solver])
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


def _surface(spec: GroundSpec, friction: float) -> Any:
    """Of a box of the world: rigid under soft soles, else as hard as the step allows."""
    return CoulombFriction(friction, friction) if spec.sole is None else _material(friction, RIGID, 0.0)


def _material(friction: float, stiffness: float | None, dissipation: float) -> ProximityProperties:
    """Of point contact."""
    rough = CoulombFriction(friction, friction)
    material = ProximityProperties()
    AddContactMaterial(properties=material, friction=rough, dissipation=dissipation, point_stiffness=stiffness)
    return material
