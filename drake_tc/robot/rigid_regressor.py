"""Joint torques of a tree of rigid links, linear in the links' inertial parameters.

The inertial parameters of a robot's moving links: what its file says, how far that may be off, and what they weigh.

Joint torques are linear in them, tau = Y(q, v, vdot) pi (`regressor`).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointIndex

from drake_tc.errors import IdentificationError, ParamsError
from drake_tc.robot.plant import has_axis, is_revolute, joint_axes, make_plant
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray, IntArray

LINK_PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Of one moving link, about its origin Bo and in its frame B [kg, kg m, kg m^2]; Ixy is a product of inertia as it
stands in the matrix. What is welded to the link is part of it."""
_INERTIA_PLACES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


@dataclass(frozen=True, eq=False)
class LinkTree:
    """The moving links of a plant, one one-degree-of-freedom joint each, in the order of the plant's velocities.

    Attributes:
        joints: Names of the joints (n).
        links: Names of the links they move (n).
        parent: Index of the link inboard, -1 for the world (n).
        R_PF, p_PF: (n, 3, 3), (n, 3) joint frame F at zero position, seen from the link inboard.
        axis: (n, 3) in F, which is the link's frame at zero position.
        revolute: (n,) whether the joint turns; otherwise it slides.
        gravity: (3,) [m/s^2] in the world.
    """

    joints: tuple[str, ...]
    links: tuple[str, ...]
    parent: tuple[int, ...]
    R_PF: FloatArray
    p_PF: FloatArray
    axis: FloatArray
    revolute: tuple[bool, ...]
    gravity: FloatArray

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the 10 n inertial parameters, `<link>/<name>`."""
        return tuple(f"{link}/{name}" for link in self.links for name in LINK_PARAMETERS)


def link_tree(plant: MultibodyPlant) -> LinkTree:
    """Read the kinematics from a finalized plant whose base is welded.

    Raises:
        IdentificationError: a joint that neither turns nor slides, or a floating base.
    """
    context = plant.CreateDefaultContext()
    zero: Any = np.zeros(plant.num_positions())
    plant.SetPositions(context, zero)
    joints = [plant.get_joint(JointIndex(int(i))) for i in plant.GetJointIndices()]
    free = sorted((j for j in joints if j.num_velocities() > 0), key=lambda j: int(j.velocity_start()))
    moving = [j for j in free if has_axis(j)]
    odd = [j.name() for j in free if not has_axis(j)]
    if odd:
        raise IdentificationError(
            f"rigid-body regressor: expected joints that turn or slide, got also {', '.join(odd)}"
        )
    above = {int(j.child_body().index()): j for j in joints}
    owner = {int(j.child_body().index()): i for i, j in enumerate(moving)}
    rotation, origin, axis, parent = [], [], [], []
    for joint, given in zip(moving, joint_axes(plant, moving), strict=True):
        body = joint.parent_body()
        while int(body.index()) not in owner and int(body.index()) in above:
            body = above[int(body.index())].parent_body()
        X_PF = plant.CalcRelativeTransform(context, body.body_frame(), joint.child_body().body_frame())
        turned = joint.frame_on_child().GetFixedPoseInBodyFrame().rotation().matrix()
        rotation.append(X_PF.rotation().matrix())
        origin.append(X_PF.translation())
        axis.append(turned @ given)
        parent.append(owner.get(int(body.index()), -1))
    return LinkTree(
        joints=tuple(j.name() for j in moving),
        links=tuple(j.child_body().name() for j in moving),
        parent=tuple(parent),
        R_PF=np.array(rotation),
        p_PF=np.array(origin),
        axis=np.array(axis),
        revolute=tuple(is_revolute(j) for j in moving),
        gravity=np.array(plant.gravity_field().gravity_vector()),
    )


def regressor(tree: LinkTree, q: FloatArray, v: FloatArray, vdot: FloatArray) -> FloatArray:
    """Y (T, n, 10 n) with tau = Y pi: the joint torques that a motion needs, gravity included.

    Forward, in each link's own frame B with gravity as an upward acceleration of the base:

        omega, alpha, a  of Bo from the link inboard and the joint's q, v, vdot
        f = m a + (alpha x + omega x omega x) m c,    n = m c x a + I alpha + omega x I omega

    and backward: every link's wrench is carried to the joints inboard and projected on their axes.

    Args:
        tree: Of n joints.
        q: (T, n) [rad or m].
        v: Its rate.
        vdot: And that one's.

    Raises:
        IdentificationError: shapes that are not (T, n).

    Source: Atkeson, An and Hollerbach, Estimation of Inertial Parameters of Manipulator Loads and Links (1986).
    """
    n = len(tree.joints)
    if any(x.ndim != 2 or x.shape != q.shape or x.shape[1] != n for x in (q, v, vdot)):
        raise IdentificationError(
            f"regressor: expected q, v, vdot of shape (T, {n}), got {q.shape}, {v.shape}, {vdot.shape}"
        )
    motion = _Motion.of(tree, q, v, vdot)
    out = np.zeros((q.shape[0], n, 10 * n))
    for link in range(n):
        force, moment = _wrench(motion.omega[link], motion.alpha[link], motion.a[link])
        at = link
        while at >= 0:
            along = moment if tree.revolute[at] else force
            out[:, at, 10 * link : 10 * link + 10] = np.einsum("k,tkp->tp", tree.axis[at], along)
            R, p = motion.R_PB[at], motion.p_PB[at]
            force = np.einsum("tij,tjp->tip", R, force)
            moment = np.einsum("tij,tjp->tip", R, moment) + np.cross(p[:, :, None], force, axis=1)
            at = tree.parent[at]
    return out


@dataclass(frozen=True, eq=False)
class _Motion:
    """Of each link, in its own frame (T, 3): angular velocity and acceleration, acceleration of its origin less
    gravity; and its pose in the link inboard, R_PB (T, 3, 3), p_PB (T, 3).
    """

    omega: list[FloatArray]
    alpha: list[FloatArray]
    a: list[FloatArray]
    R_PB: list[FloatArray]
    p_PB: list[FloatArray]

    @staticmethod
    def of(tree: LinkTree, q: FloatArray, v: FloatArray, vdot: FloatArray) -> "_Motion":
        samples = q.shape[0]
        out = _Motion([], [], [], [], [])
        rest = np.zeros((samples, 3))
        for i, parent in enumerate(tree.parent):
            axis = tree.axis[i]
            turns = tree.revolute[i]
            angle = q[:, i] if turns else np.zeros(samples)
            R = tree.R_PF[i] @ _rotation(axis, angle)
            slide = 0.0 * angle if turns else q[:, i]
            p = tree.p_PF[i] + slide[:, None] * (tree.R_PF[i] @ axis)
            if parent < 0:
                w, al, a = rest, rest, np.broadcast_to(-tree.gravity, (samples, 3))
            else:
                w, al, a = out.omega[parent], out.alpha[parent], out.a[parent]
            a = a + np.cross(al, p) + np.cross(w, np.cross(w, p))
            w, al, a = (np.einsum("tji,tj->ti", R, x) for x in (w, al, a))
            rate, change = v[:, i, None] * axis, vdot[:, i, None] * axis
            if turns:
                al = al + change + np.cross(w, rate)
                w = w + rate
            else:
                a = a + change + 2.0 * np.cross(w, rate)
            for values, value in zip((out.omega, out.alpha, out.a, out.R_PB, out.p_PB), (w, al, a, R, p), strict=True):
                values.append(value)
        return out


def _rotation(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """(T, 3, 3) turns by `angle` (T,) about a unit axis (3,), after Rodrigues."""
    k = np.cross(np.eye(3), axis)
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + s * k + (1.0 - c) * (k @ k))


def _skew(x: FloatArray) -> FloatArray:
    """[x] (T, 3, 3) with [x] y = x x y."""
    out = np.zeros((x.shape[0], 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -x[:, 2], x[:, 1], -x[:, 0]
    return out - np.swapaxes(out, 1, 2)


def _times_inertia(x: FloatArray) -> FloatArray:
    """L(x) (T, 3, 6) with L(x) (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) = I x."""
    out = np.zeros((x.shape[0], 3, 6))
    for column, (i, j) in enumerate(_INERTIA_PLACES):
        out[:, i, column] += x[:, j]
        if i != j:
            out[:, j, column] += x[:, i]
    return out


def _wrench(omega: FloatArray, alpha: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(force, moment about Bo) (T, 3, 10) each, of one link's ten parameters."""
    samples = omega.shape[0]
    turning = _skew(omega)
    force, moment = np.zeros((samples, 3, 10)), np.zeros((samples, 3, 10))
    force[:, :, 0] = a
    force[:, :, 1:4] = _skew(alpha) + turning @ turning
    moment[:, :, 1:4] = -_skew(a)
    moment[:, :, 4:] = _times_inertia(alpha) + turning @ _times_inertia(omega)
    return force, moment


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
