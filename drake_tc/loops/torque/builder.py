"""`TorqueLoopBuilder`: what the stages of the torque loop share while it is being wired."""

from dataclasses import dataclass, field, replace

from pydrake.systems.framework import OutputPort

from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.gains import TorqueGains
from drake_tc.estimation.torque_model import BaseSource
from drake_tc.loops.loop_builder import LoopBuilder
from drake_tc.loops.torque.spec import TorqueLoopSpec, base_source
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import SensorSuite


@dataclass
class TorqueLoopBuilder(LoopBuilder[TorqueLoopSpec]):
    """The torque loop under construction.

    Attributes:
        robot, sensors: Of the loop.
        models: The drives as the controller takes them, in the order of the joints.
        gains: Feedback gains.
        force_reference: (6k) f_d at the contacts; None: no contact force is commanded.
        free: Whether nothing may touch the robot: a contact wrench is then a fault.
    """

    robot: Robot = field(kw_only=True)
    sensors: SensorSuite = field(kw_only=True)
    models: list[ActuatorModel] = field(kw_only=True)
    gains: TorqueGains = field(kw_only=True)
    force_reference: OutputPort | None = None
    free: bool = False

    @property
    def base_from(self) -> BaseSource:
        """Where the motion of the base comes from."""
        return base_source(self.scenario, self.robot)

    @property
    def controller_robot(self) -> Robot:
        """The robot as estimator and controller take it: with `base_from: fixed` a floating base counts as fixed."""
        return replace(self.robot, fixed_base=True) if self.base_from == "fixed" else self.robot
