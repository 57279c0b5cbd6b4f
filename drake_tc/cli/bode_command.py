"""`drake-tc bode`: the frequency response between two ports, measured by stepped sines, and its linear prediction."""

import json
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from drake_tc.cli.out_files import Force, result_file
from drake_tc.cli.terminal import print_wide, progress_bar
from drake_tc.cli.usage import LARGEST_SEED
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.cli.bode_measurement import BodeMeasurement

LOWEST_DB = -80.0
"""Below this a phase says nothing, and is not printed."""


def bode_command(
    diagram: Annotated[
        str,
        typer.Argument(
            help="Diagram name, or module:attribute of your own. An unknown name prints the available diagrams."
        ),
    ],
    input: Annotated[str, typer.Option(help="SYSTEM:PORT or SYSTEM:PORT[i]. It is disconnected from its source.")],
    output: Annotated[str, typer.Option(help="SYSTEM:PORT or SYSTEM:PORT[i].")],
    lowest: Annotated[float, typer.Option("--from", help="Lowest frequency [Hz].")] = 0.5,
    highest: Annotated[float, typer.Option("--to", help="Highest frequency [Hz].")] = 20.0,
    points: Annotated[
        int, typer.Option(min=1, help="Number of frequencies, evenly spaced on a logarithmic scale.")
    ] = 10,
    amplitude: Annotated[float, typer.Option(help="Amplitude of the sine [unit of the input].")] = 1.0,
    at: Annotated[float, typer.Option(min=0.0, help="Time in the scenario at which the sweep starts [s].")] = 0.7,
    settle: Annotated[
        float, typer.Option(min=0.0, help="Settling time before each measurement [s]; at least two periods.")
    ] = 0.5,
    measure: Annotated[float, typer.Option(help="Duration of each measurement [s]; at least two periods.")] = 1.0,
    prediction: Annotated[bool, typer.Option(help="Also compute the response of the linearised diagram.")] = True,
    scenario_name: Annotated[str | None, typer.Option(help="Scenario; the file's first when left out.")] = None,
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    scenario_text: Annotated[str | None, typer.Option(help="YAML of fields to change.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, max=LARGEST_SEED, help="Seed instead of the scenario's.")] = None,
    plot: Annotated[Path | None, typer.Option(help="File for the Bode plot (PNG, SVG or PDF).")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Measure a Bode table between two ports of a diagram by sines, beside the prediction of its linearisation.

    The input is held at its value at the time --at, and a sine is added. The diagram runs as its scenario says, with
    all friction and noise. The prediction assumes perfect sensors and constant dry friction. It also determines how
    often a phase exceeds 360 degrees; without it, phases are in (-180, 180]. Notes name frequencies without a steady
    response, and unstable loops.
    """
    from drake_tc.analysis.frequency_response import Sweep, channel
    from drake_tc.cli.bode_measurement import BodeRequest, measure_bode
    from drake_tc.registry import runnable

    if not 0.0 < lowest <= highest < np.inf:
        raise ParamsError(f"bode: expected 0 < --from <= --to [Hz], got {lowest:g} and {highest:g}")
    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ParamsError(f"bode: expected --plot FILE.png, .svg or .pdf, got {plot}")
    entry = runnable(diagram).naming(scenario_file, scenario_text)
    scenario = entry.scenario(scenario_name, scenario_file, scenario_text).changed(seed=seed)
    sweep = Sweep(tuple(np.geomspace(lowest, highest, points).tolist()), amplitude, settle, measure)
    request = BodeRequest(entry, scenario, (channel(input), channel(output)), at, sweep, prediction)
    place = nullcontext() if plot is None else result_file(plot, "--plot", inputs=[scenario_file], force=force)
    with place as drawn, progress_bar(f"bode {diagram}", quiet=as_json) as progress:
        found = measure_bode(request, progress)
        if drawn is not None:
            _plot(found, f"{diagram}: {output} over {input}", drawn)
    if as_json:
        print(json.dumps({"diagram": diagram, "input": input, "output": output, "at": at, **found.to_json()}))
    else:
        _print(found)
    for note in found.notes:
        print(f"bode: {note}", file=sys.stderr)
    if plot is not None and not as_json:
        print(plot)


def _print(found: "BodeMeasurement") -> None:
    document = found.to_json()
    phase = "phase modulo 360 [deg]" if document["phase_modulo_360"] else "phase [deg]"
    headings = ("frequency [Hz]", "|H| [dB]", phase, "distortion", "linear: |H| [dB]", "linear: phase [deg]")
    print_wide(headings, [_cells(row) for row in document["rows"]])
    if (width := document["bandwidth_hz"]) is not None:
        sign = "at least " if document["bandwidth_is_at_least"] else ""
        print(f"-3 dB bandwidth: {sign}{width:.3g} Hz")


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    """A row as text; a phase that says nothing, and what is not there, is a dash."""
    silent = row["magnitude_db"] is None or row["magnitude_db"] < LOWEST_DB
    values = list(row.values())
    values[2] = None if silent else values[2]
    return tuple(
        "-" if value is None else f"{value:{digits}}"
        for value, digits in zip(values[:6], (".3f", ".2f", ".1f", ".3f", ".2f", ".1f"), strict=True)
    )


def _plot(found: "BodeMeasurement", title: str, path: Path) -> None:
    """Magnitude and phase, measured as dots, predicted as lines."""
    from matplotlib.figure import Figure

    from drake_tc.report.plots.run_plot import draw_bode

    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    curves = {"measured": found.measured} | ({} if found.predicted is None else {"linear": found.predicted})
    draw_bode(figure, curves, title)
    figure.savefig(path, dpi=120)
