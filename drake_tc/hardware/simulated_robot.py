"""`SimulatedRobot`: plant, drives and sensors of a torque loop without its controller, tick by tick.

With `torque_controller` it makes the torque loop. In one Diagram, IMU and F/T sensors feel the torque of the tick's own
command (`ActuatorPlant` feeds through); here, as on a robot, they feel that of the command before, unless `apply` is
called before `read`. `serve` runs it against wall-clock time at the robot's end of LCM.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import PassThrough

from drake_tc.actuation.joint_effects import Models, model_list
from drake_tc.actuation.wiring import add_actuators
from drake_tc.hardware.lcm_link import URL, LcmRobot
from drake_tc.hardware.link import Message, WallClock, real_time_priority, stopping_signals
from drake_tc.loops.built_loop import add_input
from drake_tc.loops.fused import fuse
from drake_tc.loops.plant import add_robot_plant
from drake_tc.loops.torque.scenario import TorqueLoopSpec, sensor_suite
from drake_tc.loops.torque.wiring import INPUTS
from drake_tc.robot.robot import Robot
from drake_tc.sensing.suite import add_sensors
from drake_tc.types import FloatArray

LAG = 0.1
"""A simulated robot that is later than this lets its time stand still; what is less it catches up [s]."""
WATCHDOG = 0.1
"""A simulated robot whose commands are older than this rests: servos hold the positions that they have then, and other
drives are switched off [s]."""


class SimulatedRobot:
    """The robot, its drives and its sensors; a tick is a period of the control.

    A tick k reads the sensors at k dt, and `advance` moves the robot to (k + 1) dt under a command.

    Attributes:
        period: dt [s].
        joints: n.
        outputs: Port of the readings to its size, as `torque_controller` reads them.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> SimulatedRobot(robot, load_models(robot.actuators)).read()["imu"].size
        6
    """

    def __init__(self, robot: Robot, models: Models, spec: TorqueLoopSpec | None = None) -> None:
        """Build plant, drives and sensors; the robot is at rest in its posture.

        Args:
            robot: From `load_robot`.
            models: Of its drives, by joint or in the order of the robot's joints.
            spec: With sensors, their faults, seed and period; None: the defaults.

        Raises:
            ParamsError: models or sensors that do not fit the robot.
        """
        spec = TorqueLoopSpec() if spec is None else spec
        builder, n = DiagramBuilder(), len(robot.joints)
        plant: Any = add_robot_plant(builder, robot, spec.dt)
        sensors = add_sensors(builder, plant, robot, sensor_suite(spec), spec.dt, spec.seed, spec.faults)
        drives = dict(zip(robot.joints, model_list(models, robot.joints), strict=True))
        actuators = add_actuators(builder, plant, drives, spec.dt)
        builder.Connect(add_input(builder, "command", n), actuators.GetInputPort("command"))
        blocks: dict[str, Any] = {}
        for name, port in vars(sensors.readings).items():
            if port is not None and (name != "joint_torque" or spec.torque_from == "sensor"):
                blocks[INPUTS[name]] = builder.AddNamedSystem(f"{name}_output", PassThrough(port.size()))
                builder.Connect(port, blocks[INPUTS[name]].get_input_port())
        fuse(builder)
        for name, block in blocks.items():
            builder.ExportOutput(block.get_output_port(), name)
        self._servo = np.array([drives[joint].drive.kind == "position_servo" for joint in robot.joints])
        self.period, self.joints, self._diagram = spec.dt, n, builder.Build()
        self._ports: dict[str, Any] = {name: self._diagram.GetOutputPort(name) for name in blocks}
        self.outputs = {name: int(port.size()) for name, port in self._ports.items()}
        self._simulator = Simulator(self._diagram)
        self._context: Any = self._simulator.get_mutable_context()
        self._command: Any = self._diagram.GetInputPort("command")
        self.apply(self.at_rest(robot.posture))
        self._simulator.Initialize()
        self._ticks = 0

    def read(self) -> dict[str, FloatArray]:
        """The readings of this tick, by port."""
        return {name: np.array(port.Eval(self._context)) for name, port in self._ports.items()}

    def at_rest(self, position: FloatArray) -> FloatArray:
        """(n,) command of drives that nobody commands: servos hold `position` (n,), other drives get 0."""
        return np.where(self._servo, position, 0.0)

    def apply(self, command: FloatArray) -> None:
        """Give the drives a command, without moving on.

        Args:
            command: (n,) of the drives.
        """
        self._command.FixValue(self._context, command)

    def advance(self, command: FloatArray) -> None:
        """Move to the next tick.

        Args:
            command: (n,) of the drives.
        """
        self.apply(command)
        self._ticks += 1
        self._simulator.AdvanceTo(self._ticks * self.period)


class LockStepLink:
    """A simulated robot that moves when a command comes in: a `RobotLink` without a clock, for tests and rehearsals."""

    def __init__(self, robot: SimulatedRobot) -> None:
        """Keep the robot."""
        self._robot = robot

    def read(self) -> Message:
        """The readings of this tick."""
        return self._robot.read()

    def write(self, command: Message) -> None:
        """Advance the robot."""
        self._robot.advance(command["command"])

    def stop_requested(self) -> bool:
        """Never."""
        return False

    def close(self) -> None:
        """Nothing has to be closed."""


@dataclass
class Served:
    """What a served robot has seen.

    Attributes:
        ticks: Ticks of the robot.
        commands: Command messages that came in.
        overruns: Ticks that were not done when the next one was due.
    """

    ticks: int = 0
    commands: int = 0
    overruns: int = 0


def serve(robot: SimulatedRobot, url: str = URL, duration: float = np.inf, priority: int = 0) -> Served:
    """Run a simulated robot against wall-clock time: a status message a tick, and the newest command for the next.

    It ends after `duration`, or with SIGTERM or SIGINT.

    Args:
        robot: At its first tick.
        url: Of LCM.
        duration: [s].
        priority: Real-time priority; 0: none.

    Raises:
        ParamsError: a URL of another kind, or a priority that the process may not have.
    """
    ended: list[bool] = []
    with real_time_priority(priority), stopping_signals(lambda: ended.append(True)):
        return _served(robot, LcmRobot(robot.outputs, robot.joints, url), duration, ended)


def _served(robot: SimulatedRobot, bus: LcmRobot, duration: float, ended: list[bool]) -> Served:
    readings, clock, served = robot.read(), WallClock(), Served()
    command, age, due = robot.at_rest(readings["position"]), 0.0, clock.now()
    end = due + duration
    while not ended and due < end:
        clock.wait_until(due)
        found = bus.receive()
        age = age + robot.period if found is None else 0.0
        if found is not None:
            command = found["command"]
            served.commands += 1
        elif abs(age - WATCHDOG) < 0.5 * robot.period:
            command = robot.at_rest(readings["position"])
        robot.advance(command)
        readings = robot.read()
        bus.send(readings)
        served.ticks += 1
        due += robot.period
        served.overruns += clock.now() > due
        due = max(due, clock.now() - LAG)
    return served
