"""`drake-tc simulate`: run a diagram's scenario; what it comes to on stdout, a log beside it."""

import json
import math
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drake_tc.cli.out_files import Force, result_file, result_folder
from drake_tc.cli.progress import progress_bar
from drake_tc.errors import LogError

if TYPE_CHECKING:
    from drake_tc.loops.simulated import Simulated

PLOTS = (".png", ".svg", ".pdf")
"""Endings of plots."""


def simulate_command(
    diagram: Annotated[
        str,
        typer.Argument(
            help="Diagram name, or module:attribute of your own. An unknown name prints the available diagrams."
        ),
    ],
    scenario_name: Annotated[str | None, typer.Option(help="Scenario; the file's first when left out.")] = None,
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    scenario_text: Annotated[str | None, typer.Option(help="YAML of fields to change: '{gains: {k6: 0.25}}'.")] = None,
    duration: Annotated[float | None, typer.Option(help="Simulated seconds instead of the scenario's.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed instead of the scenario's.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for log.csv, and for rig.yaml where close-loop can read them.")
    ] = None,
    log_format: Annotated[str, typer.Option(help="Format of the log: csv, parquet or npz.")] = "csv",
    meshcat: Annotated[bool, typer.Option(help="Show the robot in a browser while it runs.")] = False,
    plot: Annotated[
        Path | None, typer.Option(help="File for a plot of tracking, torques and flags over time: PNG, SVG or PDF.")
    ] = None,
    show: Annotated[bool, typer.Option("--show", help="Show the same plot in a window.")] = False,
    html: Annotated[
        Path | None, typer.Option(help="File for the robot's motion: one HTML page, which opens without a network.")
    ] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
) -> None:
    """Simulate a diagram: robot, actuators, sensors, estimator and controller, as its scenario says."""
    from drake_tc.registry import runnable

    if log_format not in ("csv", "parquet", "npz"):
        raise typer.BadParameter(f"expected csv, parquet or npz, got {log_format!r}", param_hint="--log-format")
    if plot is not None and plot.suffix.lower() not in PLOTS:
        raise typer.BadParameter(f"expected a file that ends in {', '.join(PLOTS)}, got {plot}", param_hint="--plot")
    if duration is not None and not 0.0 < duration < math.inf:
        raise typer.BadParameter(f"expected a positive number [s], got {duration!r}", param_hint="--duration")
    entry = runnable(diagram).naming(scenario_file, scenario_text)
    if html is not None and entry.kind not in ("torque", "whole_body"):
        raise typer.BadParameter(
            f"expected a diagram with a robot, got {diagram}, which has none to show", param_hint="--html"
        )
    scenario = entry.scenario(scenario_name, scenario_file, scenario_text).changed(duration=duration, seed=seed)
    names = (f"log.{log_format}", "rig.yaml")
    place = (
        nullcontext()
        if out is None
        else result_folder(out, "--out", names=names, inputs=[scenario_file], force=force, error=LogError)
    )
    notes: list[str] = []
    with place as folder, progress_bar(f"simulate {diagram}", quiet=as_json) as progress:
        simulated = entry.simulate(scenario, progress, meshcat)
        written = simulated.write(folder, log_format, notes.append) if folder is not None else []
        files = [str(Path(out or ".") / path.name) for path in written]
    files += _pictures(simulated, plot, html, scenario_file, force=force)
    if show:
        _show(simulated)
    if as_json:
        told = {"diagram": diagram, "seed": scenario.seed, **simulated.summary, "files": files, "notes": notes}
        print(json.dumps(told))
        return
    for note in notes:
        print(f"simulate {diagram}: {note}", file=sys.stderr)
    _print(simulated)
    for file in files:
        print(file)


def _pictures(
    simulated: "Simulated", plot: Path | None, html: Path | None, scenario_file: Path | None, *, force: bool
) -> list[str]:
    """Write the requested plot and page of the motion."""
    from drake_tc.loops.motion import motion_html
    from drake_tc.report.run_plot import run_figure

    if plot is not None:
        with result_file(plot, "--plot", inputs=[scenario_file], force=force) as path:
            run_figure(simulated.plot()).savefig(path, dpi=120, format=plot.suffix.lower().lstrip("."))
    if html is not None and simulated.motion is not None:
        with result_file(html, "--html", inputs=[scenario_file], force=force) as path:
            path.write_text(motion_html(simulated.motion()), encoding="utf-8")
    return [str(path) for path in (plot, html) if path is not None]


def _show(simulated: "Simulated") -> None:
    """The plot in a window, until it is closed."""
    import matplotlib.pyplot as plt

    from drake_tc.report.run_plot import run_figure

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
