"""A loop that is wired into a diagram, one that is built, and a controller without a plant.

`BuiltLoop`: a loop that is built from a scenario, and how it is run. `WiredLoop`: what the calls that wire a standard
loop return. `Controller`: input ports for its readings, output ports for its signals; `add_input` and `Controller` put
Drake's `PassThrough` blocks between the stages and the ports of the Diagram, so that one input can enter several stages
and `fuse` can replace the stages.
"""

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import PassThrough

from drake_tc.actuation.model import ActuatorModel
from drake_tc.errors import ParamsError
from drake_tc.loops.fused.fuse import StageValues, fuse
from drake_tc.loops.recording import Progress, Recording, SignalLog, add_log, advance
from drake_tc.loops.scenarios import ScenarioBase
from drake_tc.types import FloatArray

ScenarioT = TypeVar("ScenarioT", bound=ScenarioBase)


@dataclass(frozen=True, eq=False, kw_only=True)
class BuiltLoop(Generic[ScenarioT]):
    """A diagram that was built from a scenario.

    Attributes:
        scenario: What it was built from.
        diagram, plant: The systems.
        log: Of all recorded signals.
        flag_names: Of the recorded signal "flags", in order; empty without one.
    """

    scenario: ScenarioT
    diagram: Diagram
    plant: MultibodyPlant
    log: SignalLog
    flag_names: tuple[str, ...] = ()

    def start(self, context: Context) -> None:
        """Put the diagram's context where the scenario begins; here nothing has to be put."""

    def run(self, watch: Callable[[Context], Callable[[float], bool]], progress: Progress | None = None) -> Recording:
        """Start, and advance to the scenario's end as long as what is watched goes on.

        Args:
            watch: Takes the root context at the start and returns what looks at it every `recording.CHUNK`, at its
                time; False ends the run there.
            progress: Told what is done and which share.

        Raises:
            SimulationError: see `advance`; what is raised while watching is passed on.
        """
        simulator, step = Simulator(self.diagram), self.plant.time_step()
        context = simulator.get_mutable_context()
        self.start(context)
        goes_on = watch(context)
        begin = time.perf_counter()
        advance(simulator, self.scenario.duration, goes_on, plant_step=step, progress=progress)
        seconds = time.perf_counter() - begin
        times, signals = self.log.recorded(context)
        return Recording(time=times, signals=signals, seconds=seconds, flag_names=self.flag_names)


@dataclass(frozen=True, eq=False, kw_only=True)
class WiredLoop:
    """A loop in a diagram that is still under construction.

    Attributes:
        systems: Stage to its system; the user's own where one was given.
        signals: Name to port of what can be recorded, or connected to systems of the user's own.
        period: Of the control [s].
        flag_names: Of the signal `flags`, in order; empty without one.
    """

    systems: Mapping[str, Any]
    signals: dict[str, OutputPort]
    period: float
    flag_names: tuple[str, ...] = ()

    def add_log(self, builder: DiagramBuilder, *names: str) -> SignalLog:
        """Record signals every period; all of them where none is named.

        Args:
            builder: The diagram's.
            names: Of `signals`.

        Raises:
            ParamsError: a signal that this loop does not have.
        """
        for name in names:
            if name not in self.signals:
                raise ParamsError(f"no signal {name!r} in this loop; signals: {', '.join(self.signals)}")
        return add_log(builder, {name: self.signals[name] for name in names or self.signals}, self.period)

    def build(
        self, builder: DiagramBuilder, name: str, left_out: Collection[str] = (), *, fused: bool = False
    ) -> tuple[Diagram, SignalLog]:
        """The diagram, and the log of its signals.

        Args:
            builder: The diagram's.
            name: Of the diagram.
            left_out: Signals that are not logged.
            fused: Run the stages in one system (`fuse`); ports in `signals` and stages in `systems` then do not exist.
        """
        log = self.add_log(builder, *(signal for signal in self.signals if signal not in left_out))
        if fused:
            fuse(builder)
        diagram = builder.Build()
        diagram.set_name(name)
        return diagram, log


Start = Callable[[StageValues], None]
"""Puts a part of a diagram's context where the robot starts."""


CONTACTS = "active_contacts"
"""Input port that says on which contacts a controller stands."""


class Boundary(PassThrough):
    """Where a signal enters a controller."""

    def __init__(self, size: int, *, asked: bool) -> None:
        """Declare the ports.

        Args:
            size: Of the signal.
            asked: Whether it is what is asked of the controller, and not what a sensor reads.
        """
        super().__init__(size)
        self.graph_stage = "reference" if asked else "sensing"


def add_input(builder: DiagramBuilder, name: str, size: int) -> OutputPort:
    """An input port of the Diagram, as a port that stages can be connected to.

    Args:
        builder: Of the Diagram.
        name: Of the input port, and of the block behind it.
        size: Of the port.
    """
    block: Any = builder.AddNamedSystem(name, Boundary(size, asked=name.endswith("reference") or name == CONTACTS))
    builder.ExportInput(block.get_input_port(), name)
    port: OutputPort = block.get_output_port()
    return port


@dataclass(frozen=True, eq=False)
class Watched:
    """What tells whether the models that a controller uses still hold (`drake_tc.watch.in_loop`).

    Attributes:
        models: (n) of the drives, in the order of the joints.
        window, order: Of the filter of the encoders.
    """

    models: tuple[ActuatorModel, ...]
    window: int
    order: int


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlledJoints:
    """What a controller commands.

    Attributes:
        joints: Names, in the order of the ports `position` and `command`.
        servo: Whether the drive of a joint is a position servo, whose command is a position [rad].
        lower, upper: (n,) ends of the joints' ranges [rad]; infinite where there are none.
        period: Of the control [s].
        flag_names: Of the output port `flags`, in order; empty without one.
        watched: Models and filter of a controller that estimates joint torques; None of others.
        inputs: Signals that come in, such as readings, and have no output port.
        starts: Put stages where a robot that has stood for long has them, in this order.
    """

    joints: tuple[str, ...]
    servo: tuple[bool, ...]
    lower: FloatArray
    upper: FloatArray
    period: float
    flag_names: tuple[str, ...] = ()
    watched: Watched | None = None
    inputs: Collection[str] = ()
    starts: tuple[Start, ...] = ()


class Controller(Diagram):
    """A controller without a plant: a Diagram from readings to commands.

    Its ports are those that the function which made it lists, such as `torque_controller`.

    Attributes:
        controlled: Joints, drives and period.
    """

    def __init__(
        self,
        builder: DiagramBuilder,
        name: str,
        controlled: ControlledJoints,
        signals: Mapping[str, OutputPort],
        *,
        fused: bool = False,
    ) -> None:
        """Build the Diagram, with an output port for each signal but for those that come in.

        Args:
            builder: Holds the stages; built here.
            name: Of the Diagram.
            controlled: Joints, drives and period.
            signals: Name to port; "command" becomes the first output port.
            fused: Run the stages in one system (`fuse`).
        """
        super().__init__()
        names = ["command", *(each for each in signals if each != "command" and each not in controlled.inputs)]
        blocks: dict[str, Any] = {}
        for each in names:
            blocks[each] = builder.AddNamedSystem(f"{each}_output", PassThrough(signals[each].size()))
            builder.Connect(signals[each], blocks[each].get_input_port())
        self._fused = fuse(builder) if fused else None
        for each, block in blocks.items():
            builder.ExportOutput(block.get_output_port(), each)
        builder.BuildInto(self)
        self.set_name(name)
        self.controlled = controlled

    def start(self, context: Context) -> None:
        """Put estimators where a robot that has stood still for long has them.

        Args:
            context: Of this Diagram, with the first readings at its input ports.
        """
        values = StageValues(context, self._fused)
        for start in self.controlled.starts:
            start(values)
