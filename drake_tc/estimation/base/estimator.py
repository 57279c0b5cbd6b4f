"""`CopEstimator`: one tick of the base estimator, a pure function of a state and a sample."""

import numpy as np

from drake_tc.estimation.base.on_kinematics import OnKinematics
from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import Sample
from drake_tc.estimation.base.velocity import solve_program
from drake_tc.kernels.lazy import Kernel
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray

_TICK = Kernel("base_tick", "tick")


class CopEstimator(OnKinematics):
    """Base position, velocity and yaw from the point of each contact that stands still, the centre of pressure.

    Stage 1 (`drake_tc.kernels.base_velocity`), then stage 2 (`base_pose`), every tick; roll and pitch from the IMU, or
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
        self._fixed = (self.options, self.soles, self.tables, *self.robot_tables)

    def advance(self, state: FloatArray, sample: Sample, after: FloatArray) -> None:
        """As `OnKinematics.advance`; where a centre of pressure ends at its sole's edge, with a quadratic program."""
        program, given = np.empty(self._program_size), (state, *sample, *self._fixed)
        if not _TICK(*given, self._unsolved, program, after):
            _TICK(*given, solve_program(program, self._limits), program, after)
