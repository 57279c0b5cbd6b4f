"""The baselines: the chain from a foot whose centre is taken to stand still, without the IMU and with it."""

from typing import ClassVar

from drake_tc.estimation.base.on_kinematics import OnKinematics
from drake_tc.estimation.base.state import Sample
from drake_tc.kernels.lazy import Kernel
from drake_tc.types import FloatArray

_TICK = Kernel("base_chain", "tick")


class FootCentreEstimator(OnKinematics):
    """Leg odometry: the most loaded contact is fixed in the world, position and orientation, until another takes over.

    With F the fixed contact:   X_WB = X_WF X_BF^-1,   V_WB from no velocity of F.   Orientation comes from the chain;
    where the robot starts, from the IMU's roll and pitch if there are any. Of the tuning, only what concerns sensors'
    faults counts.
    """

    by_imu: ClassVar[bool] = False

    def advance(self, state: FloatArray, sample: Sample, after: FloatArray) -> None:
        """As `OnKinematics.advance`."""
        _TICK(state, *sample, self.options, *self.robot_tables, self.by_imu, after)


class FootCentreImuEstimator(FootCentreEstimator):
    """The same with roll, pitch and angular velocity by the IMU, as the whole estimator has them; yaw by the chain.

    The foot's centre is still taken to stand still, whichever way the foot tilts. Without a gyro it is the chain alone.
    """

    by_imu: ClassVar[bool] = True
