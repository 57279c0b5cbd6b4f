"""`drake-tc stability-map`: stability of one joint's loop over any two of its parameters."""

import json
import os
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.cli.out_files import Force, result_file
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed
from drake_tc.cli.workers import worker_executor
from drake_tc.errors import ParamsError


def stability_map_command(
    diagram: Annotated[
        str,
        typer.Argument(
            help="Diagram name, or module:attribute of your own. An unknown name prints the available diagrams."
        ),
    ],
    joint: Annotated[
        str, typer.Option(help="Joint that is mapped; the others are held still. An unknown name prints the joints.")
    ],
    x: Annotated[str, typer.Option(help="NAME=FIRST:LAST:STEP or NAME=A,B,C, such as window=20:160:20.")],
    y: Annotated[
        str, typer.Option(help="Second parameter, such as kp=0:4:0.2. An unknown NAME prints the available ones.")
    ],
    figure: Annotated[
        str, typer.Option(help="spectral_radius, sensitivity_peak, gain_margin, phase_margin or delay_margin.")
    ] = "spectral_radius",
    scenario_name: Annotated[str | None, typer.Option(help="Scenario; the file's first when left out.")] = None,
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None,
    scenario_text: Annotated[str | None, typer.Option(help="YAML of fields to change: '{gains: {k6: 0.25}}'.")] = None,
    kf: Annotated[float | None, typer.Option(help="Force feedback gain instead of the scenario's.")] = None,
    environment_stiffness: Annotated[
        float, typer.Option(min=0.0, help="Stiffness of the environment at the joint [N m/rad].")
    ] = 0.0,
    workers: Annotated[int, typer.Option(min=1, help="Number of processes on this machine.")] = os.cpu_count() or 1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead.")] = None,
    out: Annotated[Path | None, typer.Option(help="File for the plot, .svg or .png.")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the map as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """Map the stability of one joint over two parameters.

    All other parameters are those of the scenario. K6 and K7 stay when Kp changes.
    """
    from drake_tc.analysis.stability_map import Axis, draw_map, stability_map
    from drake_tc.analysis.torque_loop.joint_loops import joint_loops
    from drake_tc.registry import diagram_entry

    across, up = Axis.parse(x), Axis.parse(y)
    scenario = diagram_entry(diagram).scenario(scenario_name, scenario_file, scenario_text)
    loops = joint_loops(scenario)
    if joint not in loops:
        raise ParamsError(f"no joint {joint!r}; joints: {', '.join(loops)}")
    loop = replace(loops[joint], kf=loops[joint].kf if kf is None else kf, environment_stiffness=environment_stiffness)
    if out is not None and out.suffix.lower() not in (".svg", ".png", ".pdf"):
        raise ParamsError(f"stability-map: expected --out FILE.svg, .png or .pdf, got {out}")
    place = nullcontext() if out is None else result_file(out, "--out", inputs=[scenario_file], force=force)
    with (
        place as file,
        progress_bar("stability-map", quiet=as_json) as progress,
        worker_executor(workers, scheduler) as executor,
    ):
        found = stability_map(loop, across, up, figure, executor=executor, progress=progress)  # type: ignore[arg-type]
        if file is not None:
            from matplotlib.figure import Figure

            drawn = Figure(figsize=(8.0, 5.5), layout="constrained")
            draw_map(drawn, found)
            drawn.savefig(file, dpi=120)
    if as_json:
        print(json.dumps({"diagram": diagram, "joint": joint, **found.to_json(), "files": [str(out)] if out else []}))
        return
    print(
        f"{joint}: {found.stable.mean():.1%} of {found.stable.size} points over {across.name} and {up.name} are stable"
    )
    for row in found.failed[:3]:
        print(f"not computed: {row}")
    if out:
        print(out)
