"""`drake-tc bode`: the frequency response between two ports, measured by stepped sines, and its linear prediction."""

import json
import math
import sys
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drake_tc.cli.options import Diagram, Force, ScenarioChoice, ScenarioSeed
from drake_tc.cli.out_files import result_file
from drake_tc.cli.terminal import print_wide, progress_bar
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.analysis.frequency_response import Channel, Sweep
    from drake_tc.cli.bode_measurement import BodeMeasurement

LOWEST_DB = -80.0
"""Below this a phase says nothing, and is not printed."""


@dataclass(frozen=True, kw_only=True)
class SteppedSine:
    """Between which ports the response is measured, and by which sines."""

    input: Annotated[str, typer.Option(help="SYSTEM:PORT or SYSTEM:PORT[i]. It is disconnected from its source.")]
    output: Annotated[str, typer.Option(help="SYSTEM:PORT or SYSTEM:PORT[i].")]
    lowest: Annotated[float, typer.Option("--from", help="Lowest frequency [Hz].")] = 0.5
    highest: Annotated[float, typer.Option("--to", help="Highest frequency [Hz].")] = 20.0
    points: Annotated[int, typer.Option(min=1, help="Number of frequencies, evenly spaced on a logarithmic scale.")] = (
        10
    )
    amplitude: Annotated[float, typer.Option(help="Amplitude of the sine [unit of the input].")] = 1.0
    at: Annotated[float, typer.Option(min=0.0, help="Time in the scenario at which the sweep starts [s].")] = 0.7
    settle: Annotated[
        float, typer.Option(min=0.0, help="Settling time before each measurement [s]; at least two periods.")
    ] = 0.5
    measure: Annotated[float, typer.Option(help="Duration of each measurement [s]; at least two periods.")] = 1.0

    def ports(self) -> "tuple[Channel, Channel]":
        """Input and output.

        Raises:
            ParamsError: an index that is no whole number.
        """
        from drake_tc.analysis.frequency_response import channel

        return channel(self.input), channel(self.output)

    def sweep(self) -> "Sweep":
        """Frequencies, amplitude and times.

        Raises:
            ParamsError: frequencies out of order.
        """
        import numpy as np

        from drake_tc.analysis.frequency_response import Sweep

        low, high = self.lowest, self.highest
        if not 0.0 < low <= high < math.inf:
            raise ParamsError(f"bode: expected 0 < --from <= --to [Hz], got {low:g} and {high:g}")
        frequencies = np.geomspace(low, high, self.points).tolist()
        return Sweep(tuple(frequencies), self.amplitude, self.settle, self.measure)


@dataclass(frozen=True, kw_only=True)
class BodeScenario(ScenarioChoice):
    """A scenario, whose help shows no example of changes."""

    scenario_text: Annotated[str | None, typer.Option(help="YAML of fields to change.")] = None


@dataclass(frozen=True, kw_only=True)
class BodeOptions:
    """Options of `drake-tc bode`."""

    diagram: Diagram
    sine: SteppedSine
    prediction: Annotated[bool, typer.Option(help="Also compute the response of the linearised diagram.")] = True
    scenario: BodeScenario
    seed: ScenarioSeed = None
    plot: Annotated[Path | None, typer.Option(help="File for the Bode plot (PNG, SVG or PDF).")] = None
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False


def bode_command(options: BodeOptions) -> None:
    """Measure a Bode table between two ports of a diagram by sines, beside the prediction of its linearisation.

    The input is held at its value at the time --at, and a sine is added. The diagram runs as its scenario says, with
    all friction and noise. The prediction assumes perfect sensors and constant dry friction. It also determines how
    often a phase exceeds 360 degrees; without it, phases are in (-180, 180]. Notes name frequencies without a steady
    response, and unstable loops.
    """
    from drake_tc.cli.bode_measurement import measure_bode

    diagram, sine, plot = options.diagram, options.sine, options.plot
    sine.sweep()  # frequencies out of order are told before a diagram is built
    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ParamsError(f"bode: expected --plot FILE.png, .svg or .pdf, got {plot}")
    entry = options.scenario.entry(diagram)
    scenario = options.scenario.of(entry).changed(seed=options.seed)
    inputs = [options.scenario.scenario_file]
    place = nullcontext() if plot is None else result_file(plot, "--plot", inputs=inputs, force=options.force)
    with place as drawn, progress_bar(f"bode {diagram}", quiet=options.as_json) as progress:
        found = measure_bode(entry, scenario, sine, progress, predict=options.prediction)
        if drawn is not None:
            _plot(found, f"{diagram}: {sine.output} over {sine.input}", drawn)
    if options.as_json:
        what = {"diagram": diagram, "input": sine.input, "output": sine.output, "at": sine.at}
        print(json.dumps({**what, **found.to_json()}))
    else:
        _print(found)
    for note in found.notes:
        print(f"bode: {note}", file=sys.stderr)
    if plot is not None and not options.as_json:
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
