"""The robot as the controller knows it: its own plant, its contacts, and the terms of the dynamics at one state.

The plant's base always floats, also that of a robot whose base is welded, which is then held where it is. The base's
rows of M and of C v are momentum and its rate, seen from the base's origin Bo, so they give the rest without a call:

    mass m, m S(c) from M's first six columns, c = p_BoG;  A_G = X M[:6],  Adot_G v = X (C v)[:6],  X = [1 -S(c); 0 1]
    h = C v - M a_g,  a_g = [0; gravity] of the base, as no joint needs a torque where all of the robot falls freely
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, QuaternionFloatingJoint

from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import as_slice
from drake_tc.robot.mounts import Mount
from drake_tc.robot.plant import make_plant
from drake_tc.robot.robot import Robot
from drake_tc.robot.rotors import file_rotors
from drake_tc.robot.urdf import reduced_urdf
from drake_tc.tsid.contacts import ActiveContacts, Contact, select
from drake_tc.tsid.model_parts import add_frames, add_rotors
from drake_tc.tsid.rows import identity
from drake_tc.tsid.terms import FrameTerms, Pose, Terms
from drake_tc.types import FloatArray, IntArray

_ORIGIN: Any = np.zeros(3)
_SAME = identity(6)
_LEAST_MASS = 1e-12
"""Smallest eigenvalue of M, its diagonal scaled to ones."""
_SHORTEST = 1e-12
"""Square of the norm of a quaternion that still says something."""


class TsidModel:
    """n driven joints in the robot's order, nv velocities in the order of a plant that holds this robot alone.

    Attributes:
        robot: As given.
        contacts: As given; a mask over them says which are active.
        n, nv, nq: Driven joints, velocities, positions.
        actuated: (n,) index in v of each joint.
        positions: (n,) index in q of each joint.
        force_size: K, of the forces of all contacts.
        start: (nq,) q in the robot's posture, its base where the robot file says.
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
        self._plant: Any = MultibodyPlant(0.0)
        (model,) = Parser(self._plant).AddModelsFromString(reduced_urdf(robot), "urdf")
        base = self._plant.GetBodyByName(robot.base, model)
        self._plant.AddJoint(QuaternionFloatingJoint("base_of_tsid", self._plant.world_frame(), base.body_frame()))
        add_rotors(self._plant, robot, file_rotors(robot) if rotor_inertia is None else rotor_inertia)
        self._frames = add_frames(self._plant, model, self.contacts, frames)
        self._plant.Finalize()
        self._world = self._plant.world_frame()
        self._set_order()
        gravity = self._plant.gravity_field().gravity_vector()
        self._gravity: FloatArray = np.concatenate([np.zeros(3), gravity])
        self._check_mass()

    def _set_order(self) -> None:
        """Where the public q and v stand in the plant's."""
        plant, robot = self._plant, self.robot
        public: Any = make_plant(robot, 0.0)
        self.nq, self.nv, self.n = public.num_positions(), public.num_velocities(), len(robot.joints)
        fixed = 0 if robot.fixed_base else 6
        if self.nv != self.n + fixed or plant.num_velocities() != self.n + 6:
            raise ParamsError(
                f"robot {robot.name!r}: expected {self.n} movable joints, those listed, got {self.nv - fixed}"
            )
        self.start: FloatArray = public.GetPositions(public.CreateDefaultContext())
        self.start.setflags(write=False)
        theirs = [public.GetJointByName(name) for name in robot.joints]
        self.actuated: IntArray = np.array([joint.velocity_start() for joint in theirs], dtype=np.int64)
        self.positions: IntArray = np.array([joint.position_start() for joint in theirs], dtype=np.int64)
        base = plant.GetJointByName("base_of_tsid")
        ours = [plant.GetJointByName(name) for name in robot.joints]
        q_index, v_index = np.empty(self.nq, dtype=np.int64), np.empty(self.nv, dtype=np.int64)
        q_index[self.positions] = [joint.position_start() for joint in ours]
        v_index[self.actuated] = [joint.velocity_start() for joint in ours]
        state = np.zeros(plant.num_positions() + plant.num_velocities())
        pose = robot.base_pose.transform
        q_base = base.position_start()
        state[q_base : q_base + 4] = pose.rotation().ToQuaternion().wxyz()
        state[q_base + 4 : q_base + 7] = pose.translation()
        self._base = slice(base.velocity_start(), base.velocity_start() + 6)
        if not robot.fixed_base:
            body = public.GetBodyByName(robot.base)
            q_first, v_first = body.floating_positions_start(), body.floating_velocities_start_in_v()
            q_index[q_first : q_first + 7] = np.arange(q_base, q_base + 7)
            v_index[v_first : v_first + 6] = np.arange(self._base.start, self._base.stop)
        self._template = state
        self._state_index = as_slice(np.concatenate([q_index, plant.num_positions() + v_index]))
        self._columns: Any = as_slice(v_index)
        self._quaternion = slice(q_base, q_base + 4)
        self._base_position = slice(q_base + 4, q_base + 7)

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

    def create_scratch(self) -> "Scratch":
        """Scratch memory for `terms`."""
        return Scratch(self._plant, self.contacts)

    def frame_names(self) -> tuple[str, ...]:
        """What `Terms.frame` knows."""
        return tuple(self._frames)

    def terms(self, scratch: "Scratch", q: FloatArray, v: FloatArray, active: tuple[bool, ...] | None = None) -> Terms:
        """The terms at a state; all NaN where the state is not finite or the base's quaternion is zero.

        Args:
            scratch: From `create_scratch`; keeps the state for `Terms.frame` and `Terms.pose`.
            q: (nq,).
            v: (nv,).
            active: Which contacts carry; None for all.

        Raises:
            ParamsError: a mask of another length than the contacts.
        """
        contacts = scratch.select(active)
        plant, context, columns, base = self._plant, scratch.context, self._columns, self._base
        state = self._template.copy()
        state[self._state_index] = np.concatenate((q, v))
        turn = state[self._quaternion]
        if not (turn.dot(turn) > _SHORTEST and state.dot(state) < np.inf):
            return self._lost(q, v, contacts)
        plant.SetPositionsAndVelocities(context, state)
        mass_matrix, coriolis = plant.CalcMassMatrix(context), plant.CalcBiasTerm(context)
        rows = mass_matrix[base]
        mass, offset, to_com = _about_com(rows[:, base])
        momentum = to_com.dot(rows[:, columns])
        bias = coriolis - mass_matrix[:, base].dot(self._gravity)
        jacobian, contact_bias = self._contact_rows(context, contacts)
        in_order = isinstance(columns, slice)
        return Terms(
            q=q,
            v=v,
            mass_matrix=mass_matrix[columns, columns] if in_order else mass_matrix[np.ix_(columns, columns)],
            bias=bias[columns],
            actuated=self.actuated,
            joint_position=q[self.positions],
            contact_jacobian=jacobian,
            contact_bias=contact_bias,
            contact_velocity=jacobian.dot(v),
            mass=mass,
            com=state[self._base_position] + offset,
            com_velocity=momentum[3:].dot(v) / mass,
            momentum_matrix=momentum,
            momentum_bias=to_com.dot(coriolis[base]),
            frame=_Frames(self, context),
            pose=lambda name: self.pose(context, name),
            contacts=contacts,
        )

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

    def _contact_rows(self, context: Any, contacts: ActiveContacts) -> tuple[FloatArray, FloatArray]:
        """J (k, nv) and Jdot v (k,), in each contact's `axes`."""
        plant, columns = self._plant, self._columns
        jacobian, bias = np.empty((contacts.size, self.nv)), np.empty(contacts.size)
        for contact, rows in zip(contacts.contacts, contacts.rows, strict=True):
            frame, force = self._frames[contact.name], slice(rows.start, rows.start + 3)
            axes = self._world if contact.upright else frame
            args = (context, JacobianWrtVariable.kV, frame, _ORIGIN, self._world, axes)
            twist = plant.CalcJacobianSpatialVelocity(*args)[:, columns]
            drift = plant.CalcBiasSpatialAcceleration(*args).get_coeffs()
            jacobian[force], bias[force] = twist[3:], drift[3:]
            if contact.size == 6:
                moment = slice(force.stop, rows.stop)
                jacobian[moment], bias[moment] = twist[:3], drift[:3]
        return jacobian, bias

    def pose(self, context: Any, name: str) -> Pose:
        """R_WF, p_WF of a frame where a scratch's context stands."""
        matrix = self._frames[name].CalcPoseInWorld(context).GetAsMatrix34()
        return matrix[:, :3], matrix[:, 3]

    def frame(self, context: Any, name: str) -> FrameTerms:
        """All of a frame where a scratch's context stands."""
        plant, frame = self._plant, self._frames[name]
        args = (context, JacobianWrtVariable.kV, frame, _ORIGIN, self._world, self._world)
        rotation, position = self.pose(context, name)
        return FrameTerms(
            rotation=rotation,
            position=position,
            velocity=frame.CalcSpatialVelocityInWorld(context).get_coeffs(),
            jacobian=plant.CalcJacobianSpatialVelocity(*args)[:, self._columns],
            bias=plant.CalcBiasSpatialAcceleration(*args).get_coeffs(),
        )


class _Frames:
    """`Terms.frame`: each frame once."""

    def __init__(self, model: TsidModel, context: Any) -> None:
        self._model, self._context = model, context
        self._known: dict[str, FrameTerms] = {}

    def __call__(self, name: str) -> FrameTerms:
        known = self._known.get(name)
        if known is None:
            known = self._known[name] = self._model.frame(self._context, name)
        return known


class Scratch:
    """Where a TsidModel stands; a copy is a new one, for another Context."""

    def __init__(self, plant: Any, contacts: tuple[Contact, ...]) -> None:
        self._plant, self._contacts = plant, contacts
        self.context = plant.CreateDefaultContext()
        self._selections: dict[tuple[bool, ...] | None, ActiveContacts] = {}

    def __deepcopy__(self, memo: object) -> "Scratch":
        return Scratch(self._plant, self._contacts)

    def select(self, active: tuple[bool, ...] | None) -> ActiveContacts:
        """The active contacts, each mask laid out once."""
        known = self._selections.get(active)
        if known is None:
            known = self._selections[active] = select(self._contacts, active)
        return known


def _about_com(block: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """m, c = p_BoG and X (6, 6) from the base's own block (6, 6) of M: [I_Bo, m S(c); -m S(c), m 1]."""
    mass = block.item(5, 5)
    x, y, z = block.item(2, 4) / mass, block.item(0, 5) / mass, block.item(1, 3) / mass
    to_com = _SAME.copy()
    to_com[0, 4], to_com[0, 5], to_com[1, 5] = z, -y, x
    to_com[1, 3], to_com[2, 3], to_com[2, 4] = -z, y, -x
    return mass, np.array([x, y, z]), to_com
