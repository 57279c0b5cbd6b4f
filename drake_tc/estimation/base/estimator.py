"""`CopEstimator`: one tick of the base estimator, a pure function of a state and a sample.

What all base estimators are built on: the tables of a robot and its contacts, and a state before the first tick.

The baselines: the chain from a foot whose centre is taken to stand still, without the IMU and with it.
"""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from drake_tc.estimation.base.kinematics import (
    BaseKinematics,
    BaseState,
    Readings,
    Sample,
    initial_state,
    packed,
    unpacked,
)
from drake_tc.estimation.base.rig import BaseEstimatorSpec
from drake_tc.estimation.base.velocity import rows_of, soft_sole, soles_of, solve_program
from drake_tc.kernels.calls import Kernel
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


class OnKinematics(ABC):
    """A base estimator without its recursion.

    Attributes:
        spec: Contacts and tuning.
        kinematics: Of the robot.
        num_joints, num_contacts: n, k.
        options: (27,) in the order of `drake_tc.kernels.base.sample.Options`.
        soles: (k, w) rows of the contacts, see `drake_tc.kernels.base.sample`.
        tables: (k, m m) shapes of soft soles, see `drake_tc.kernels.base.contacts.shape_of`; zero of rigid ones.
    """

    def __init__(self, robot: Robot, spec: BaseEstimatorSpec) -> None:
        """Build the tables.

        Args:
            robot: With a floating base and an IMU.
            spec: Contacts and tuning.

        Raises:
            ParamsError: what robot and contacts lack, or a sole that is not convex.
        """
        self.spec = spec
        self.kinematics = BaseKinematics(robot, spec.contacts)
        self.num_joints, self.num_contacts = len(robot.joints), len(spec.contacts)
        self._limits = soles_of(spec.contacts)
        soft = [soft_sole(contact) for contact in spec.contacts]
        self.options = _options(spec, self.kinematics.weight, any_soft=any(sole is not None for sole in soft))
        self.soles = rows_of(spec.contacts)
        tables = [np.zeros(4) if sole is None else sole.table.ravel() for sole in soft]
        self.tables = np.zeros((len(tables), max(table.size for table in tables)))
        for row, table in zip(self.tables, tables, strict=True):
            row[: table.size] = table
        known = self.kinematics.between, *self.kinematics.tree
        self._fixed = (self.options, self.soles, self.tables, *known)

    @abstractmethod
    def advance(self, state: FloatArray, sample: Sample, after: FloatArray) -> None:
        """Write the packed state after one sample into `after`; it never holds a NaN but an unknown ground.

        Args:
            state: (s,) packed, before it.
            sample: Of all sensors.
            after: (s,).
        """

    def step(self, state: BaseState, readings: Readings) -> BaseState:
        """The state after one sample; never raises.

        Args:
            state: Before it.
            readings: The sample.
        """
        before = packed(state)
        after = np.empty_like(before)
        self.advance(before, readings.sample(), after)
        return unpacked(after, self.num_joints, self.num_contacts)

    def initial_state(self, position: FloatArray, yaw: float) -> BaseState:
        """Before the first tick, with the base at `position` (3,) [m] and `yaw` [rad]."""
        return initial_state(self.kinematics.robot.posture, self.num_contacts, position, yaw)


def _options(spec: BaseEstimatorSpec, weight: float, *, any_soft: bool) -> FloatArray:
    """(27,) in the order of `drake_tc.kernels.base.sample.Options`."""
    level, touchdown = spec.ground == "level", spec.reference == "touchdown"
    row = (
        spec.period, spec.imu_age, level, touchdown, spec.velocity_time, spec.contact_velocity, spec.cop_moment,
        spec.position_time, spec.yaw_time, spec.yaw_bias_time, spec.bias_time, spec.tilt_time, spec.sole_time,
        spec.still_rate, spec.anchor_time, spec.slip_speed, spec.slip_distance, spec.slip_turn, spec.slip_time,
        spec.slip_hold, spec.tilted, spec.force_offset, spec.yaw_drift, spec.encoder_spike, spec.quick_start, any_soft,
        weight,
    )  # fmt: skip
    return np.array(row, dtype=float)


_TICK = Kernel("base.tick", "tick")


class CopEstimator(OnKinematics):
    """Base position, velocity and yaw from the point of each contact that stands still, the centre of pressure.

    Stage 1 (`drake_tc.kernels.base.velocity`), then stage 2 (`base_pose`), every tick; roll and pitch from the IMU, or
    from gyro and accelerometer (`base_imu`). A contact that carries load holds its centre of pressure where it was: a
    reference that follows the centre of pressure as it moves over the sole, and slowly adapts where contacts disagree.
    What cannot be believed, or gives no numbers, gives way to what the last tick knew, and raises a flag
    (`state.FLAGS`).
    """

    def __init__(self, robot: Robot, spec: BaseEstimatorSpec) -> None:
        """As `OnKinematics`."""
        super().__init__(robot, spec)
        k = self.num_contacts
        self._unsolved, self._program_size = np.zeros(4 + 3 * k), 5 + 13 * k

    def advance(self, state: FloatArray, sample: Sample, after: FloatArray) -> None:
        """As `OnKinematics.advance`; where a centre of pressure ends at its sole's edge, with a quadratic program."""
        program, given = np.empty(self._program_size), (state, tuple(sample), self._fixed)
        if not _TICK(*given, (self._unsolved, program), after):
            _TICK(*given, (solve_program(program, self._limits), program), after)


_CHAIN_TICK = Kernel("base.chain", "tick")


class FootCentreEstimator(OnKinematics):
    """Leg odometry: the most loaded contact is fixed in the world, position and orientation, until another takes over.

    With F the fixed contact:   X_WB = X_WF X_BF^-1,   V_WB from no velocity of F.   Orientation comes from the chain;
    where the robot starts, from the IMU's roll and pitch if there are any. Of the tuning, only what concerns sensors'
    faults counts.
    """

    by_imu: ClassVar[bool] = False

    def advance(self, state: FloatArray, sample: Sample, after: FloatArray) -> None:
        """As `OnKinematics.advance`."""
        _CHAIN_TICK(state, tuple(sample), self._fixed, self.by_imu, after)


class FootCentreImuEstimator(FootCentreEstimator):
    """The same with roll, pitch and angular velocity by the IMU, as the whole estimator has them; yaw by the chain.

    The foot's centre is still taken to stand still, whichever way the foot tilts. Without a gyro it is the chain alone.
    """

    by_imu: ClassVar[bool] = True
