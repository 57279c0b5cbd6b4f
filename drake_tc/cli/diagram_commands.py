"""`drake-tc simulate` and `drake-tc graph`.

`drake-tc simulate`: run a diagram's scenario; what it comes to on stdout, a log beside it.

`drake-tc graph`: the block graph of a diagram as SVG, DOT, Mermaid or JSON.
"""

import json
import math
import sys
from contextlib import nullcontext
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drake_tc.cli.options import Diagram, Force, ScenarioChoice, ScenarioSeed, UnusedSeed
from drake_tc.cli.out_files import print_or_write, result_file, result_folder
from drake_tc.cli.terminal import progress_bar
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.loops.simulated import Simulated

PLOTS = (".png", ".svg", ".pdf")
"""Endings of plots."""


@dataclass(frozen=True, kw_only=True)
class SimulateOptions:
    """Options of `drake-tc simulate`."""

    diagram: Diagram
    scenario: ScenarioChoice
    duration: Annotated[float | None, typer.Option(help="Simulated seconds instead of the scenario's.")] = None
    seed: ScenarioSeed = None
    out: Annotated[
        Path | None, typer.Option(help="Folder for log.csv, and for rig.yaml where close-loop can read them.")
    ] = None
    log_format: Annotated[str, typer.Option(help="Format of the log: csv, parquet or npz.")] = "csv"
    meshcat: Annotated[bool, typer.Option(help="Show the robot in a browser while it runs.")] = False
    plot: Annotated[
        Path | None, typer.Option(help="File for a plot of tracking, torques and flags over time: PNG, SVG or PDF.")
    ] = None
    show: Annotated[bool, typer.Option("--show", help="Show the same plot in a window.")] = False
    html: Annotated[
        Path | None, typer.Option(help="File for the robot's motion: one HTML page, which opens without a network.")
    ] = None
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False


def simulate_command(options: SimulateOptions) -> None:
    """Simulate a diagram: robot, actuators, sensors, estimator and controller, as its scenario says."""
    diagram, duration, out = options.diagram, options.duration, options.out
    log_format, plot = options.log_format, options.plot
    if log_format not in ("csv", "parquet", "npz"):
        raise typer.BadParameter(f"expected csv, parquet or npz, got {log_format!r}", param_hint="--log-format")
    if plot is not None and plot.suffix.lower() not in PLOTS:
        raise typer.BadParameter(f"expected a file that ends in {', '.join(PLOTS)}, got {plot}", param_hint="--plot")
    if duration is not None and not 0.0 < duration < math.inf:
        raise typer.BadParameter(f"expected a positive number [s], got {duration!r}", param_hint="--duration")
    entry = options.scenario.entry(diagram)
    if options.html is not None and entry.kind == "series_elastic":
        raise typer.BadParameter(
            f"expected a diagram with a robot, got {diagram}, which has none to show", param_hint="--html"
        )
    scenario = options.scenario.of(entry).changed(duration=duration, seed=options.seed)
    names, inputs = (f"log.{log_format}", "rig.yaml"), [options.scenario.scenario_file]
    place = (
        nullcontext() if out is None else result_folder(out, "--out", names=names, inputs=inputs, force=options.force)
    )
    notes: list[str] = []
    with place as folder, progress_bar(f"simulate {diagram}", quiet=options.as_json) as progress:
        simulated = entry.simulate(scenario, progress, options.meshcat)
        written = simulated.write(folder, log_format, notes.append) if folder is not None else []
        files = [str(Path(out or ".") / path.name) for path in written]
    notes += simulated.motion().robot.unused if simulated.motion is not None else ()
    files += _pictures(simulated, options)
    if options.show:
        _show(simulated)
    if options.as_json:
        told = {"diagram": diagram, "seed": scenario.seed, **simulated.summary, "files": files, "notes": notes}
        print(json.dumps(told))
        return
    for note in notes:
        print(f"simulate {diagram}: {note}", file=sys.stderr)
    _print(simulated)
    for file in files:
        print(file)


def _pictures(simulated: "Simulated", options: SimulateOptions) -> list[str]:
    """Write the requested plot and page of the motion."""
    from drake_tc.report.plots.run_plot import run_figure

    plot, html, inputs = options.plot, options.html, [options.scenario.scenario_file]
    if plot is not None:
        with result_file(plot, "--plot", inputs=inputs, force=options.force) as path:
            run_figure(simulated.plot()).savefig(path, dpi=120, format=plot.suffix.lower().lstrip("."))
    if html is not None and simulated.page is not None:
        with result_file(html, "--html", inputs=inputs, force=options.force) as path:
            path.write_text(simulated.page(), encoding="utf-8")
    return [str(path) for path in (plot, html) if path is not None]


def _show(simulated: "Simulated") -> None:
    """The plot in a window, until it is closed."""
    import matplotlib.pyplot as plt

    from drake_tc.report.plots.run_plot import run_figure

    run_figure(simulated.plot(), plt.figure())
    plt.show()


def _print(simulated: "Simulated") -> None:
    console = Console(file=sys.stdout, highlight=False)
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    name, *numbers = simulated.table.headings
    table.add_column(escape(name), no_wrap=True)
    for heading in numbers:
        table.add_column(escape(heading), justify="right", min_width=7)
    for row in simulated.table.rows:
        table.add_row(*row)
    console.print(table)
    for line in simulated.lines:
        console.print(escape(line))


class GraphFormat(StrEnum):
    """What to write."""

    svg = "svg"
    dot = "dot"
    mermaid = "mermaid"
    json = "json"


SHORT = 1.0
"""A diagram does not depend on how long it runs, but tables of its references take time to make [s]."""


@dataclass(frozen=True, kw_only=True)
class GraphOptions:
    """Options of `drake-tc graph`."""

    diagram: Annotated[
        str,
        typer.Argument(
            help="Diagram name, or module:function of your own. An unknown name prints the available diagrams."
        ),
    ]
    format: Annotated[GraphFormat, typer.Option(help="What to write.")] = GraphFormat.svg
    out: Annotated[Path | None, typer.Option(help="File to write; stdout when left out.")] = None
    scenario: Annotated[str | None, typer.Option(help="Scenario to build; the diagram's first when left out.")] = None
    scenario_file: Annotated[Path | None, typer.Option(help="File of scenarios (YAML) in place of its own.")] = None
    depth: Annotated[int, typer.Option(min=0, help="Levels of nested diagrams to open; 0 opens all.")] = 1
    everything: Annotated[
        bool, typer.Option("--all", help="Show logs, systems that only logs read, and unconnected ports too.")
    ] = False
    stage: Annotated[list[str] | None, typer.Option(help="BLOCK=STAGE: put a block into another stage; repeat.")] = None
    force: Force = False
    seed: UnusedSeed = 0
    as_json: Annotated[bool, typer.Option("--json", help="The same as --format json.")] = False


def graph_command(options: GraphOptions) -> None:
    """Draw a diagram with its blocks by stage, named ports, widths of signals, discrete periods and feedthrough.

    Pictures leave out logs, systems that only logs read, and unconnected ports, unless --all is given. JSON has all.
    """
    from drake_tc.registry import runnable
    from drake_tc.report.block_graph.graph import block_graph

    file, everything = options.scenario_file, options.everything
    entry = runnable(options.diagram).naming(file, None)
    chosen = entry.scenario(options.scenario, file)
    loop = entry.build(chosen.changed(duration=min(chosen.duration, SHORT)))
    graph = block_graph(loop.diagram, _stages(options.stage or []), options.depth or None)
    texts = {
        GraphFormat.json: graph.to_json,
        GraphFormat.dot: lambda: graph.to_dot(everything=everything),
        GraphFormat.mermaid: lambda: graph.to_mermaid(everything=everything),
        GraphFormat.svg: lambda: graph.to_svg(everything=everything),
    }
    text = texts[GraphFormat.json if options.as_json else options.format]
    print_or_write(text, options.out, [file], force=options.force)


def _stages(chosen: list[str]) -> dict[str, str]:
    stages = {}
    for entry in chosen:
        block, equals, stage = entry.rpartition("=")
        if not (block and equals and stage):
            raise ParamsError(f"graph: expected --stage BLOCK=STAGE, got {entry!r}")
        stages[block] = stage
    return stages
