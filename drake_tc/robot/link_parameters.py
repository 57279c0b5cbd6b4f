"""The inertial parameters of a robot's moving links: what its file says, how far that may be off, and what they weigh.

Joint torques are linear in them, tau = Y(q, v, vdot) pi (`robot.rigid_regressor`).
"""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from drake_tc.errors import ParamsError
from drake_tc.robot.plant import make_plant
from drake_tc.robot.rigid_regressor import LinkTree, link_tree, regressor
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray, IntArray

UNITS = ("kg", "kg*m", "kg*m", "kg*m", *("kg*m^2",) * 6)
"""Of `LINK_PARAMETERS`."""
SMALLEST = 0.03
"""Size of a link [m], at least."""
PAYLOAD_SIZE = 0.2
"""Of an unknown payload [m]."""
LIGHTEST = 0.02
"""Mass of a link, as a share of all links' mean mass, that its tolerance refers to at least."""


@dataclass(frozen=True, eq=False)
class LinkModel:
    """The moving links of a robot with a fixed base; n joints.

    Attributes:
        tree: Kinematics, joints in the order of the plant.
        order: (n,) place of each of the robot's joints in the tree.
        moves, offset: G (l, n) and g (l,) of the tree's joints; those that follow others are among them.
        nominal: pi (10 n,) of the robot's file, in the order of `tree.parameters`; what is welded to a link is part
            of it.
        size: (n,) of each link [m]: the largest of radius of gyration, distance of the centre of mass and half the
            distance of the joints beyond it.
    """

    tree: LinkTree
    order: IntArray
    moves: FloatArray
    offset: FloatArray
    nominal: FloatArray
    size: FloatArray

    def columns(self, q: FloatArray, v: FloatArray, vdot: FloatArray) -> FloatArray:
        """Y (T, n, 10 l) of l links, of (T, n) in the order of the robot's joints.

        With the joints that follow others, q_tree = G q + g, tau = G^T Y(q_tree) pi.
        """
        of_tree = regressor(self.tree, q @ self.moves.T + self.offset, v @ self.moves.T, vdot @ self.moves.T)
        return np.asarray(np.einsum("ji,tjp->tip", self.moves, of_tree))

    @property
    def payload_deviations(self) -> FloatArray:
        """(10,) standard deviations of what a link may carry: the mass of all links, some decimetres away."""
        return np.asarray(float(self.nominal[::10].sum()) * PAYLOAD_SIZE ** np.array([0.0, *(1.0,) * 3, *(2.0,) * 6]))

    @property
    def outermost(self) -> tuple[str, ...]:
        """Links beyond which there is no other joint."""
        return tuple(link for number, link in enumerate(self.tree.links) if number not in self.tree.parent)

    def deviations(self, tolerance: float) -> FloatArray:
        """(10 n,) standard deviations of pi about the file's: r m of a mass, r m l of a first moment, r m l^2 of a
        moment of inertia, for a link of mass m and size l and the relative tolerance r.
        """
        masses = self.nominal[::10]
        masses = np.maximum(masses, LIGHTEST * max(float(masses.mean()), 1e-6))
        powers = np.array([0.0, *(1.0,) * 3, *(2.0,) * 6])
        return np.asarray(tolerance * masses[:, None] * self.size[:, None] ** powers).reshape(-1)


def link_model(robot: Robot) -> LinkModel:
    """Read links and kinematics from the robot's URDF.

    Raises:
        ParamsError: a base that is not fixed, or a URDF that cannot be read.
        IdentificationError: a joint that neither turns nor slides.
    """
    if not robot.fixed_base:
        raise ParamsError(
            f"{robot.source or robot.name}: fixed_base: load: {{robot: fitted}} requires a robot whose base is fixed "
            "to the ground, got a floating one"
        )
    plant = make_plant(robot, 0.0, followers="free")
    tree = link_tree(plant)
    order = np.array([tree.joints.index(name) for name in robot.joints], dtype=np.int64)
    moves, offset = np.zeros((len(tree.joints), len(robot.joints))), np.zeros(len(tree.joints))
    moves[order, np.arange(order.size)] = 1.0
    for name, law in robot.followers.items():
        at = tree.joints.index(name)
        moves[at, robot.joints.index(law.of)], offset[at] = law.multiplier, law.offset
    nominal = np.concatenate([_inertial(plant, link) for link in tree.links])
    return LinkModel(tree, order, moves, offset, nominal, _sizes(tree, nominal.reshape(-1, 10)))


def _inertial(plant: MultibodyPlant, link: str) -> FloatArray:
    """(10,) of a link and all that is welded to it."""
    body = plant.GetBodyByName(link)
    welded = [b.index() for b in plant.GetBodiesWeldedTo(body)]
    spatial = plant.CalcSpatialInertia(plant.CreateDefaultContext(), body.body_frame(), welded)
    mass = spatial.get_mass()
    moment = mass * np.asarray(spatial.get_com())
    inertia = np.asarray(spatial.CalcRotationalInertia().CopyToFullMatrix3())
    return np.array([mass, *moment, *inertia[np.triu_indices(3)]])


def _sizes(tree: LinkTree, nominal: FloatArray) -> FloatArray:
    """(n,) see `LinkModel`; nominal (n, 10)."""
    mass = np.maximum(nominal[:, 0], 1e-9)
    com = np.linalg.norm(nominal[:, 1:4], axis=1) / mass
    gyration = np.sqrt(np.maximum(nominal[:, [4, 7, 9]].sum(axis=1), 0.0) / (2.0 * mass))
    size = np.maximum(np.maximum(com, gyration), SMALLEST)
    for child, parent in enumerate(tree.parent):
        if parent >= 0:
            size[parent] = max(size[parent], 0.5 * float(np.linalg.norm(tree.p_PF[child])))
    return np.asarray(size)
