"""Tasks of motion: the centre of mass, the angular momentum about it, and the pose or orientation of a frame."""

from collections.abc import Sequence
from typing import ClassVar, Literal, get_args

import numpy as np

from drake_tc.control.rotation import quaternion_of
from drake_tc.errors import ParamsError
from drake_tc.kernels.calls import Kernel
from drake_tc.tsid.contacts import ActiveContacts
from drake_tc.tsid.fused import Entry
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows, Terms
from drake_tc.tsid.tasks.base import Gains, axes, check_frame, gains
from drake_tc.types import FloatArray

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
