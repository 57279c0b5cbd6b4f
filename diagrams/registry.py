"""The diagrams that commands know by name."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from pydrake.systems.framework import Diagram

from drake_tc.analysis.torque_loop.operating_point import sliding
from drake_tc.errors import ParamsError
from drake_tc.loops.advancing import Progress
from drake_tc.loops.scenarios.files import scenario_names
from drake_tc.loops.series_elastic.linear import sliding_sea
from drake_tc.loops.series_elastic.loop import SeaLoop, build_sea
from drake_tc.loops.series_elastic.scenario import SeaScenario, load_sea_scenario
from drake_tc.loops.simulated import (
    Simulated,
    simulate_sea_loop,
    simulate_torque_loop,
    simulate_tsid_loop,
)
from drake_tc.loops.torque.loop import Loop, build_loop
from drake_tc.loops.torque.scenario import Scenario, load_scenario
from drake_tc.loops.whole_body.loop import TsidLoop, build_tsid
from drake_tc.loops.whole_body.scenario import TsidScenario, load_tsid_scenario

HERE = Path(__file__).parent


class AnyScenario(Protocol):
    """What commands change of a scenario."""

    @property
    def seed(self) -> int:
        """Of all random numbers."""
        ...

    def changed(self, **fields: Any) -> Any:
        """The same with other values; those that are None stay."""
        ...


class AnyLoop(Protocol):
    """What commands need of a built diagram."""

    @property
    def diagram(self) -> Diagram:
        """The diagram."""
        ...


ScenarioT = TypeVar("ScenarioT", bound=AnyScenario)
LoopT = TypeVar("LoopT", bound=AnyLoop)


@dataclass(frozen=True)
class DiagramEntry(Generic[ScenarioT, LoopT]):
    """One diagram.

    Attributes:
        name: As commands take it.
        title: One line.
        scenario_file: Its committed scenarios; the first is the default.
        load: File, name and text of changes to scenario.
        build: Scenario to loop.
        simulate: Scenario to what a run comes to; told of progress, and whether to show it in a browser.
        sliding: The scenario as a linear analysis takes it: perfect sensors, dry friction constant. Model files that it
            needs go into the folder, which must stay for as long. None: there is no such thing, it is taken as it is.
    """

    name: str
    title: str
    scenario_file: Path
    load: Callable[[Path, str, str | None], ScenarioT]
    build: Callable[[ScenarioT], LoopT]
    simulate: Callable[[ScenarioT, Progress | None, bool], Simulated]
    sliding: Callable[[ScenarioT, Path], ScenarioT] | None = None

    def scenarios(self) -> list[str]:
        """Names of the committed scenarios."""
        names: list[str] = scenario_names(self.scenario_file)
        return names

    def scenario(self, name: str | None = None, file: Path | None = None, text: str | None = None) -> ScenarioT:
        """A scenario, from the committed file unless another is given; the first of the file when no name is.

        Raises:
            ParamsError: a file without scenarios; otherwise see `load_scenario`.
        """
        path = self.scenario_file if file is None else file
        if name is None:
            names = scenario_names(path)
            if not names:
                raise ParamsError(f"{path}: wanted at least one scenario; the file has none")
            name = names[0]
        return self.load(path, name, text)


TorqueLoopEntry = DiagramEntry[Scenario, Loop]
TsidEntry = DiagramEntry[TsidScenario, TsidLoop]
SeaEntry = DiagramEntry[SeaScenario, SeaLoop]


def _torque_loop(name: str, title: str) -> TorqueLoopEntry:
    file = HERE / f"{name}.scenario.yaml"
    return DiagramEntry(name, title, file, load_scenario, build_loop, simulate_torque_loop, _sliding_loop)


def _sliding_loop(scenario: Scenario, folder: Path) -> Scenario:
    return replace(sliding(scenario, folder), sensors="perfect")


def _tsid(name: str, title: str) -> TsidEntry:
    return DiagramEntry(name, title, HERE / f"{name}.scenario.yaml", load_tsid_scenario, build_tsid, simulate_tsid_loop)


def _sea(name: str, title: str) -> SeaEntry:
    file = HERE / f"{name}.scenario.yaml"
    return DiagramEntry(
        name, title, file, load_sea_scenario, build_sea, simulate_sea_loop, lambda scenario, _: sliding_sea(scenario)
    )


def _by_name(entries: Sequence[Any]) -> dict[str, Any]:
    return {entry.name: entry for entry in entries}


DIAGRAMS: Mapping[str, TorqueLoopEntry] = _by_name(
    [
        _torque_loop("hrp2_leg", "a hanging leg in torque control, or under its vendor's servo"),
        _torque_loop("hrp2_leg_contact", "the foot on a rigid object: force control"),
    ]
)
"""Those of the torque loop (paper A), which stability analysis and tuning know too."""

TSID_DIAGRAMS: Mapping[str, TsidEntry] = _by_name(
    [_tsid("humanoid_tsid", "a humanoid on a floor under robust TSID, its torques direct or through drives")]
)

SEA_DIAGRAMS: Mapping[str, SeaEntry] = _by_name(
    [_sea("sea_joint", "a voltage-driven series-elastic joint in torque control: held, moved by a hand, or free")]
)

RUNNABLE: Mapping[str, DiagramEntry[Any, Any]] = {**DIAGRAMS, **TSID_DIAGRAMS, **SEA_DIAGRAMS}
"""Everything that can be simulated and drawn."""


def diagram_entry(name: str) -> TorqueLoopEntry:
    """The diagram of the torque loop of that name.

    Raises:
        ParamsError: there is none; the message lists those there are.
    """
    return _found(name, DIAGRAMS)


def tsid_entry(name: str = "humanoid_tsid") -> TsidEntry:
    """The diagram around robust TSID of that name.

    Raises:
        ParamsError: there is none; the message lists those there are.
    """
    return _found(name, TSID_DIAGRAMS)


def sea_entry(name: str = "sea_joint") -> SeaEntry:
    """The diagram of a series-elastic joint of that name.

    Raises:
        ParamsError: there is none; the message lists those there are.
    """
    return _found(name, SEA_DIAGRAMS)


def runnable(name: str) -> DiagramEntry[Any, Any]:
    """Any diagram that can be simulated and drawn.

    Raises:
        ParamsError: there is none; the message lists those there are.
    """
    return _found(name, RUNNABLE)


EntryT = TypeVar("EntryT")


def _found(name: str, entries: Mapping[str, EntryT]) -> EntryT:
    if name not in entries:
        raise ParamsError(f"no diagram {name!r}; diagrams: {', '.join(entries)}")
    return entries[name]
