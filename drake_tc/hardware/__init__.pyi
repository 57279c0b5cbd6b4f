"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.hardware.lcm_link import LcmLink as LcmLink
from drake_tc.hardware.lcm_link import LcmRobot as LcmRobot
from drake_tc.hardware.link import CallbackLink as CallbackLink
from drake_tc.hardware.loop import RealTimeLoop as RealTimeLoop
from drake_tc.hardware.loop import RealTimeSpec as RealTimeSpec
from drake_tc.hardware.simulated_robot import SimulatedRobot as SimulatedRobot
from drake_tc.hardware.stepper import ControllerStepper as ControllerStepper
