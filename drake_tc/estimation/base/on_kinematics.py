"""What both base estimators are built on: the kinematics of a robot's contacts, and a state before the first tick."""

from typing import Any

from drake_tc.estimation.base.kinematics import BaseKinematics
from drake_tc.estimation.base.spec import BaseEstimatorSpec
from drake_tc.estimation.base.state import BaseState, initial_state
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


class OnKinematics:
    """A base estimator without its `step`.

    Attributes:
        spec: Contacts and tuning.
        kinematics: Of the robot.
        num_joints, num_contacts: n, k.
    """

    def __init__(self, robot: Robot, spec: BaseEstimatorSpec) -> None:
        """Build the kinematics.

        Args:
            robot: With a floating base and an IMU.
            spec: Contacts and tuning.

        Raises:
            ParamsError: what robot and contacts lack.
        """
        self.spec = spec
        self.kinematics = BaseKinematics(robot, spec.contacts)
        self.num_joints, self.num_contacts = len(robot.joints), len(spec.contacts)

    def create_scratch(self) -> Any:
        """Memory for `step`; one for each context."""
        return self.kinematics.create_scratch()

    def initial_state(self, position: FloatArray, yaw: float) -> BaseState:
        """Before the first tick, with the base at `position` (3,) [m] and `yaw` [rad]."""
        return initial_state(self.kinematics.robot.posture, self.num_contacts, position, yaw)
