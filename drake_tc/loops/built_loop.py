"""`BuiltLoop`: a loop that is wired, and how it is run."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram

from drake_tc.loops.advancing import Progress, advance
from drake_tc.loops.recording import Recording
from drake_tc.loops.signal_log import SignalLog

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
