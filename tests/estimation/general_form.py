"""The general form: unknown wrenches on any links, solved together with the torques.

Source: Del Prete et al., 2016, eq. 1 and 2.

    M vdot + h - J_m^T f_m - S_k^T tau_k = [J_u^T  S_u^T] [f_u; tau_u]                                (general)

f_m are wrenches that are measured, f_u those that are not, tau_k torques that are known (an actuator model's, or 0 of
a joint that is free), tau_u the others. It is solvable when the matrix on the right has full column rank: with all
torques unknown that is one unknown wrench, or as many components of several as one wrench has.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable

from drake_tc.errors import ParamsError
from drake_tc.estimation.torque_model import AngularAcceleration, BaseSource, TorqueModel
from drake_tc.robot.robot import Mount, Robot
from drake_tc.types import FloatArray

COMPONENTS = ("fx", "fy", "fz", "tx", "ty", "tz")
Component = Literal["fx", "fy", "fz", "tx", "ty", "tz"]
RANK_TOLERANCE = 1e-9
"""Singular values below this fraction of the largest count as zero."""


@dataclass(frozen=True)
class Columns:
    """A group of unknowns and its columns in (general).

    Attributes:
        name: For messages: "wrench on NAME" or "torque of JOINT".
        matrix: (nv, m), J_u^T or S^T.
    """

    name: str
    matrix: FloatArray = field(repr=False)


def general_wrench_estimate(rest: FloatArray, unknowns: Sequence[Columns]) -> tuple[FloatArray, ...]:
    """Solve (general).

    Args:
        rest: (nv,) its left side.
        unknowns: Groups of columns; together (nv, m).

    Returns:
        One (m_i,) a group; the least-squares solution where there are more equations than unknowns.

    Raises:
        ParamsError: The columns are not independent; the message names the groups that cannot be told apart.
    """
    matrix = np.hstack([group.matrix for group in unknowns])
    left, values, right = np.linalg.svd(matrix, full_matrices=True)
    rank = int(np.sum(values > RANK_TOLERANCE * values.max(initial=1e-300)))
    ends = np.cumsum([group.matrix.shape[1] for group in unknowns])[:-1]
    if rank < matrix.shape[1]:
        parts = np.split(np.abs(right[rank:]).max(axis=0), ends)
        names = [group.name for group, part in zip(unknowns, parts, strict=True) if part.max(initial=0.0) > 1e-6]
        raise ParamsError(
            f"general form: {matrix.shape[1]} unknowns, but only {rank} independent columns; cannot tell apart: "
            f"{', '.join(names)}; measure one of these wrenches, give fewer components, or give a torque as known"
        )
    solution = right[:rank].T @ ((left[:, :rank].T @ rest) / values[:rank])
    return tuple(np.split(solution, ends))


@dataclass(frozen=True)
class UnknownWrench:
    """Components of a wrench that are not measured.

    Attributes:
        mount: Its name, link and frame (a wrench acts at the frame's origin, in the axes of the base).
        components: Those that may act; a point contact without friction torque has fx, fy, fz.
    """

    mount: Mount
    components: tuple[Component, ...] = COMPONENTS  # type: ignore[assignment]


@dataclass(frozen=True, eq=False)
class GeneralEstimate:
    """What the general form gives at one instant.

    Attributes:
        torque: (n,) of every joint, known ones included [N m].
        wrenches: (u, 6) = [f; t] of the unknown wrenches, base axes, 0 in components that do not act [N, N m].
    """

    torque: FloatArray
    wrenches: FloatArray


class GeneralModel:
    """(general) for one robot; the F/T sensors of the robot file play no part, wrenches are given at frames.

    It holds constants only; the plant's Context of `create_context` is scratch memory.
    """

    def __init__(
        self,
        robot: Robot,
        unknown: Sequence[UnknownWrench],
        measured: Sequence[Mount] = (),
        known_torque: Sequence[str] = (),
        *,
        base: BaseSource = "imu",
        angular_acceleration: AngularAcceleration = "gyro",
    ) -> None:
        """Build the plant.

        Args:
            robot: The robot.
            unknown: Wrenches that are not measured.
            measured: Frames at which wrenches are measured.
            known_torque: Joints whose torque is given to `estimate`.
            base: As of `TorqueModel`.
            angular_acceleration: As of `TorqueModel`.

        Raises:
            ParamsError: A link, joint or component that does not exist; more unknowns than equations.
        """
        whole = replace(robot, force_torque=())
        self._model = TorqueModel(whole, base=base, angular_acceleration=angular_acceleration)
        self._unknown, self._joints = tuple(unknown), robot.joints
        self._known = tuple(_index(robot, name) for name in known_torque)
        self._measured = tuple(measured)
        for wrench in unknown:
            odd = [name for name in wrench.components if name not in COMPONENTS]
            if odd or not wrench.components:
                raise ParamsError(
                    f"unknown wrench {wrench.mount.name}: expected some of {COMPONENTS}, got {wrench.components}"
                )
        for mount in (*self._measured, *(wrench.mount for wrench in unknown)):
            if not self._model.model.plant.HasBodyNamed(mount.link):
                raise ParamsError(f"{robot.name}: wrench {mount.name}: no link {mount.link!r} in the URDF")

    def create_context(self) -> Any:
        """Scratch memory of `estimate`."""
        return self._model.create_context()

    def estimate(
        self,
        context: Any,
        motion: Sequence[FloatArray],
        measured: FloatArray,
        known_torque: FloatArray | None = None,
    ) -> GeneralEstimate:
        """Torques and unknown wrenches at one instant.

        Args:
            context: From `create_context`.
            motion: (q, v, vdot, imu, gyro_dot), as of `TorqueModel.estimate`.
            measured: (6m,) = [f; t] at the measured frames, base axes [N, N m].
            known_torque: One value a joint of `known_torque` [N m]; None: zero.

        Raises:
            ParamsError: In this posture the unknowns cannot be told apart.
        """
        q, v, vdot, imu, gyro_dot = motion
        needed = self._model.motion_forces(context, q, v, vdot, imu, gyro_dot)
        torque = np.zeros(len(self._joints))
        if self._known and known_torque is not None:
            torque[list(self._known)] = known_torque
        rows = self._model.model.velocity_index
        needed[rows] -= torque
        for mount, wrench in zip(self._measured, np.reshape(measured, (-1, 6)), strict=True):
            needed -= self._jacobian(context, mount).T @ wrench
        columns = []
        for unknown in self._unknown:
            chosen = [COMPONENTS.index(name) for name in unknown.components]
            jacobian = self._jacobian(context, unknown.mount)[chosen]
            columns.append(Columns(f"wrench on {unknown.mount.name}", jacobian.T))
        solved = [i for i in range(len(self._joints)) if i not in self._known]
        for i in solved:
            column = np.zeros((needed.size, 1))
            column[rows[i]] = 1.0
            columns.append(Columns(f"torque of {self._joints[i]}", column))
        parts = general_wrench_estimate(needed, columns)
        wrenches = np.zeros((len(self._unknown), 6))
        for i, unknown in enumerate(self._unknown):
            wrenches[i, [COMPONENTS.index(name) for name in unknown.components]] = parts[i]
        torque[solved] = np.concatenate([np.zeros(0), *parts[len(self._unknown) :]])
        return GeneralEstimate(torque, wrenches)

    def _jacobian(self, context: Any, mount: Mount) -> FloatArray:
        """(6, nv) rows [linear; angular] of the mount's frame, base axes."""
        plant = self._model.model.plant
        frame, world = plant.GetFrameByName(mount.link), plant.world_frame()
        at = mount.pose.transform.translation()
        jacobian = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kV, frame, at, world, world)
        return np.vstack([jacobian[3:], jacobian[:3]])


def _index(robot: Robot, name: str) -> int:
    if name not in robot.joints:
        raise ParamsError(f"{robot.name}: known torque: no joint {name!r}; joints: {', '.join(robot.joints)}")
    return robot.joints.index(name)
