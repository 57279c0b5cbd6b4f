"""Joint torques without joint-torque sensors: Algorithm 1 of Del Prete et al. (2016), for fixed and floating bases.

With every sensor's joint free (see `drake_tc.estimation.plant`) and the base moving as its IMU says:

    g     = M vdot + h                       generalized forces that the motion needs, by one inverse dynamics
    for each sensor i, those farther out first:
        P_i   = g at the sensor's joint       the wrench that the part beyond needs
        E_i   = P_i + W_i                     of which what the sensor does not give comes from outside, at C_i
        g    <- g - J_Ci^T E_i
    f_u   = J_u,b^-T g_b                     what still moves the base: the unknown wrench, at link u
    tau   = g_j - J_u,j^T f_u                what is left at the joints

Source: Del Prete, Mansard, Ramos, Stasse, Nori, "Implementing Torque Control with High-Ratio Gear Boxes and Without
Joint-Torque Sensors", Algorithm 1. Ours computes by generalized forces what the paper passes from link to link;
the two are the same balance, and a sensor inside a limb needs no case of its own.

The robot as `drake_tc.kernels.joint_torque` takes it.
"""

from copy import copy
from dataclasses import replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

from drake_tc.errors import ParamsError
from drake_tc.estimation.plant import CUT_SUFFIX, IMU_SUFFIX, BaseMotion, build_plant
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.plant import in_order, tree_of
from drake_tc.robot.robot import Robot
from drake_tc.types import GRAVITY, FloatArray, IntArray

BaseSource = Literal["imu", "fixed"]
AngularAcceleration = Literal["gyro", "neglected", "zero"]
_ESTIMATE = Kernel("joint_torque", "estimate")


class Estimate(NamedTuple):
    """What the estimation gives at one instant.

    Attributes:
        torque: (n,) tau_hat on the link side [N m].
        unknown_wrench: (6,) f_u = [f; t] on the chosen link at its origin, base axes [N, N m].
        contact_wrench: (6k,) E = [f; t] on each contact body at its contact frame, base axes [N, N m].
    """

    torque: FloatArray
    unknown_wrench: FloatArray
    contact_wrench: FloatArray


class MeasuredMotion(NamedTuple):
    """How a robot moves at one instant, by its sensors.

    Attributes:
        q, v, vdot: (n,) of the joints [rad, rad/s, rad/s^2].
        imu: (6,) [gyro; accel] in the IMU's frame [rad/s, m/s^2].
        gyro_dot: (3,) derivative of the gyro [rad/s^2].
    """

    q: FloatArray
    v: FloatArray
    vdot: FloatArray
    imu: FloatArray
    gyro_dot: FloatArray


class TorqueModel:
    """The kernel: `estimate` maps what the sensors say at one instant to torques and wrenches.

    It holds constants only; positions and velocities live in the plant's Context that the caller passes.

    Example:
        >>> TorqueModel(load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")).size
        6
    """

    def __init__(
        self,
        robot: Robot,
        unknown: str | None = None,
        *,
        base: BaseSource = "imu",
        imu: str | None = None,
        angular_acceleration: AngularAcceleration = "gyro",
    ) -> None:
        """Build the estimation plant.

        Args:
            robot: The robot; its sensors and their frames.
            unknown: Link that takes the unknown wrench; None: the base.
            base: "imu": the base moves as the IMU says; "fixed": it is welded in the robot's `base_pose`, no IMU.
            imu: Name of the IMU; None: the robot's first.
            angular_acceleration: Of the IMU's link: "gyro": the gyro's derivative; "neglected": 0 (Del Prete et al.,
            2016's option);
                "zero": the base has none (welded), and the link's follows from the joints between them.

        Raises:
            ParamsError: A link that is not there or beyond a sensor, an unknown IMU, a robot without one, a
                "fixed" base of a robot that floats.
        """
        self.robot = robot
        self.model = build_plant(robot)
        self._plant: Any = self.model.plant
        self._forces = MultibodyForces(self._plant)
        self._world = self._plant.world_frame()
        self._origin: Any = np.zeros(3)
        self._differentiate = angular_acceleration
        self._motion = self._base_motion(base, imu)
        up = robot.base_pose.transform.rotation().matrix()[2]
        self._still = np.concatenate([np.zeros(3), GRAVITY * up])
        self._no_rate = np.zeros(3)
        self._imu = self._plant.GetFrameByName((imu or robot.imu[0].name) + IMU_SUFFIX) if self._motion else None
        self._unknown = self._unknown_frame(unknown)
        self.tables = self._tables_of(self.create_context())

    @property
    def size(self) -> int:
        """Actuated joints n."""
        return len(self.robot.joints)

    @property
    def num_sensors(self) -> int:
        """F/T sensors k."""
        return len(self.model.cuts)

    @property
    def uses_imu(self) -> bool:
        """Whether the base's motion comes from an IMU."""
        return self._motion is not None

    def create_context(self) -> Any:
        """A Context of the estimation plant: the scratch memory of `motion_forces` and others."""
        return self._plant.CreateDefaultContext()

    def with_inertias(self, context: Any) -> "TorqueModel":
        """A model that estimates with the links' inertias of a Context of `create_context`, at q = 0."""
        other = copy(self)
        other.tables = self._tables_of(context)
        return other

    def _tables_of(self, context: Any) -> tuple[Any, ...]:
        """The robot as `drake_tc.kernels.joint_torque.Robot` has it, with the links' inertias of a context."""
        cuts, order = self.model.cuts, self.model.inward
        frames = {"unknown": self._unknown} | ({} if self._imu is None else {"imu": self._imu})
        first = len(frames)
        for i in order:
            frames |= {f"{i} sensor": cuts[i].sensor, f"{i} contact": cuts[i].contact}
        held = tuple(mount.joint + CUT_SUFFIX for mount in self.robot.force_torque)
        joints = replace(in_order(self.robot), held=held)
        tree = tree_of(self.model.plant, self.model.base.body(), joints, frames, context)
        rows = dict(zip(frames, tree.frame_bodies.tolist(), strict=True))
        sensors = [(i, rows[f"{i} sensor"], rows[f"{i} contact"]) for i in order]
        imu = np.zeros(12) if self._imu is None else tree.frames[1]
        mode = get_args(AngularAcceleration).index(self._differentiate)
        return (
            tree.places,
            tree.constants,
            tree.trunk,
            np.concatenate([imu, self._still, tree.frames[0, 9:]]),
            np.array([rows.get("imu", -1), mode, rows["unknown"]]),
            np.array(sensors, dtype=np.int64).reshape(-1, 3),
            np.ascontiguousarray(tree.frames[first:]),
        )

    def estimate(self, motion: MeasuredMotion, wrenches: FloatArray) -> Estimate:
        """Torques and wrenches at one instant; NaN where an argument is not finite.

        Args:
            motion: Of the joints and the base. Its `imu` is not looked at with a "fixed" base, its `gyro_dot` with
                angular_acceleration "gyro" only.
            wrenches: (6k,) readings W = [f; t] of the F/T sensors, in their frames [N, N m].
        """
        out = self.estimate_log(*(np.asarray(each)[None] for each in (*motion, wrenches)))[0]
        return Estimate(*np.split(out, [self.size, self.size + 6]))

    def estimate_log(self, *arguments: FloatArray) -> FloatArray:
        """(T, n + 6 + 6k) [tau_hat, f_u, E] of T instants: a MeasuredMotion and wrenches, of first axis T."""
        *motion, imu, gyro_dot, wrenches = arguments
        joint = np.concatenate(motion, axis=1)
        inertial = np.zeros((joint.shape[0], 9))
        if self.uses_imu:
            inertial[:, :6], inertial[:, 6:] = imu, gyro_dot if self._differentiate == "gyro" else 0.0
        readings, out = np.ascontiguousarray(wrenches, dtype=np.float64), np.empty((joint.shape[0], self.width))
        for row in zip(out, joint, inertial, readings, strict=True):
            self.estimate_into(*row, np.inf)
        out[out[:, -1] != 0.0] = np.nan
        return out[:, :-1]

    @property
    def width(self) -> int:
        """Numbers of one estimate: n + 6 + 6k, and 1."""
        return self.size + 7 + 6 * self.num_sensors

    def estimate_into(
        self, out: FloatArray, joint: FloatArray, imu: FloatArray, wrenches: FloatArray, largest: float
    ) -> None:
        """`estimate` for a control loop, of contiguous arrays.

        Args:
            out: (width,) [tau_hat; f_u; E; fault], written; fault is 1, and all else 0, where an input is missing.
            joint: (3n,) [q; qdot; qddot].
            imu: (9,) or more, [gyro; accel; d gyro/dt].
            wrenches: (6k,).
            largest: Inputs from this size on count as missing.
        """
        _ESTIMATE((joint, imu, wrenches), self.tables, largest, out)

    def motion_forces(self, context: Any, motion: MeasuredMotion) -> FloatArray:
        """M vdot + h over all velocities of the estimation plant (nv,)."""
        acceleration = self.acceleration(context, motion)
        return np.asarray(self._plant.CalcInverseDynamics(context, acceleration, self._forces))

    def joint_torques(self, forces: FloatArray) -> FloatArray:
        """(..., n) torques of the joints, which move those that follow them, from `motion_forces` (..., nv)."""
        return np.asarray(forces @ self.model.moves)

    def acceleration(self, context: Any, motion: MeasuredMotion) -> FloatArray:
        """(nv,) accelerations of the estimation plant, the base's against free fall.

        The context leaves with the positions and velocities that go with them.
        """
        q, v, vdot, imu, gyro_dot = motion
        state = self.model.state_of(q, v)
        acceleration = self.model.moves @ vdot
        if self._motion is None:
            self._plant.SetPositionsAndVelocities(context, state)
            acceleration[:6] = self._still
        else:
            rate = gyro_dot if self._differentiate == "gyro" else self._no_rate
            acceleration[:6] = self._motion.solve(
                context, state, vdot, imu, None if self._differentiate == "zero" else rate
            )
        return acceleration

    def reading_error(self, context: Any, motion: MeasuredMotion, wrenches: FloatArray) -> FloatArray:
        """(6k,) W less what the sensors of a robot that nothing touches would read, sensor frames [N, N m].

        Arguments as `estimate`. Of a sensor with another one beyond it, both count as expected from the motion.
        """
        needed = self.motion_forces(context, motion)
        error = np.empty(wrenches.size)
        for index, cut in enumerate(self.model.cuts):
            at = 6 * index
            expected = np.linalg.solve(cut.reading_to_contact, cut.shift @ needed[cut.rows])
            error[at : at + 6] = wrenches[at : at + 6] + expected
        return error

    def motion_inertia(self, context: Any) -> FloatArray:
        """d(M vdot + h)/d qddot (nv, n) for what the sensors see, at the last `motion_forces`.

        The joint columns of M, and those of the base's acceleration so far as the IMU's reading leaves it to qddot.
        """
        mass = self._plant.CalcMassMatrix(context)
        inertia = np.asarray(mass @ self.model.moves)
        if self._motion is not None:
            coupling = self._motion.coupling(context, rotates=self._differentiate != "zero")
            if coupling is not None:
                inertia += mass[:, :6] @ coupling
        return inertia

    def contact_forces(self, context: Any, contact_wrench: FloatArray) -> FloatArray:
        """J_C^T E (nv,) of external wrenches at the contact frames, base axes (6k,), at the last `motion_forces`."""
        forces = np.zeros(self._plant.num_velocities())
        for index, cut in enumerate(self.model.cuts):
            jacobian = self._plant.CalcJacobianSpatialVelocity(
                context, JacobianWrtVariable.kV, cut.contact, self._origin, self._world, self._world
            )
            force, moment = np.split(contact_wrench[6 * index : 6 * index + 6], 2)
            forces += np.concatenate((moment, force)) @ jacobian
        return forces

    def _base_motion(self, base: BaseSource, imu: str | None) -> BaseMotion | None:
        """The IMU's transform, or None for a welded base."""
        names = [mount.name for mount in self.robot.imu]
        if base == "fixed":
            if not self.robot.fixed_base:
                raise ParamsError(
                    f"{self.robot.name}: base 'fixed' requires a welded base; the base of this robot floats: use 'imu'"
                )
            return None
        if not names:
            raise ParamsError(f"{self.robot.name}: expected an IMU; the robot has none (base 'fixed' needs none)")
        name = names[0] if imu is None else imu
        if name not in names:
            raise ParamsError(f"{self.robot.name}: no IMU {name!r}; there are {names}")
        return BaseMotion(self.model, self._plant.GetFrameByName(name + IMU_SUFFIX))

    def _unknown_frame(self, unknown: str | None) -> Any:
        """That of the link that takes the unknown wrench."""
        name = self.robot.base if unknown is None else unknown
        if not self._plant.HasBodyNamed(name):
            raise ParamsError(f"{self.robot.name}: unknown wrench: no link {name!r} in the URDF")
        frame = self._plant.GetFrameByName(name)
        for mount, cut in zip(self.robot.force_torque, self.model.cuts, strict=True):
            joint = self._plant.GetJointByName(mount.joint + CUT_SUFFIX)
            if frame.body().index() in self._plant.GetBodiesKinematicallyAffectedBy([joint.index()]):
                raise ParamsError(
                    f"{self.robot.name}: unknown wrench: {name!r} is beyond the F/T sensor {cut.name!r}, where the"
                    " external wrench is the contact wrench; expected a link between the base and the sensors"
                )
        return frame


def as_slice(index: IntArray) -> Any:
    """The same places as a slice where they follow each other, which numpy reads and writes faster."""
    first = int(index[0]) if index.size else 0
    return slice(first, first + index.size) if np.array_equal(index, first + np.arange(index.size)) else index
