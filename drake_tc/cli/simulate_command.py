"""`drake-tc simulate`: run a diagram's scenario; tracking and faults on stdout, a log that `close-loop` reads."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drake_tc.cli.progress import progress_bar
from drake_tc.errors import LogError


def simulate_command(
    diagram: Annotated[str, typer.Argument(help="Name of a diagram; a wrong one lists those there are.")],
    scenario_name: Annotated[str | None, typer.Option(help="Scenario; the file's first when left out.")] = None,
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    scenario_text: Annotated[str | None, typer.Option(help="YAML of fields to change: '{gains: {k6: 0.25}}'.")] = None,
    duration: Annotated[float | None, typer.Option(help="Simulated seconds instead of the scenario's.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed instead of the scenario's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for log.csv and rig.yaml, which close-loop reads.")] = None,
    log_format: Annotated[str, typer.Option(help="csv, parquet or npz.")] = "csv",
    meshcat: Annotated[bool, typer.Option(help="Show the robot in a browser while it runs.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
) -> None:
    """Simulate a diagram: robot, actuators, sensors, estimator and controller, as its scenario says."""
    from drake_tc.diagrams.registry import diagram_entry
    from drake_tc.diagrams.runs.running import simulate_scenario
    from drake_tc.diagrams.runs.summary import summarise, write_results

    if log_format not in ("csv", "parquet", "npz"):
        raise typer.BadParameter(f"wanted csv, parquet or npz, got {log_format!r}", param_hint="--log-format")
    entry = diagram_entry(diagram)
    scenario = entry.scenario(scenario_name, scenario_file, scenario_text).changed(duration=duration, seed=seed)
    if out:
        _make(out)
    notes: list[str] = []
    with progress_bar(f"simulate {diagram}", quiet=as_json) as progress:
        recording = simulate_scenario(scenario, progress, meshcat=meshcat)
        files = write_results(recording, out, log_format, notes.append) if out else []
    summary = summarise(recording)
    if as_json:
        written = [str(file) for file in files]
        print(json.dumps({"diagram": diagram, "seed": scenario.seed, **summary, "files": written, "notes": notes}))
        return
    for note in notes:
        print(f"simulate {diagram}: {note}", file=sys.stderr)
    _print(summary)
    for file in files:
        print(file)


def _make(folder: Path) -> None:
    """Make the folder before the simulation, which may take long.

    Raises:
        LogError: a folder that cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{folder}: wanted a folder for the log; {error.strerror or error}") from None


def _print(summary: dict[str, Any]) -> None:
    console = Console(file=sys.stdout, highlight=False)
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    table.add_column("joint", no_wrap=True)
    for heading in ("rms error [mrad]", "max error [mrad]", "max torque [N m]"):
        table.add_column(escape(heading), justify="right", min_width=7)
    for row in summary["joints"]:
        numbers = (f"{1e3 * row['rms_error']:.3f}", f"{1e3 * row['max_error']:.2f}", f"{row['max_torque']:.1f}")
        table.add_row(row["joint"], *numbers)
    console.print(table)
    console.print(f"{summary['duration']:g} s simulated at {summary['real_time_factor']:.1f} x real time")
    for fault in summary["faults"]:
        console.print(f"fault: {escape(fault['name'])} from {fault['first']:.3f} s")
