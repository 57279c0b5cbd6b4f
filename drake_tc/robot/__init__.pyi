"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.robot.plant import add_robot as add_robot
from drake_tc.robot.plant import joint_limits as joint_limits
from drake_tc.robot.robot import Robot as Robot
from drake_tc.robot.robot import load_robot as load_robot
