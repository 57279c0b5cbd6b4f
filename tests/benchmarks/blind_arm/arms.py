"""The arms of the benchmark `arms`: URDFs of `example-robot-data`, whose inertias the simulated arms do not have."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia, UnitInertia

from drake_tc.config.quoted import did_you_mean
from drake_tc.errors import ParamsError
from drake_tc.robot.rigid_regressor import LINK_PARAMETERS
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class Arm:
    """One arm.

    Attributes:
        name: Short name.
        urdf: Below the robots of example-robot-data.
        base: Its first link.
        joints: Driven joints, from the base outwards.
        effort: Rated torque of each joint [N m], which scales friction, rotor and drive.
        loaded: Joints that bear enough weight for friction to grow with it.
        speed: Largest speed of each joint in the recorded motions [rad/s].
    """

    name: str
    urdf: str
    base: str
    joints: tuple[str, ...]
    effort: tuple[float, ...]
    loaded: tuple[str, ...]
    speed: tuple[float, ...]

    def robot_file(self) -> str:
        """The robot file, six lines."""
        document = {
            "name": self.name,
            "urdf": f"package://example-robot-data/robots/{self.urdf}",
            "base": self.base,
            "fixed_base": True,
            "joints": list(self.joints),
        }
        return str(yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=1000))


_UR_JOINTS = tuple(
    f"{part}_joint" for part in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
)
ARMS = (
    Arm(
        name="panda",
        urdf="panda_description/urdf/panda.urdf",
        base="panda_link0",
        joints=tuple(f"panda_joint{i}" for i in range(1, 8)),
        effort=(87.0,) * 4 + (12.0,) * 3,
        loaded=("panda_joint2", "panda_joint4"),
        speed=(1.4,) * 4 + (1.8,) * 3,
    ),
    Arm(
        name="kinova",
        urdf="kinova_description/robots/kinova.urdf",
        base="base",
        joints=tuple(f"j2s6s200_joint_{i}" for i in range(1, 7)),
        effort=(40.0, 40.0, 40.0, 12.0, 12.0, 12.0),
        loaded=("j2s6s200_joint_2", "j2s6s200_joint_3"),
        speed=(0.6,) * 3 + (0.8,) * 3,
    ),
    Arm(
        name="ur5",
        urdf="ur_description/urdf/ur5_robot.urdf",
        base="base_link",
        joints=_UR_JOINTS,
        effort=(150.0,) * 3 + (28.0,) * 3,
        loaded=("shoulder_lift_joint", "elbow_joint"),
        speed=(1.5,) * 3 + (2.0,) * 3,
    ),
    Arm(
        name="ur10",
        urdf="ur_description/urdf/ur10_robot.urdf",
        base="base_link",
        joints=_UR_JOINTS,
        effort=(330.0, 330.0, 150.0, 54.0, 54.0, 54.0),
        loaded=("shoulder_lift_joint", "elbow_joint"),
        speed=(1.3, 1.3, 1.5, 2.0, 2.0, 2.0),
    ),
)
REFERENCE = "ur5"
"""Name of the arm that a benchmark of one arm takes by default."""


def arm_named(name: str) -> Arm:
    """One of `ARMS`.

    Raises:
        ParamsError: Another name.
    """
    arms = {arm.name: arm for arm in ARMS}
    if name not in arms:
        raise ParamsError(f"no arm {name!r}{did_you_mean(name, arms)}; arms: {', '.join(arms)}")
    return arms[name]


@dataclass(frozen=True)
class LinkError:
    """By how much a link of the simulated arm differs from the URDF's.

    Attributes:
        mass: Factor of its mass.
        inertia: Factor of the inertia about its centre of mass.
        com: Shift of its centre of mass, in its axes [m].
    """

    mass: float
    inertia: float
    com: tuple[float, float, float]


def apply_errors(plant: MultibodyPlant, context: Any, errors: dict[str, LinkError]) -> None:
    """Change the links' inertias in a plant's context.

    Args:
        plant: Of the URDF.
        context: Of the plant.
        errors: By link.
    """
    for name, error in errors.items():
        body: Any = plant.GetBodyByName(name)
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        com = np.asarray(inertia.get_com())
        central = inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        mass, shifted = inertia.get_mass() * error.mass, com + np.array(error.com)
        about = central * error.inertia + mass * (shifted @ shifted * np.eye(3) - np.outer(shifted, shifted))
        body.SetSpatialInertiaInBodyFrame(context, _spatial(mass, shifted, about))


@dataclass(frozen=True)
class Body:
    """A rigid body that a link carries.

    Attributes:
        mass: [kg].
        centre: (3,) in the link's frame [m].
        radius: Of gyration about the centre, the same about each axis [m].
    """

    mass: float
    centre: FloatArray
    radius: float


def attach(plant: MultibodyPlant, context: Any, link: str, carried: Body) -> None:
    """Fix a body to a link, in a plant's context."""
    body: Any = plant.GetBodyByName(link)
    c = carried.centre
    about = carried.mass * (carried.radius**2 * np.eye(3) + c @ c * np.eye(3) - np.outer(c, c))
    total = body.CalcSpatialInertiaInBodyFrame(context)
    total += _spatial(carried.mass, c, about)
    body.SetSpatialInertiaInBodyFrame(context, total)


def _spatial(mass: float, com: FloatArray, inertia: FloatArray) -> Any:
    """From mass, centre of mass and the inertia about the link's origin (3, 3)."""
    unit = inertia / mass
    made: Any = UnitInertia(
        Ixx=unit[0, 0], Iyy=unit[1, 1], Izz=unit[2, 2], Ixy=unit[0, 1], Ixz=unit[0, 2], Iyz=unit[1, 2]
    )
    point: Any = com
    return SpatialInertia(mass, point, made, skip_validity_check=True)


def moving_links(plant: MultibodyPlant, robot: Robot) -> tuple[str, ...]:
    """The link beyond each of the robot's joints."""
    return tuple(str(plant.GetJointByName(joint).child_body().name()) for joint in robot.joints)


def link_parameters(plant: MultibodyPlant, context: Any, links: tuple[str, ...]) -> dict[str, float]:
    """`<link>/<parameter>` of these links, each with all that is welded to it, about the link's origin.

    Added up body by body: m, m c and the inertia are sums over the bodies in the axes of the link.
    """
    found: dict[str, float] = {}
    for name in links:
        link: Any = plant.GetBodyByName(name)
        total = np.zeros(10)
        for body in (link, *(b for b in plant.GetBodiesWeldedTo(link) if b.index() != link.index())):
            total += _ten(body, link, plant, context)
        found |= {f"{name}/{p}": float(v) for p, v in zip(LINK_PARAMETERS, total, strict=True)}
    return found


def _ten(body: Any, link: Any, plant: Any, context: Any) -> FloatArray:
    """(10,) of one body about the link's origin, in the link's axes."""
    spatial: Any = body.CalcSpatialInertiaInBodyFrame(context)
    mass = spatial.get_mass()
    if mass == 0.0:
        return np.zeros(10)
    X_LB: Any = plant.CalcRelativeTransform(context, link.body_frame(), body.body_frame())
    R, p = X_LB.rotation().matrix(), X_LB.translation()
    com = R @ np.asarray(spatial.get_com()) + p
    central = spatial.Shift(spatial.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    inertia = R @ central @ R.T + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.array([mass, *(mass * com), *inertia[np.triu_indices(3)]])
