"""`drake-tc bode`: the frequency response between two ports, measured by stepped sines, and its linear prediction."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from drake_tc.cli.progress import progress_bar
from drake_tc.errors import DrakeTcError, ParamsError

if TYPE_CHECKING:
    from drake_tc.analysis.frequency_response import FrequencyResponse

LOWEST_DB = -80.0
"""Below this a phase says nothing, and is not printed."""


@dataclass(frozen=True)
class _Found:
    """What was measured and computed; a note where no prediction could be made."""

    measured: "FrequencyResponse"
    predicted: "FrequencyResponse | None"
    note: str


def bode_command(
    diagram: Annotated[str, typer.Argument(help="Name of a diagram; a wrong one lists those there are.")],
    input: Annotated[str, typer.Option(help="SYSTEM:PORT or SYSTEM:PORT[i], cut off from what feeds it.")],
    output: Annotated[str, typer.Option(help="SYSTEM:PORT or SYSTEM:PORT[i].")],
    lowest: Annotated[float, typer.Option("--from", help="Lowest frequency [Hz].")] = 0.5,
    highest: Annotated[float, typer.Option("--to", help="Highest frequency [Hz].")] = 20.0,
    points: Annotated[int, typer.Option(min=1, help="Frequencies, evenly by their logarithm.")] = 10,
    amplitude: Annotated[float, typer.Option(help="Of the sine [unit of the input].")] = 1.0,
    at: Annotated[float, typer.Option(min=0.0, help="Moment of the scenario from which it starts [s].")] = 0.7,
    settle: Annotated[float, typer.Option(min=0.0, help="Before each measurement [s]; two periods at least.")] = 0.5,
    measure: Annotated[float, typer.Option(help="Of each measurement [s]; two periods at least.")] = 1.0,
    prediction: Annotated[bool, typer.Option(help="Also linearise the diagram.")] = True,
    scenario_name: Annotated[str | None, typer.Option(help="Scenario; the file's first when left out.")] = None,
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    scenario_text: Annotated[str | None, typer.Option(help="YAML of fields to change.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed instead of the scenario's.")] = None,
    plot: Annotated[Path | None, typer.Option(help="File for the Bode plot (PNG, SVG or PDF).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Swept-sine Bode table between two ports of a diagram, beside the prediction of its linearisation.

    The input is held where it is at the moment --at, and a sine put on top; the diagram runs as its scenario says, with
    all friction and noise. The prediction takes perfect sensors, and dry friction as a constant.
    """
    from drake_tc.analysis.frequency_response import Sweep
    from drake_tc.diagrams.registry import runnable

    if not 0.0 < lowest <= highest < np.inf:
        raise ParamsError(f"bode: wanted 0 < --from <= --to [Hz]; got {lowest:g} and {highest:g}")
    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ParamsError(f"bode: wanted --plot FILE.png, .svg or .pdf; got {plot}")
    entry = runnable(diagram)
    scenario = entry.scenario(scenario_name, scenario_file, scenario_text).changed(seed=seed)
    frequencies = tuple(np.geomspace(lowest, highest, points).tolist())
    sweep = Sweep(frequencies, amplitude, settle, measure)
    with progress_bar(f"bode {diagram}", quiet=as_json) as progress:
        found = _found(entry, scenario, (input, output), at, sweep, prediction, progress)
    if plot is not None:
        _plot(found, f"{diagram}: {output} over {input}", plot)
    if as_json:
        print(json.dumps({"diagram": diagram, "input": input, "output": output, "at": at, **_to_json(found)}))
        return
    _print(found)
    if plot is not None:
        print(plot)


def _found(
    entry: Any, scenario: Any, ports: tuple[str, str], at: float, sweep: Any, prediction: bool, progress: Any
) -> _Found:
    from drake_tc.analysis.frequency_response import channel, swept_sine
    from drake_tc.diagrams.runs.settled import period_of, settled_at

    channels = (channel(ports[0]), channel(ports[1]))
    loop, context = settled_at(entry, scenario, at, channels)
    measured = swept_sine(loop.diagram, context, period_of(loop), channels, sweep, progress)
    if not prediction:
        return _Found(measured, None, "")
    try:
        with TemporaryDirectory() as folder:
            progress("linearising", 1.0)
            plain = scenario if entry.sliding is None else entry.sliding(scenario, Path(folder))
            return _Found(measured, _predicted(entry, plain, channels, at, measured.frequency_hz), "")
    except DrakeTcError as error:
        return _Found(measured, None, f"no prediction: {error}")


def _predicted(entry: Any, scenario: Any, channels: Any, at: float, frequency_hz: Any) -> "FrequencyResponse":
    from drake_tc.analysis.frequency_response import FrequencyResponse
    from drake_tc.analysis.sampled import linearise
    from drake_tc.diagrams.runs.settled import period_of, settled_at

    loop, context = settled_at(entry, scenario, at, channels)
    into, out = channels
    system = linearise(loop.diagram, context, period_of(loop), inputs=(into.port,), outputs=(out.port,))
    response = system.response(2.0 * np.pi * frequency_hz)[:, out.index, into.index]
    return FrequencyResponse(frequency_hz, response, np.full(frequency_hz.size, np.nan))


def _rows(found: _Found) -> list[dict[str, float | None]]:
    measured, predicted = found.measured, found.predicted
    rows = []
    for i, frequency in enumerate(measured.frequency_hz.tolist()):
        row = {
            "frequency_hz": frequency,
            "magnitude_db": float(measured.magnitude_db[i]),
            "phase_deg": float(np.degrees(measured.phase[i])),
            "distortion": float(measured.distortion[i]) if np.isfinite(measured.distortion[i]) else None,
            "predicted_magnitude_db": None if predicted is None else float(predicted.magnitude_db[i]),
            "predicted_phase_deg": None if predicted is None else float(np.degrees(predicted.phase[i])),
        }
        rows.append(row)
    return rows


def _to_json(found: _Found) -> dict[str, Any]:
    from drake_tc.analysis.frequency_response import bandwidth_hz

    return {"rows": _rows(found), "bandwidth_hz": bandwidth_hz(found.measured), "note": found.note}


def _print(found: _Found) -> None:
    console = Console(file=sys.stdout, highlight=False)
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    names = ("frequency [Hz]", "|H| [dB]", "phase [deg]", "distortion", "linear: |H| [dB]", "phase [deg]")
    for name in names:
        table.add_column(escape(name), justify="right")
    for row in _rows(found):
        values = list(row.values())
        silent = values[1] is not None and values[1] < LOWEST_DB
        cells = [f"{values[0]:.3f}", f"{values[1]:.2f}", "-" if silent else f"{values[2]:.1f}"]
        cells += [
            "-" if value is None else f"{value:{digits}}"
            for value, digits in zip(values[3:], (".3f", ".2f", ".1f"), strict=True)
        ]
        table.add_row(*cells)
    console.print(table)
    if found.note:
        print(f"bode: {found.note}", file=sys.stderr)


def _plot(found: _Found, title: str, path: Path) -> None:
    """Magnitude and phase, measured as dots, predicted as lines.

    Raises:
        ParamsError: a file that cannot be written.
    """
    from matplotlib.figure import Figure

    from drake_tc.report.bode_plot import draw_bode

    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    curves = {"measured": found.measured} | ({} if found.predicted is None else {"linear": found.predicted})
    draw_bode(figure, {name: (c.frequency_hz, c.response) for name, c in curves.items()}, title)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=120)
    except OSError as error:
        raise ParamsError(f"{path}: cannot be written: {error.strerror or error}") from None
