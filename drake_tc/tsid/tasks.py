"""What the robot should do: each task is named rows of a least-squares cost at one state, following a reference.

Tasks of motion (centre of mass, angular momentum, pose or orientation of a frame), of joints (posture, torques) and of
contacts (forces, centre of pressure).
"""

from collections.abc import Sequence
from typing import ClassVar, Literal, get_args

import numpy as np

from drake_tc.control.rotation import quaternion_of
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.fused import Entry
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows, Terms, identity, selection
from drake_tc.types import FloatArray, IntArray

Gains = float | Sequence[float] | FloatArray


def gains(where: str, value: Gains, size: int) -> FloatArray:
    """(size,) from one number for all or a vector.

    Raises:
        ParamsError: another size, a number that is not finite, or a negative one.
    """
    try:
        given = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ParamsError(f"{where}: expected a number or {size} of them, got {value!r}") from None
    if given.ndim > 1 or (given.ndim == 1 and given.size != size):
        raise ParamsError(f"{where}: expected a number or {size} of them, got shape {given.shape}")
    if not (np.isfinite(given).all() and (given >= 0.0).all()):
        raise ParamsError(f"{where}: expected finite numbers >= 0, got {given.tolist()}")
    full = np.full(size, given) if given.ndim == 0 else given.copy()
    full.setflags(write=False)
    return full


def axes(where: str, mask: Sequence[bool] | None, size: int) -> IntArray:
    """Indices of the chosen axes; a mask of None is for all of them.

    Raises:
        ParamsError: another size, or no axis at all.
    """
    if mask is None:
        return np.arange(size)
    if len(mask) != size or not all(isinstance(value, (bool, np.bool_)) for value in mask):
        raise ParamsError(f"{where}: expected {size} of true or false, got {list(mask)!r}")
    if not any(mask):
        raise ParamsError(f"{where}: expected at least one axis, got none")
    return np.flatnonzero(mask)


def check_frame(where: str, model: TsidModel, frame: str) -> str:
    """A frame of the model.

    Raises:
        ParamsError: it is not there.
    """
    names = model.frame_names()
    if frame not in names:
        raise ParamsError(f"{where}: no frame {frame!r}; frames: {', '.join(names)}")
    return frame


_COM_ROWS = Kernel("tsid.rows", "com")


class ComTask:
    """J_com vdot + Jdot_com v = xdd_d + kp (x_d - x) + kd (xd_d - xd), in world axes; the masked axes of them.

    Reference (9,): [x_d; xd_d; xdd_d] [m, m/s, m/s^2].
    """

    reference_size = 9

    def __init__(
        self, kp: Gains, kd: Gains, *, weight: Gains = 1.0, mask: Sequence[bool] | None = None, name: str = "com"
    ) -> None:
        """Keep the gains.

        Args:
            kp: Of each axis, or one for all [1/s^2].
            kd: The same [1/s].
            weight: Of each axis, or one for all.
            mask: Which of x, y, z take part; None for all.
            name: Of the task.

        Raises:
            ParamsError: gains or weights that are negative, not finite or of another size; a mask without an axis.
        """
        self.name = name
        self._kp, self._kd = gains(f"task {name!r}: kp", kp, 3), gains(f"task {name!r}: kd", kd, 3)
        self._axes = axes(f"task {name!r}: mask", mask, 3)
        weights = gains(f"task {name!r}: weight", weight, 3)
        self.weight = weights[self._axes]

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.concatenate((terms.com, np.zeros(6)))

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("com", self._axes.size, (self._axes,), (self._kp, self._kd, self.weight))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        state = terms.momentum_matrix, terms.momentum_bias, terms.mass, terms.com, terms.com_velocity
        matrix, target = _COM_ROWS(state, (self._kp, self._kd), reference, self._axes)
        return TaskRows(self.name, Parts(vdot=matrix), target, self.weight)


_MOMENTUM_ROWS = Kernel("tsid.rows", "momentum")


class AngularMomentumTask:
    """A_G vdot + Adot_G v = Ldot_d + kp (L_d - L), the angular rows, in world axes; the masked axes of them.

    Reference (6,): [L_d; Ldot_d] [N m s, N m].
    """

    reference_size = 6

    def __init__(
        self,
        kp: Gains,
        *,
        weight: Gains = 1.0,
        mask: Sequence[bool] | None = None,
        name: str = "angular momentum",
    ) -> None:
        """Keep the gains.

        Args:
            kp: Of each axis, or one for all [1/s].
            weight: Of each axis, or one for all.
            mask: Which of x, y, z take part; None for all.
            name: Of the task.

        Raises:
            ParamsError: gains or weights that are negative, not finite or of another size; a mask without an axis.
        """
        self.name = name
        self._kp = gains(f"task {name!r}: kp", kp, 3)
        self._axes = axes(f"task {name!r}: mask", mask, 3)
        weights = gains(f"task {name!r}: weight", weight, 3)
        self.weight = weights[self._axes]

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("momentum", self._axes.size, (self._axes,), (self._kp, self.weight))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        state = terms.momentum_matrix, terms.momentum_bias, terms.v
        matrix, target = _MOMENTUM_ROWS(state, self._kp, reference, self._axes)
        return TaskRows(self.name, Parts(vdot=matrix), target, self.weight)


Axes = Literal["world", "frame", "reference"]
_FRAME_ROWS = Kernel("tsid.rows", "frame")


class FrameTask:
    """J vdot + Jdot v = A_d + kp e + kd (V_d - V) of a frame F, e = [log(R_d R^T); p_d - p]; the masked axes of it.

    Rows, gains, weights and mask go by [angular; linear], in the axes of the world or of F itself. With "reference" the
    linear ones stand in the world's axes and the angular ones in the reference's:

        theta = log(R_d^T R),   w = R_d^T (omega - omega_d),   wdot = -kp theta - kd w,
        alpha = alpha_d + omega_d x (R_d w) + R_d wdot,

    so that the error follows its gains however the reference turns, up to terms of second order in it. The paper writes
    S(omega_d + 2 w) w for S(omega_d) w, in the reference's axes; both are equal because S(w) w = 0.
    Reference (19,): [quaternion wxyz, p_d; omega_d, v_d; alpha_d, a_d] in the world [m, rad/s, m/s, rad/s^2, m/s^2].

    Source: Faraji et al., 2015, eq. 14 to 16.
    """

    reference_size = 19
    _size: ClassVar[int] = 6

    def __init__(
        self,
        model: TsidModel,
        frame: str,
        kp: Gains,
        kd: Gains,
        *,
        weight: Gains = 1.0,
        mask: Sequence[bool] | None = None,
        axes_of: Axes = "world",
        name: str | None = None,
    ) -> None:
        """Keep the gains.

        Args:
            model: Of the robot.
            frame: A link, a contact or a frame that the model was given.
            kp: Of each row, or one for all [1/s^2].
            kd: The same [1/s].
            weight: Of each row, or one for all.
            mask: Which of the rows take part; None for all.
            axes_of: In whose axes the rows stand; see the class.
            name: Of the task; None for the frame's.

        Raises:
            ParamsError: a frame that is not there; gains or weights that are negative, not finite or of another size;
                a mask without an axis; unknown axes.
        """
        self.name = frame if name is None else name
        where = f"task {self.name!r}"
        if axes_of not in get_args(Axes):
            raise ParamsError(f"{where}: axes_of: expected one of {', '.join(get_args(Axes))}, got {axes_of!r}")
        self._frame, self._axes_of = check_frame(where, model, frame), get_args(Axes).index(axes_of)
        self._index = model.frame_names().index(frame)
        size = self._size
        self._kp, self._kd = (
            np.pad(gains(f"{where}: {key}", value, size), (0, 6 - size)) for key, value in (("kp", kp), ("kd", kd))
        )
        self._axes = axes(f"{where}: mask", mask, size)
        self.weight: FloatArray = gains(f"{where}: weight", weight, size)[self._axes]

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        rotation, position = terms.pose(self._frame)
        return np.concatenate((quaternion_of(rotation), position, np.zeros(12)))

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        integers = self._index, self._axes_of, self._axes
        return Entry("frame", self._axes.size, integers, (self._kp, self._kd, self.weight))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        frame = terms.frame(self._frame)
        pose = frame.rotation, frame.position, frame.velocity, frame.jacobian, frame.bias
        matrix, target = _FRAME_ROWS(pose, (self._kp, self._kd), reference, self._axes, self._axes_of)
        return TaskRows(self.name, Parts(vdot=matrix), target, self.weight)


_PLACES = np.array([0, 1, 2, 3, 7, 8, 9, 13, 14, 15])


class OrientationTask(FrameTask):
    """The angular rows of a `FrameTask`: alpha = alpha_d + kp log(R_d R^T) + kd (omega_d - omega), or as it says.

    Gains, weights and mask have three rows.
    Reference (10,): [quaternion wxyz; omega_d; alpha_d] in the world [rad/s, rad/s^2].
    """

    reference_size = 10
    _size = 3

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.asarray(super().rest(terms)[_PLACES])

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return super().compiled_entry(contacts)._replace(kind="orientation")

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        full = np.zeros(FrameTask.reference_size)
        full[_PLACES] = reference
        return super().rows(terms, full)


_TARGET = Kernel("tsid.rows", "posture")


class PostureTask:
    """qdd_j = qdd_d + kp (q_d - q_j) + kd (qd_d - qd_j) of each chosen joint j.

    Reference (3n,): [q_d; qd_d; qdd_d] of all joints in the robot's order [rad, rad/s, rad/s^2].
    """

    def __init__(
        self,
        model: TsidModel,
        kp: Gains,
        kd: Gains,
        *,
        weight: Gains = 1.0,
        joints: Sequence[str] | None = None,
        name: str = "posture",
    ) -> None:
        """Keep the gains.

        Args:
            model: Of the robot.
            kp: Of each chosen joint, or one for all [1/s^2].
            kd: The same [1/s].
            weight: Of each chosen joint, or one for all.
            joints: Which take part; None for all, in the robot's order.
            name: Of the task.

        Raises:
            ParamsError: a joint that is not there or is named twice; gains or weights that are negative, not finite
                or of another size.
        """
        names = model.robot.joints
        selected = names if joints is None else tuple(joints)
        for i, joint in enumerate(selected):
            if joint not in names:
                raise ParamsError(f"task {name!r}: no joint {joint!r}; joints: {', '.join(names)}")
            if joint in selected[:i]:
                raise ParamsError(f"task {name!r}: joint {joint!r} is named twice")
        if not selected:
            raise ParamsError(f"task {name!r}: expected at least one joint, got none")
        self.name, self.reference_size = name, 3 * model.n
        self.weight = gains(f"task {name!r}: weight", weight, len(selected))
        self._kp = gains(f"task {name!r}: kp", kp, len(selected))
        self._kd = gains(f"task {name!r}: kd", kd, len(selected))
        self._joints = chosen = np.array([names.index(joint) for joint in selected], dtype=np.int64)
        self._velocity, self._position = model.actuated[chosen], model.positions[chosen]
        self._parts = selection(model.actuated[chosen], model.nv)

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.concatenate((terms.joint_position, np.zeros(2 * terms.joint_position.size)))

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        places = self._joints, self._position, self._velocity
        return Entry("posture", self._joints.size, places, (self._kp, self._kd, self.weight))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        places = self._joints, self._position, self._velocity
        target = _TARGET(terms.q, terms.v, places, (self._kp, self._kd), reference)
        return TaskRows(self.name, self._parts, target, self.weight)


class TorqueTask:
    """tau = tau_d, each joint with its weight; with tau_d = 0 the cost of torques of Faraji et al. (2015), Q_tau =
    weight^2.

    Reference (n,): tau_d in the robot's order [N m].
    """

    def __init__(self, model: TsidModel, *, weight: Gains = 1.0, name: str = "torque") -> None:
        """Keep the weights.

        Args:
            model: Of the robot.
            weight: Of each joint, or one for all.
            name: Of the task.

        Raises:
            ParamsError: weights that are negative, not finite or of another size.
        """
        self.name, self.reference_size = name, model.n
        self.weight = gains(f"task {name!r}: weight", weight, model.n)
        self._parts = Parts(torque=identity(model.n))

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        return Entry("torque", self.weight.size, (), (self.weight,))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        return TaskRows(self.name, self._parts, reference, self.weight)


class ForceTask:
    """f = f_d of the contacts that are active, each component with its weight.

    Reference (K,): f_d of all contacts of the model, active or not, in their axes [N, N m].

    With f_d = 0 and more weight on tangential forces and moments it is the paper's force regularisation.
    """

    def __init__(
        self, model: TsidModel, *, weight: float = 1.0, components: Sequence[float] | None = None, name: str = "force"
    ) -> None:
        """Keep the weights.

        Args:
            model: Of the robot, with contacts.
            weight: Of the task (the paper's w_f).
            components: (6,) weights of [fx fy fz tx ty tz] in every contact (a point takes the first three), or (K,)
                of all contacts, which is what six are of two points; None for ones. They multiply `weight`.
            name: Of the task.

        Raises:
            ParamsError: a model without contacts; weights that are negative, not finite or of another size.
        """
        if not model.contacts:
            raise ParamsError(
                f"task {name!r}: expected a model with contacts; robot {model.robot.name!r} has none here"
            )
        whole: Gains = 1.0 if components is None else np.asarray(components, dtype=float)
        if components is not None and len(components) == 6 != model.force_size:
            whole = np.concatenate([np.asarray(components, dtype=float)[: contact.size] for contact in model.contacts])
        scale = gains(f"task {name!r}: weight", weight, 1)
        self.name, self.reference_size = name, model.force_size
        self.weight = gains(f"task {name!r}: components", whole, model.force_size) * scale

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        entries = contacts.entries
        return Entry("force", entries.size, (entries,), (self.weight[entries],))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        entries = terms.contacts.entries
        return TaskRows(self.name, Parts(force=identity(entries.size)), reference[entries], self.weight[entries])


_ROWS = Kernel("tsid.rows", "pressure")


class CopTask:
    """x_d fz + ty = 0 and y_d fz - tx = 0 of one surface contact: its centre of pressure (-ty, tx) / fz is (x_d, y_d).

    Linear in f: the rows are the distance to the reference point times fz [N m]. Without rows while the contact is off.
    Reference (2,): [x_d; y_d] in the contact's frame [m].
    """

    reference_size = 2

    def __init__(self, model: TsidModel, contact: str, *, weight: Gains = 1.0, name: str | None = None) -> None:
        """Keep the weights.

        Args:
            model: Of the robot.
            contact: A surface contact of the model.
            weight: Of x and y, or one for both.
            name: Of the task; None for "<contact> pressure".

        Raises:
            ParamsError: a contact that is not there or is a point; weights that are negative, not finite or of
                another size.
        """
        self.name = f"{contact} pressure" if name is None else name
        surfaces = {item.name: i for i, item in enumerate(model.contacts) if item.kind == "surface"}
        if contact not in surfaces:
            raise ParamsError(
                f"task {self.name!r}: no surface contact {contact!r}; possible: {', '.join(surfaces) or 'none'}"
            )
        self._index = surfaces[contact]
        self.weight = gains(f"task {self.name!r}: weight", weight, 2)
        self._none = np.zeros(0)

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        return np.zeros(self.reference_size)

    def compiled_entry(self, contacts: ActiveContacts) -> Entry:
        """Its numbers for the compiled tick."""
        if self._index not in contacts.index:
            return Entry("pressure", 0, (0,), ())
        start = contacts.rows[contacts.index.index(self._index)].start
        return Entry("pressure", 2, (start,), (self.weight,))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        active = terms.contacts
        if self._index not in active.index:
            return TaskRows(self.name, Parts(force=np.zeros((0, active.size))), self._none, self._none)
        start = active.rows[active.index.index(self._index)].start
        matrix = _ROWS(reference, start, active.size)
        return TaskRows(self.name, Parts(force=matrix), np.zeros(2), self.weight)
