"""A robot as data: URDF and one YAML file become plants, joint order, limits and sensor frames."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.robot.plant import add_robot, joint_limits
    from drake_tc.robot.robot import Robot, load_robot

__all__ = [
    "Robot",
    "add_robot",
    "joint_limits",
    "load_robot",
]

_HOMES = {
    "Robot": "robot",
    "add_robot": "plant",
    "joint_limits": "plant",
    "load_robot": "robot",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
