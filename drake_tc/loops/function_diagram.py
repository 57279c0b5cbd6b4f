"""A diagram that a function of the user's returns, as commands take it: `module:function` in place of a name."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import Parameter, getsourcefile, signature
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, System
from pydrake.systems.primitives import VectorLogSink

from drake_tc.actuation.wiring import actuated_joints
from drake_tc.config.records import Positive, read_record
from drake_tc.control.gains import TorqueGains
from drake_tc.errors import ParamsError
from drake_tc.loops.built_loop import Controller
from drake_tc.loops.entries import DiagramEntry
from drake_tc.loops.motion import FRAMES_PER_SECOND, DiagramPictures
from drake_tc.loops.plant import start_meshcat
from drake_tc.loops.recording import NamedSink, Progress, advance, write_log
from drake_tc.loops.scenarios import ScenarioBase, Seed, changes_in
from drake_tc.loops.simulated import RunPlot, Simulated, Tell, TimePanel, speed_line
from drake_tc.loops.torque.scenario import TorqueLoopSpec
from drake_tc.loops.torque.wiring import TorqueLoop
from drake_tc.types import FloatArray, TextTable


@dataclass(frozen=True)
class FunctionScenario(ScenarioBase):
    """How long a function's diagram is run.

    Attributes:
        duration: [s].
        seed: 0 starts in the default context; another one draws a random context by it.
    """

    duration: Positive = 2.0
    seed: Seed = 0


@dataclass(frozen=True, eq=False)
class FunctionLoop:
    """A diagram that a function returned.

    Attributes:
        scenario: How it is run.
        diagram: The diagram; its default context is where it starts.
        period: The longest period of its discrete systems [s], of which the others divide it.
        torque_loop: What `add_torque_loop` returned, where the function returns it beside the diagram.
    """

    scenario: FunctionScenario
    diagram: Diagram
    period: float
    torque_loop: TorqueLoop | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """Of its torque loop, or of its only plant in the order of the actuators; none where there are several."""
        if self.torque_loop is not None:
            return self.torque_loop.design.robot.joints
        plants = [system for system in _systems(self.diagram) if isinstance(system, MultibodyPlant)]
        return tuple(actuated_joints(plants[0])) if len(plants) == 1 else ()

    def start(self, context: Context) -> None:
        """Draw the diagram's random parameters and states by the scenario's seed, in place of its default context."""
        if self.scenario.seed:
            self.diagram.SetRandomContext(context, RandomGenerator(self.scenario.seed))


@dataclass(frozen=True)
class FunctionEntry(DiagramEntry[FunctionScenario, FunctionLoop]):
    """A function's diagram, which has no file of scenarios.

    Attributes:
        rebuild: Scenario, control and gains to the diagram with these; None for a function without arguments `spec` and
            `gains`.
    """

    rebuild: Callable[[FunctionScenario, TorqueLoopSpec, TorqueGains], FunctionLoop] | None = None

    def scenarios(self) -> list[str]:
        """No names."""
        return []

    def scenario(self, name: str | None = None, file: Path | None = None, text: str | None = None) -> FunctionScenario:
        """How the diagram is run; `text` may change `duration` and `seed`.

        Raises:
            ParamsError: a name or a file, as there are no scenarios; an unknown field, or a value that is not possible.
        """
        if name is not None or file is not None:
            raise ParamsError(f"{self.name}: the diagram of a function has no scenarios; leave their name and file out")
        return read_record(FunctionScenario, changes_in(text) if text else {}, self.name)


def function_entry(name: str, function: Callable[..., Diagram | tuple[Diagram, TorqueLoop]]) -> FunctionEntry:
    """The entry of a function that needs no arguments and returns a built Drake Diagram.

    For `drake-tc tune` it also returns the loop of `add_torque_loop`, as (diagram, loop). If it takes the arguments
    `spec` and `gains` of `add_torque_loop`, the tuned loop can be simulated.

    Args:
        name: As commands take it: a registered name, or `module:function`.
        function: Called anew for every simulation and linearisation.

    Raises:
        ParamsError: The function requires arguments.

    Example:
        >>> function_entry("small_loop", small_loop).kind
        'function'
    """

    def build(scenario: FunctionScenario, **arguments: Any) -> FunctionLoop:
        made = function(**arguments)
        diagram, loop = made if isinstance(made, tuple) and len(made) == 2 else (made, None)
        if not isinstance(diagram, Diagram):
            raise ParamsError(f"{name}: expected a function that returns a Diagram, got {type(diagram).__name__}")
        torque_loop = loop if isinstance(loop, TorqueLoop) else None
        return FunctionLoop(scenario, diagram, _period(name, diagram), torque_loop)

    def load(path: Path, which: str, text: str | None) -> FunctionScenario:
        raise ParamsError(f"{name}: the diagram of a function has no scenarios")

    def simulate(scenario: FunctionScenario, progress: Progress | None, meshcat: bool) -> Simulated:
        return _simulated(build(scenario), progress, meshcat=meshcat)

    def rebuild(scenario: FunctionScenario, spec: TorqueLoopSpec, gains: TorqueGains) -> FunctionLoop:
        return build(scenario, spec=spec, gains=gains)

    _check_no_arguments(name, function)
    return FunctionEntry(
        name,
        "a diagram of a function",
        "function",
        _source(function),
        load,
        build,
        simulate,
        rebuild=rebuild if {"spec", "gains"} <= set(_parameters(function)) else None,
    )


def _parameters(function: Callable[..., Any]) -> Mapping[str, Parameter]:
    """By name; none of a built-in function that does not tell them."""
    try:
        return signature(function).parameters
    except (TypeError, ValueError):
        return {}


def _check_no_arguments(name: str, function: Callable[..., Any]) -> None:
    parameters = _parameters(function).values()
    optional = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    required = [each.name for each in parameters if each.default is Parameter.empty and each.kind not in optional]
    if required:
        raise ParamsError(
            f"{name}: expected a function without arguments that returns a Diagram, got one that requires"
            f" {', '.join(required)}"
        )


def _source(function: Callable[..., Any]) -> Path:
    """The file of a function; the working folder for one that has none, as built-in ones."""
    try:
        return Path(getsourcefile(function) or ".")
    except TypeError:
        return Path()


def _systems(diagram: Diagram) -> list[System]:
    """All systems in a diagram, those of nested diagrams too."""
    found = []
    for system in diagram.GetSystems():
        found += _systems(system) if isinstance(system, Diagram) else [system]
    return found


def _period(name: str, diagram: Diagram) -> float:
    """The longest period [s].

    Raises:
        ParamsError: periods that do not divide it, or none at all.
    """
    if isinstance(diagram, Controller):
        return diagram.controlled.period
    attributes = [system.GetUniquePeriodicDiscreteUpdateAttribute() for system in _systems(diagram)]
    periods = sorted({attribute.period_sec() for attribute in attributes if attribute is not None})
    if not periods:
        raise ParamsError(f"{name}: expected a diagram with a discrete period, of a controller or plant; it has none")
    longest = periods[-1]
    for period in periods:
        if abs(longest / period - round(longest / period)) > 1e-6:
            raise ParamsError(f"{name}: expected periods that divide the longest, {longest:g} s, got {period:g} s")
    return float(longest)


def _simulated(loop: FunctionLoop, progress: Progress | None, *, meshcat: bool) -> Simulated:
    simulator, scenario = Simulator(loop.diagram), loop.scenario
    context = simulator.get_mutable_context()
    loop.start(context)
    frames = _filmed(loop, simulator, start_meshcat() if meshcat else None)
    begin = time.perf_counter()
    advance(simulator, scenario.duration, lambda now: True, plant_step=loop.period, progress=progress)
    seconds = time.perf_counter() - begin
    logs: dict[str, _Logged] = {}
    for system in _systems(loop.diagram):
        if isinstance(system, VectorLogSink):
            log = system.FindLog(context)
            values, name = np.array(log.data()).T, system.get_name()
            own = system.names() if isinstance(system, NamedSink) else None
            logs[name] = _Logged(
                np.array(log.sample_times()), values, own or [f"{name}[{i}]" for i in range(values.shape[1])]
            )
    rows = tuple(
        (name, *(f"{value:.4g}" for value in (column.min(), column.max(), column[-1])))
        for log in logs.values()
        for name, column in zip(log.names, log.values.T, strict=True)
    )
    summary = {
        "robot": loop.diagram.get_name(),
        "duration": scenario.duration,
        "real_time_factor": scenario.duration / seconds,
        "joints": [],
        "faults": [],
    }
    lines = (speed_line(scenario.duration, scenario.duration / seconds),)

    def write(folder: Path, ending: str, tell: Tell) -> list[Path]:
        if not logs:
            tell("the diagram has no VectorLogSink, so that there is nothing to write")
        return [write_log(_columns(log), folder / f"{name}.{ending}") for name, log in logs.items()]

    table = TextTable("", ("logged signal", "min", "max", "last"), rows)
    return Simulated(summary, table, lines, write, lambda: _plot(loop.diagram.get_name(), logs), page=frames)


def _filmed(loop: FunctionLoop, simulator: Simulator, meshcat: Any) -> Callable[[], str]:
    """Look at the plants while the simulator runs, and show them; returns the page of what was seen."""
    systems = _systems(loop.diagram)
    if not any(isinstance(system, MultibodyPlant) for system in systems):
        if meshcat is not None:
            DiagramPictures(loop.diagram, systems)
        return lambda: DiagramPictures(loop.diagram, systems).html([])
    pictures, frames = DiagramPictures(loop.diagram, systems), list[tuple[float, dict[str, Any]]]()
    if meshcat is not None:
        pictures.place(meshcat)

    def look(context: Context) -> None:
        now = context.get_time()
        if not frames or now >= frames[-1][0] + 1.0 / FRAMES_PER_SECOND - 1e-9:
            frames.append((now, pictures.poses(context)))
            if meshcat is not None:
                pictures.show(meshcat, frames[-1][1])

    simulator.set_monitor(look)
    return lambda: pictures.html(frames)


class _Logged(NamedTuple):
    """A log: times (T,) [s], values (T, m), and the names of its columns."""

    time: FloatArray
    values: FloatArray
    names: list[str]


def _plot(title: str, logs: Mapping[str, _Logged]) -> RunPlot:
    """A panel for each logged signal.

    Raises:
        ParamsError: there is none.
    """
    if not logs:
        raise ParamsError("--plot: the diagram has no VectorLogSink, so that there is nothing to draw")
    panels = [
        TimePanel(signal, "-", log.time, {name: log.values[:, i] for i, name in columns}, {})
        for log in logs.values()
        for signal, columns in _by_signal(log)
    ]
    return RunPlot(title, tuple(panels), panels[0].time, {})


def _by_signal(log: _Logged) -> list[tuple[str, list[tuple[int, str]]]]:
    """Signal to the numbers and names of its columns."""
    numbered = enumerate(log.names)
    return [(signal, list(columns)) for signal, columns in groupby(numbered, lambda each: each[1].partition("[")[0])]


def _columns(log: _Logged) -> dict[str, Any]:
    return {"time": log.time, **dict(zip(log.names, log.values.T, strict=True))}
