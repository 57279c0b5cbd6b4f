"""A frame of the robot follows a pose."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from drake_tc.control.cartesian import Turning, relative_turn
from drake_tc.control.rotation import cross, quaternion_of, rotation_matrix, rotation_vector
from drake_tc.errors import ParamsError
from drake_tc.tsid.model import TsidModel
from drake_tc.tsid.rows import Parts, TaskRows
from drake_tc.tsid.tasks.base import Gains, axes, check_frame, gains
from drake_tc.tsid.terms import FrameTerms, Terms
from drake_tc.types import FloatArray

Axes = Literal["world", "frame", "reference"]


class FrameTask:
    """J vdot + Jdot v = A_d + kp e + kd (V_d - V) of a frame F, e = [log(R_d R^T); p_d - p]; the masked axes of it.

    Rows, gains, weights and mask go by [angular; linear], in the axes of the world or of F itself. With "reference" the
    linear ones stand in the world's axes and the angular ones in the reference's, by the law of `control.cartesian`:
    omega_d x (omega - omega_d) is added to alpha_d, and the error follows its gains however the reference turns.
    Reference (19,): [quaternion wxyz, p_d; omega_d, v_d; alpha_d, a_d] in the world [m, rad/s, m/s, rad/s^2, m/s^2].
    """

    reference_size = 19

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
            kp: Of each of the six rows, or one for all [1/s^2].
            kd: The same [1/s].
            weight: Of each row, or one for all.
            mask: Which of the six rows are wanted; None for all.
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
        self._frame, self._turned = check_frame(where, model, frame), axes_of == "frame"
        self._seen_from_reference = axes_of == "reference"
        self._kp, self._kd = gains(f"{where}: kp", kp, 6), gains(f"{where}: kd", kd, 6)
        self._axes = axes(f"{where}: mask", mask, 6)
        self._turns_only = self._axes is not None and int(self._axes[-1]) < 3
        weights = gains(f"{where}: weight", weight, 6)
        self.weight = weights if self._axes is None else weights[self._axes]

    def rest(self, terms: Terms) -> FloatArray:
        """The reference that asks for nothing at this state."""
        rotation, position = terms.pose(self._frame)
        return np.concatenate((quaternion_of(rotation), position, np.zeros(12)))

    def rows(self, terms: Terms, reference: FloatArray) -> TaskRows:
        """The rows at this state."""
        frame = terms.frame(self._frame)
        if self._seen_from_reference:
            return self._rows_in_reference(frame, reference)
        turned = rotation_vector(rotation_matrix(reference[:4]).dot(frame.rotation.T))
        error = np.concatenate((turned, reference[4:7] - frame.position))
        lag, wanted, matrix = reference[7:13] - frame.velocity, reference[13:] - frame.bias, frame.jacobian
        if self._turned:
            into = frame.rotation.T
            error, lag, wanted = (into.dot(x.reshape(2, 3).T).T.ravel() for x in (error, lag, wanted))
            matrix = np.concatenate((into.dot(matrix[:3]), into.dot(matrix[3:])))
        return self._chosen(matrix, wanted + self._kp * error + self._kd * lag)

    def _rows_in_reference(self, frame: FrameTerms, reference: FloatArray) -> TaskRows:
        """Angular rows in the reference's axes, linear rows in the world's."""
        wanted = Turning(rotation_matrix(reference[:4]), reference[7:10], reference[13:16])
        back, turn = wanted.rotation.T, relative_turn(wanted, frame.rotation, frame.velocity[:3])
        carried = wanted.acceleration + cross(wanted.velocity, frame.velocity[:3]) - frame.bias[:3]
        if self._turns_only:
            target = back.dot(carried) - self._kp[:3] * turn.angles - self._kd[:3] * turn.velocity
            return self._chosen(back.dot(frame.jacobian[:3]), target)
        error = np.concatenate((-turn.angles, reference[4:7] - frame.position))
        lag = np.concatenate((-turn.velocity, reference[10:13] - frame.velocity[3:]))
        free = np.concatenate((back.dot(carried), reference[16:] - frame.bias[3:]))
        matrix = np.concatenate((back.dot(frame.jacobian[:3]), frame.jacobian[3:]))
        return self._chosen(matrix, free + self._kp * error + self._kd * lag)

    def _chosen(self, matrix: FloatArray, target: FloatArray) -> TaskRows:
        """The rows that are wanted."""
        if self._axes is not None and self._axes.size < target.size:
            matrix, target = matrix[self._axes], target[self._axes]
        return TaskRows(self.name, Parts(vdot=matrix), target, self.weight)
