"""`ModelMonitor` in a torque loop: one line beside a simulated loop, or a Diagram beside a controller that runs.

    joint_estimate, estimated_torque ------------------------> model_monitor --> cause, change, statistic
    command - position (of servos) --> effort_filter ----------^

The effort passes the filter of the encoders, so that it is as old as the other signals.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, MatrixGain, Multiplexer, PassThrough

from drake_tc.errors import ParamsError
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
from drake_tc.loops.built_loop import Controller, Watched, add_input
from drake_tc.loops.fused import fuse
from drake_tc.loops.loop_builder import split
from drake_tc.loops.torque.wiring import TorqueLoop
from drake_tc.watch.health import ModelHealth
from drake_tc.watch.monitor import ModelMonitor, ModelMonitorSpec

SIGNALS = ("joint_estimate", "estimated_torque", "command")
"""Outputs of a torque controller that a `LoopMonitor` reads."""
SHOWN = ("residual", "cause", "change", "statistic")
"""Outputs of a `LoopMonitor`, (n,) each."""
POSITION = "position"
"""Input of a `LoopMonitor`: the positions as they are read, by the name of a controller's input port."""


def add_model_monitor(
    builder: DiagramBuilder, loop: TorqueLoop, health: ModelHealth, spec: ModelMonitorSpec | None = None
) -> ModelMonitor:
    """Watch the models of a torque loop while it is simulated.

    Args:
        builder: Holds the loop; not yet fused.
        loop: From `add_torque_loop`.
        health: What the models err by while nothing has changed.
        spec: What is looked for; None: the defaults.

    Returns:
        The monitor, whose ports `cause`, `change` and `statistic` can be recorded or connected.

    Raises:
        ParamsError: a joint of the loop that `health` does not have.

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> builder = DiagramBuilder()
        >>> plant = add_robot_plant(builder, robot)
        >>> loop = add_torque_loop(builder, plant, robot, load_models(robot.actuators))
        >>> health = ModelHealth(robot.joints, np.full(6, 1.0), np.full(6, 0.03), np.zeros((6, 7)))
        >>> add_model_monitor(builder, loop, health).get_cause_output_port().size()
        6
    """
    watched = Watched(loop.design.models, loop.design.spec.filters.window, loop.design.spec.filters.encoder_order)
    ports = {name: loop.signals[name] for name in ("joint_estimate", "estimated_torque", "command")}
    ports[POSITION] = loop.signals["encoder"]
    monitor = health.monitor(watched.models, spec, loop.period)
    return _connected(builder, ports, watched, monitor, loop.period)


def _connected(
    builder: DiagramBuilder, ports: Mapping[str, OutputPort], watched: Watched, monitor: ModelMonitor, dt: float
) -> ModelMonitor:
    """The monitor, added and connected."""
    n = len(watched.models)
    servo: Any = np.diag([-float(model.drive.kind == "position_servo") for model in watched.models])
    held = builder.AddNamedSystem("servo_positions", MatrixGain(servo))
    effort = builder.AddNamedSystem("effort", Adder(2, n))
    smooth = builder.AddNamedSystem("effort_filter", SavitzkyGolayFilter(n, watched.window, watched.order, dt))
    builder.AddNamedSystem("model_monitor", monitor)
    builder.Connect(ports[POSITION], held.get_input_port())
    builder.Connect(held.get_output_port(), effort.get_input_port(1))
    builder.Connect(ports["command"], effort.get_input_port(0))
    builder.Connect(effort.get_output_port(), smooth.GetInputPort("signal"))
    motion = split(builder, "monitored_motion", ports["joint_estimate"], [n, n, n])
    for name, port in zip(("position", "velocity", "acceleration"), motion, strict=True):
        builder.Connect(port, monitor.GetInputPort(name))
    builder.Connect(ports["estimated_torque"], monitor.GetInputPort("load_torque"))
    builder.Connect(smooth.GetOutputPort("value"), monitor.GetInputPort("effort"))
    return monitor


class LoopMonitor(Diagram):
    """The monitor beside a controller that runs without a simulated robot, as in `drake-tc run`.

    Inputs:
        joint_estimate (3n), estimated_torque (n), command (n): outputs of the controller.
        position (n): as read.
    Outputs: `residual`, `cause`, `change` and `statistic` (n) of `ModelMonitor`, and `seen` (5n), what it reads:
        position, velocity, acceleration, load torque and effort, all equally old.

    Attributes:
        joints: Names, in the order of the ports.
        period: dt [s].

    Example:
        >>> robot = load_robot(MODELS / "hrp2_like" / "hrp2_like_leg.yaml")
        >>> health = ModelHealth(robot.joints, np.full(6, 1.0), np.full(6, 0.03), np.zeros((6, 7)))
        >>> LoopMonitor(torque_controller(robot, load_models(robot.actuators)), health).joints[3]
        'r_knee'
    """

    def __init__(self, controller: Controller, health: ModelHealth, spec: ModelMonitorSpec | None = None) -> None:
        """Build the Diagram.

        Args:
            controller: From `torque_controller`.
            health: As in `add_model_monitor`.
            spec: What is looked for; None: the defaults.

        Raises:
            ParamsError: a controller without torque control; or a joint that `health` lacks.
        """
        super().__init__()
        watched, n = self.watched(controller), len(controller.controlled.joints)
        builder = DiagramBuilder()
        sizes = {"joint_estimate": 3 * n, "estimated_torque": n, "command": n, POSITION: n}
        ports = {name: add_input(builder, name, size) for name, size in sizes.items()}
        self.joints, self.period = controller.controlled.joints, controller.controlled.period
        monitor = health.monitor(watched.models, spec, self.period)
        _connected(builder, ports, watched, monitor, self.period)
        shown: dict[str, Any] = {name: builder.AddNamedSystem(f"{name}_output", PassThrough(n)) for name in SHOWN}
        for name, block in shown.items():
            builder.Connect(monitor.GetOutputPort(name), block.get_input_port())
        shown["seen"] = builder.AddNamedSystem("seen_output", Multiplexer([3 * n, n, n]))
        effort = builder.GetSubsystemByName("effort_filter").GetOutputPort("value")
        read = (ports["joint_estimate"], ports["estimated_torque"], effort)
        for number, port in enumerate(read):
            builder.Connect(port, shown["seen"].get_input_port(number))
        fuse(builder)
        for name, block in shown.items():
            builder.ExportOutput(block.get_output_port(), name)
        builder.BuildInto(self)

    @staticmethod
    def watched(controller: Controller) -> Watched:
        """What a controller tells of its models.

        Raises:
            ParamsError: a controller without torque control.
        """
        found = controller.controlled.watched
        if found is None:
            raise ParamsError(
                f"{controller.get_name()}: expected the torque control of a robot, as torque_controller makes it; this"
                " controller has no estimated joint torques to compare its models with"
            )
        return found
