"""The robot as the controller knows it: its tree, its contacts, and the terms of the dynamics at one state.

Drake's plant says what the robot is made of; the terms themselves are those of `drake_tc.kernels.dynamics`. With c =
p_BoG and the base's rows of M and C v, which are momentum and its rate about the base's origin Bo,

    A_G = X M[:6],  Adot_G v = X (C v)[:6],  X = [1 -S(c); 0 1]
    h = C v - M a_g,  a_g = [0; gravity] of the base, as no joint needs a torque where all of the robot falls freely

What a TsidModel adds to the links of its plant before that is finalized: named frames; and its rotors, checked.

A robot's positions moved on their manifold: for motions of the model itself, without a plant.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, QuaternionFloatingJoint

from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.fields import Mount
from drake_tc.robot.plant import TreeJoints, file_rotors, make_plant, tree_of
from drake_tc.robot.robot import Robot
from drake_tc.robot.urdf import reduced_urdf
from drake_tc.tsid.contacts import ActiveContacts, Contact, select
from drake_tc.tsid.rows import FrameTerms, Pose, Terms
from drake_tc.types import FloatArray, IntArray

_SUFFIX = "_of_tsid"


def checked_rotors(robot: Robot, rotor_inertia: Mapping[str, float]) -> Mapping[str, float]:
    """Reflected inertias by joint [kg m^2], as given; a joint that is not there has none.

    Raises:
        ParamsError: an unknown joint, or an inertia that is negative or not finite.
    """
    for name, inertia in rotor_inertia.items():
        if name not in robot.joints:
            raise ParamsError(f"rotor_inertia: no joint {name!r}; joints: {', '.join(robot.joints)}")
        if not (np.isfinite(inertia) and inertia >= 0.0):
            raise ParamsError(f"rotor_inertia: {name}: expected a number >= 0 [kg m^2], got {inertia!r}")
    return rotor_inertia


def add_frames(plant: Any, model: Any, contacts: Sequence[Contact], more: Sequence[Mount]) -> dict[str, Any]:
    """The frame of each link, contact and mount, by name.

    Args:
        plant: Not finalized; gets the frames of contacts and mounts.
        model: Instance of the robot.
        contacts: Each with its frame C.
        more: Other frames.

    Raises:
        ParamsError: a link that is not there, or a name that is taken.
    """
    links = {plant.get_body(index).name(): plant.get_body(index) for index in plant.GetBodyIndices(model)}
    frames = {name: body.body_frame() for name, body in links.items()}
    named = [("contact", contact.name, contact.frame) for contact in contacts]
    for kind, name, mount in [*named, *(("frame", mount.name, mount) for mount in more)]:
        if mount.link not in links:
            raise ParamsError(f"{kind} {name!r}: no link {mount.link!r}; links: {', '.join(links)}")
        if name in frames:
            raise ParamsError(f"{kind} {name!r}: expected a name that no link, contact or frame has; it is taken")
        offset = FixedOffsetFrame(name + _SUFFIX, links[mount.link].body_frame(), mount.pose.transform)
        frames[name] = plant.AddFrame(offset)
    return frames


_TERMS, _FRAME = Kernel("tsid.terms", "terms"), Kernel("tsid.terms", "frame_terms")
_LEAST_MASS = 1e-12
"""Smallest eigenvalue of M, its diagonal scaled to ones."""
SHORTEST = 1e-12
"""Square of the norm of a quaternion that still says something."""


class TsidModel:
    """n driven joints in the robot's order, nv velocities in the order of a plant that holds this robot alone.

    Joints that follow others by `<mimic>` are no part of q and v: they move and weigh with the joint that they follow.
    Such a plant has them welded (`drake_tc.robot.plant.make_plant`).

    Attributes:
        robot: As given.
        contacts: As given; a mask over them says which are active.
        n, nv, nq: Driven joints, velocities, positions.
        actuated: (n,) index in v of each joint.
        positions: (n,) index in q of each joint.
        force_size: K, of the forces of all contacts.
        rotors: (n,) reflected rotor inertias that the mass matrix has [kg m^2].
        mass: [kg].
        start: (nq,) q in the robot's posture, its base where the robot file says.
        tree_arguments: The robot as compiled functions take it (`drake_tc.kernels.tsid.terms.Robot`).
    """

    def __init__(
        self,
        robot: Robot,
        contacts: Sequence[Contact] = (),
        *,
        frames: Sequence[Mount] = (),
        rotor_inertia: Mapping[str, float] | None = None,
    ) -> None:
        """Build the plant.

        Args:
            robot: Its base floats or is welded.
            contacts: All that may ever be active.
            frames: More frames for tasks, beside links and contacts.
            rotor_inertia: Reflected rotor inertia by joint [kg m^2]; None for that of the robot file, or of the
                actuator file that it names.

        Raises:
            ParamsError: a link or joint that is not there, a name that is taken, a joint that moves no mass, or a URDF
                that cannot be read.
        """
        self.robot, self.contacts = robot, tuple(contacts)
        self.force_size = sum(contact.size for contact in self.contacts)
        plant: Any = MultibodyPlant(0.0)
        (model,) = Parser(plant).AddModelsFromString(reduced_urdf(robot, followers="free"), "urdf")
        base = plant.GetBodyByName(robot.base, model)
        plant.AddJoint(QuaternionFloatingJoint("base_of_tsid", plant.world_frame(), base.body_frame()))
        rotors = checked_rotors(robot, file_rotors(robot) if rotor_inertia is None else rotor_inertia)
        self.rotors: FloatArray = np.array([rotors.get(name, 0.0) for name in robot.joints])
        self.rotors.setflags(write=False)
        named = add_frames(plant, model, self.contacts, frames)
        plant.Finalize()
        self._set_order(plant.num_velocities() - len(robot.followers))
        self._frames = {name: number for number, name in enumerate(named)}
        places = dict(zip(robot.joints, zip(self.positions.tolist(), self.actuated.tolist(), strict=True), strict=True))
        tree = tree_of(plant, base, TreeJoints(places, robot.followers, rotors), named)
        self.mass = float(tree.trunk[0] + tree.constants[:, 15].sum())
        pose = robot.base_pose.transform
        self._held: FloatArray = np.array([*pose.rotation().ToQuaternion().wxyz(), *pose.translation()])
        contacts_table = [(self._frames[contact.name], contact.upright, contact.size) for contact in self.contacts]
        self.tree_arguments = (
            self._held,
            self._floating,
            tree.places,
            tree.constants,
            tree.trunk,
            np.array(plant.gravity_field().gravity_vector()),
            tree.frames,
            tree.frame_bodies,
            np.array(contacts_table, dtype=np.int64).reshape(-1, 3),
        )
        self._check_mass()

    def _set_order(self, velocities: int) -> None:
        """Where the joints and the base stand in q and v."""
        robot = self.robot
        public: Any = make_plant(robot, 0.0, followers="weld")
        self.nq, self.nv, self.n = public.num_positions(), public.num_velocities(), len(robot.joints)
        fixed = 0 if robot.fixed_base else 6
        if self.nv != self.n + fixed or velocities != self.n + 6:
            raise ParamsError(
                f"robot {robot.name!r}: expected {self.n} movable joints, those listed, got {self.nv - fixed}"
            )
        self.start: FloatArray = public.GetPositions(public.CreateDefaultContext())
        self.start.setflags(write=False)
        theirs = [public.GetJointByName(name) for name in robot.joints]
        self.actuated: IntArray = np.array([joint.velocity_start() for joint in theirs], dtype=np.int64)
        self.positions: IntArray = np.array([joint.position_start() for joint in theirs], dtype=np.int64)
        places = [-1, -1]
        if not robot.fixed_base:
            body = public.GetBodyByName(robot.base)
            places = [body.floating_positions_start(), body.floating_velocities_start_in_v()]
        self._floating: IntArray = np.array(places, dtype=np.int64)

    def _check_mass(self) -> None:
        """Refuse joints that move nothing: no torque has an answer there."""
        terms = self.terms(self.create_scratch(), self.start, np.zeros(self.nv))
        inertia = terms.mass_matrix.diagonal()
        least = int(np.argmin(inertia[self.actuated]))
        scale = 1.0 / np.sqrt(np.maximum(inertia, np.finfo(float).tiny))
        if np.linalg.eigvalsh(terms.mass_matrix * scale * scale[:, None])[0] < _LEAST_MASS:
            raise ParamsError(
                f"robot {self.robot.name!r}: expected a mass matrix that is positive definite; joint"
                f" {self.robot.joints[least]!r} moves {inertia[self.actuated][least]:.3g} kg m^2 (or kg): give it a"
                " rotor_inertia, or lock it"
            )

    @property
    def base_places(self) -> tuple[int, int]:
        """Where the pose of a floating base begins in q and its velocity in v; (-1, -1) where the base is welded."""
        return int(self._floating[0]), int(self._floating[1])

    def create_scratch(self) -> "Scratch":
        """Scratch memory for `terms`."""
        return Scratch(self.contacts)

    def frame_names(self) -> tuple[str, ...]:
        """What `Terms.frame` knows."""
        return tuple(self._frames)

    def terms(self, scratch: "Scratch", q: FloatArray, v: FloatArray, active: tuple[bool, ...] | None = None) -> Terms:
        """The terms at a state; all NaN where the state is not finite or the base's quaternion is zero.

        Args:
            scratch: From `create_scratch`.
            q: (nq,).
            v: (nv,).
            active: Which contacts carry; None for all.

        Raises:
            ParamsError: a mask of another length than the contacts.
        """
        contacts = scratch.select(active)
        if not self._is_state(q, v):
            return self._lost(q, v, contacts)
        bodies, mass_matrix, bias, jacobian, drift, slip, com, com_velocity, momentum, rate = _TERMS(
            q, v, self.tree_arguments, contacts.places
        )
        frames = _Frames(self, q, bodies)
        return Terms(
            q=q,
            v=v,
            mass_matrix=mass_matrix,
            bias=bias,
            actuated=self.actuated,
            joint_position=q[self.positions],
            contact_jacobian=jacobian,
            contact_bias=drift,
            contact_velocity=slip,
            mass=self.mass,
            com=com,
            com_velocity=com_velocity,
            momentum_matrix=momentum,
            momentum_bias=rate,
            frame=frames,
            pose=frames.pose,
            contacts=contacts,
        )

    def _is_state(self, q: FloatArray, v: FloatArray) -> bool:
        """Whether it is finite and the base's quaternion says something."""
        first = self._floating[0]
        turn = self._held[:4] if first < 0 else q[first : first + 4]
        return bool(turn.dot(turn) > SHORTEST and q.dot(q) + v.dot(v) < np.inf)

    def frame(self, q: FloatArray, bodies: FloatArray, name: str) -> FrameTerms:
        """All of a frame at a state.

        Args:
            q: (nq,).
            bodies: Of `drake_tc.kernels.tsid.terms.terms` at this state.
            name: One of `frame_names`.
        """
        return FrameTerms(*_FRAME(q, self.tree_arguments, bodies, self._frames[name], self.nv))

    def _lost(self, q: FloatArray, v: FloatArray, contacts: ActiveContacts) -> Terms:
        """Terms of NaN."""
        n, nv, k = self.n, self.nv, contacts.size

        def nan(*shape: int) -> FloatArray:
            return np.full(shape, np.nan)

        return Terms(
            q=q,
            v=v,
            mass_matrix=nan(nv, nv),
            bias=nan(nv),
            actuated=self.actuated,
            joint_position=nan(n),
            contact_jacobian=nan(k, nv),
            contact_bias=nan(k),
            contact_velocity=nan(k),
            mass=np.nan,
            com=nan(3),
            com_velocity=nan(3),
            momentum_matrix=nan(6, nv),
            momentum_bias=nan(6),
            frame=lambda name: FrameTerms(nan(3, 3), nan(3), nan(6), nan(6, nv), nan(6)),
            pose=lambda name: (nan(3, 3), nan(3)),
            contacts=contacts,
        )


class _Frames:
    """`Terms.frame` and `Terms.pose`: each frame once."""

    def __init__(self, model: TsidModel, q: FloatArray, bodies: FloatArray) -> None:
        self._model, self._q, self._bodies = model, q, bodies
        self._known: dict[str, FrameTerms] = {}

    def __call__(self, name: str) -> FrameTerms:
        known = self._known.get(name)
        if known is None:
            known = self._known[name] = self._model.frame(self._q, self._bodies, name)
        return known

    def pose(self, name: str) -> Pose:
        frame = self(name)
        return frame.rotation, frame.position


class Scratch:
    """Layouts of contact masks, each made once; a copy is a new one, for another Context."""

    def __init__(self, contacts: tuple[Contact, ...]) -> None:
        self._contacts = contacts
        self._selections: dict[tuple[bool, ...] | None, ActiveContacts] = {}

    def __deepcopy__(self, memo: object) -> "Scratch":
        return Scratch(self._contacts)

    def select(self, active: tuple[bool, ...] | None) -> ActiveContacts:
        """The active contacts, each mask laid out once."""
        known = self._selections.get(active)
        if known is None:
            known = self._selections[active] = select(self._contacts, active)
        return known


def moved(model: TsidModel, q: FloatArray, v: FloatArray, dt: float) -> FloatArray:
    """Q (+) dt v (nq,), its quaternion of length 1: where a constant v leads; a floating base turns exactly.

    Args:
        model: Of the robot; says where joints stand in q and v.
        q: (nq,) [quaternion, p of a floating base; joints].
        v: (nv,) [omega, velocity of a floating base, in the world's axes; joints].
        dt: [s].
    """
    there = q.copy()
    there[model.positions] += dt * v[model.actuated]
    if model.robot.fixed_base:
        return there
    there[4:7] += dt * v[3:6]
    turn = dt * v[:3]
    half = 0.5 * math.sqrt(float(turn @ turn))
    scalar, vector = math.cos(half), 0.5 * float(np.sinc(half / math.pi)) * turn
    there[0] = scalar * q[0] - vector @ q[1:4]
    there[1:4] = scalar * q[1:4] + q[0] * vector + np.cross(vector, q[1:4])
    there[:4] /= np.linalg.norm(there[:4])
    return there
