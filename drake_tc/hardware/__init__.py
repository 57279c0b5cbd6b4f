"""A controller without a plant against a robot: stepped tick by tick, and against wall-clock time.

torque_controller(...) --> RealTimeLoop --> a link: two functions of your own (CallbackLink), or LCM (LcmLink)
"""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.hardware.lcm_link import LcmLink, LcmRobot
    from drake_tc.hardware.link import CallbackLink
    from drake_tc.hardware.loop import RealTimeLoop, RealTimeSpec
    from drake_tc.hardware.simulated_robot import SimulatedRobot
    from drake_tc.hardware.stepper import ControllerStepper

__all__ = [
    "CallbackLink",
    "ControllerStepper",
    "LcmLink",
    "LcmRobot",
    "RealTimeLoop",
    "RealTimeSpec",
    "SimulatedRobot",
]

_HOMES = {
    "CallbackLink": "link",
    "ControllerStepper": "stepper",
    "LcmLink": "lcm_link",
    "LcmRobot": "lcm_link",
    "RealTimeLoop": "loop",
    "RealTimeSpec": "loop",
    "SimulatedRobot": "simulated_robot",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
