"""A loop that is wired into a diagram, and one that is built.

`BuiltLoop`: a loop that is wired, and how it is run.

`WiredLoop`: what the calls that wire a standard loop return.
"""

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort

from drake_tc.errors import ParamsError
from drake_tc.loops.fused import fuse
from drake_tc.loops.recording import Progress, Recording, SignalLog, add_log, advance

CHUNK = 0.02
"""The state is looked at this often [s]."""


class TimedScenario(Protocol):
    """What a run needs of a scenario."""

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        ...

    @property
    def plant_step(self) -> float:
        """Step of the plant [s]."""
        ...


ScenarioT = TypeVar("ScenarioT", bound=TimedScenario)


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
            watch: Takes the root context at the start and returns what looks at it every `CHUNK`, at its time [s];
                False ends the run there.
            progress: Told what is done and which share.

        Raises:
            SimulationError: see `advance`; what is raised while watching is passed on.
        """
        simulator, scenario = Simulator(self.diagram), self.scenario
        context = simulator.get_mutable_context()
        self.start(context)
        goes_on = watch(context)
        begin = time.perf_counter()
        advance(simulator, scenario.duration, CHUNK, goes_on, plant_step=scenario.plant_step, progress=progress)
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
