"""`LoopDesign`: what a torque loop is wired from, of a scenario or of a diagram of the user's own."""

from dataclasses import dataclass

from drake_tc.actuation.model import ActuatorModel
from drake_tc.control.gains import TorqueGains
from drake_tc.loops.torque.parts import actuator_models, loop_robot, torque_gains
from drake_tc.loops.torque.references import posture
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.spec import TorqueLoopSpec
from drake_tc.robot.robot import Robot
from drake_tc.types import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopDesign:
    """What a torque loop is wired from.

    Attributes:
        robot: Of the plant.
        spec: How the loop is controlled.
        actuators: (n) models of the simulated drives, in the order of the robot's joints.
        models: (n) what the controller takes the drives for.
        gains: Feedback gains.
        posture: (n,) where the motion rests [rad].

    Example:
        >>> scenario = TORQUE_LOOP.scenario("brisk_swing")
        >>> LoopDesign.of_scenario(scenario).gains.size
        6
    """

    robot: Robot
    spec: TorqueLoopSpec
    actuators: tuple[ActuatorModel, ...]
    models: tuple[ActuatorModel, ...]
    gains: TorqueGains
    posture: FloatArray

    @classmethod
    def of_scenario(cls, scenario: Scenario) -> "LoopDesign":
        """A scenario's.

        Raises:
            ParamsError: a file that cannot be read, or a joint or gain that is not possible.
        """
        robot = loop_robot(scenario)
        return cls(
            robot=robot,
            spec=scenario,
            actuators=tuple(actuator_models(scenario, robot).values()),
            models=tuple(actuator_models(scenario, robot, controller=True).values()),
            gains=torque_gains(scenario, robot),
            posture=posture(scenario.motion, robot),
        )
