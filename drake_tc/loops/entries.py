"""Entries for the registry: a diagram that is one of the library's loops, with a file of scenarios.

What a command needs of a diagram: its scenarios, how it is built, and how it is simulated.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, Literal, Protocol, TypeVar

from pydrake.systems.framework import Context, Diagram

from drake_tc.errors import ParamsError
from drake_tc.loops.recording import Progress
from drake_tc.loops.scenarios import ScenarioBase, scenario_names
from drake_tc.loops.series_elastic.loop import SeaLoop, build_sea
from drake_tc.loops.series_elastic.scenario import SeaScenario, sliding_sea
from drake_tc.loops.simulated import Simulated, simulate_sea_loop, simulate_torque_loop, simulate_tsid_loop
from drake_tc.loops.torque.running import Loop, build_loop
from drake_tc.loops.torque.scenario import Scenario
from drake_tc.loops.torque.stages import sliding_scenario
from drake_tc.loops.whole_body.running import TsidLoop, build_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario

Kind = Literal["torque", "whole_body", "series_elastic", "function"]
"""Loops of the library: the torque loop, robust TSID, one series-elastic joint; and a diagram of the user's own."""


class AnyLoop(Protocol):
    """What commands need of a built diagram."""

    @property
    def diagram(self) -> Diagram:
        """The diagram."""
        ...

    @property
    def period(self) -> float:
        """Period of the control [s]."""
        ...

    def start(self, context: Context) -> None:
        """Put the diagram's context where the scenario begins."""
        ...


ScenarioT = TypeVar("ScenarioT", bound=ScenarioBase)
LoopT = TypeVar("LoopT", bound=AnyLoop)


@dataclass(frozen=True)
class DiagramEntry(Generic[ScenarioT, LoopT]):
    """One diagram.

    Attributes:
        name: As commands take it.
        title: One line.
        kind: Which loop of the library it is.
        scenario_file: Its committed scenarios; the first is the default.
        load: File, name and text of changes to scenario.
        build: Scenario to loop.
        simulate: Scenario to what a run comes to; told of progress, and whether to show it in a browser.
        sliding: The scenario as a linear analysis takes it: perfect sensors, dry friction constant. Model files that it
            needs go into the folder, which must stay for as long. None: the scenario is taken as it is.
    """

    name: str
    title: str
    kind: Kind
    scenario_file: Path
    load: Callable[[Path, str, str | None], ScenarioT]
    build: Callable[[ScenarioT], LoopT]
    simulate: Callable[[ScenarioT, Progress | None, bool], Simulated]
    sliding: Callable[[ScenarioT, Path], ScenarioT] | None = None

    def naming(self, file: Path | None, text: str | None) -> "DiagramEntry[ScenarioT, LoopT]":
        """The same entry, whose errors of building name where the user's scenario comes from.

        Args:
            file: The user's scenario file.
            text: The user's changes.
        """
        source = "scenario text" if file is None else str(file)
        if file is None and text is None:
            return self
        build, simulate = self.build, self.simulate

        def named_build(scenario: ScenarioT) -> LoopT:
            with naming_errors(source):
                return build(scenario)

        def named_simulate(scenario: ScenarioT, progress: Progress | None, meshcat: bool) -> Simulated:
            with naming_errors(source):
                return simulate(scenario, progress, meshcat)

        return replace(self, build=named_build, simulate=named_simulate)

    def scenarios(self) -> list[str]:
        """Names of the committed scenarios."""
        names: list[str] = scenario_names(self.scenario_file)
        return names

    def scenario(self, name: str | None = None, file: Path | None = None, text: str | None = None) -> ScenarioT:
        """A scenario, from the committed file unless another is given; the first of the file when no name is.

        Raises:
            ParamsError: a file without scenarios; otherwise see `Scenario.load`.
        """
        path = self.scenario_file if file is None else file
        if name is None:
            names = scenario_names(path)
            if not names:
                raise ParamsError(f"{path}: expected at least one scenario; the file has none")
            name = names[0]
        return self.load(path, name, text)


@contextmanager
def naming_errors(source: str) -> Iterator[None]:
    """Put the source before a ParamsError that does not name it; what Drake itself refuses becomes one.

    Raises:
        ParamsError: the diagram cannot be built.
    """
    try:
        yield
    except ParamsError as error:
        raise error if source in str(error) else ParamsError(f"{source}: {error}") from None
    except (RuntimeError, OverflowError, MemoryError) as error:
        reason = " ".join(str(error).split()) or "a number is too large"
        raise ParamsError(f"{source}: the diagram cannot be built or run: {reason}") from error


TorqueLoopEntry = DiagramEntry[Scenario, Loop]
TsidEntry = DiagramEntry[TsidScenario, TsidLoop]
SeaEntry = DiagramEntry[SeaScenario, SeaLoop]


def torque_loop(name: str, title: str, scenario_file: Path) -> TorqueLoopEntry:
    """A diagram of the torque loop (Del Prete et al., 2016), which stability analysis and tuning know too.

    Args:
        name: As commands take it.
        title: One line.
        scenario_file: Its scenarios; the first is the default.
    """
    return DiagramEntry(
        name, title, "torque", scenario_file, Scenario.load, build_loop, simulate_torque_loop, _sliding_loop
    )


def _sliding_loop(scenario: Scenario, folder: Path) -> Scenario:
    return replace(sliding_scenario(scenario, folder), sensors="perfect")


def whole_body_loop(name: str, title: str, scenario_file: Path) -> TsidEntry:
    """A diagram of a legged robot on a floor under robust TSID; see `torque_loop` for the arguments."""
    return DiagramEntry(name, title, "whole_body", scenario_file, TsidScenario.load, build_tsid, simulate_tsid_loop)


def series_elastic_loop(name: str, title: str, scenario_file: Path) -> SeaEntry:
    """A diagram of one series-elastic joint in torque control; see `torque_loop` for the arguments."""
    return DiagramEntry(
        name,
        title,
        "series_elastic",
        scenario_file,
        SeaScenario.load,
        build_sea,
        simulate_sea_loop,
        lambda scenario, _: sliding_sea(scenario),
    )
