"""`drake-tc graph`: the block graph of a diagram as SVG, DOT, Mermaid or JSON."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.cli.out_files import Force, print_or_write
from drake_tc.cli.seed_option import UnusedSeed
from drake_tc.errors import ParamsError


class GraphFormat(StrEnum):
    """What to write."""

    svg = "svg"
    dot = "dot"
    mermaid = "mermaid"
    json = "json"


SHORT = 1.0
"""A diagram does not depend on how long it runs, but tables of its references take time to make [s]."""


def graph_command(
    diagram: Annotated[
        str,
        typer.Argument(
            help="Diagram name, or module:function of your own. An unknown name prints the available diagrams."
        ),
    ],
    format: Annotated[GraphFormat, typer.Option(help="What to write.")] = GraphFormat.svg,
    out: Annotated[Path | None, typer.Option(help="File to write; stdout when left out.")] = None,
    scenario: Annotated[str | None, typer.Option(help="Scenario to build; the diagram's first when left out.")] = None,
    scenario_file: Annotated[Path | None, typer.Option(help="File of scenarios (YAML) in place of its own.")] = None,
    depth: Annotated[int, typer.Option(min=0, help="Levels of nested diagrams to open; 0 opens all.")] = 1,
    everything: Annotated[
        bool, typer.Option("--all", help="Show logs, systems that only logs read, and unconnected ports too.")
    ] = False,
    stage: Annotated[
        list[str] | None, typer.Option(help="BLOCK=STAGE: put a block into another stage; repeat.")
    ] = None,
    force: Force = False,
    seed: UnusedSeed = 0,
    as_json: Annotated[bool, typer.Option("--json", help="The same as --format json.")] = False,
) -> None:
    """Draw a diagram with its blocks by stage, named ports, widths of signals, discrete periods and feedthrough.

    Pictures leave out logs, systems that only logs read, and unconnected ports, unless --all is given. JSON has all.
    """
    from drake_tc.registry import runnable
    from drake_tc.report.block_graph.graph import block_graph

    entry = runnable(diagram).naming(scenario_file, None)
    chosen = entry.scenario(scenario, scenario_file)
    loop = entry.build(chosen.changed(duration=min(chosen.duration, SHORT)))
    graph = block_graph(loop.diagram, _stages(stage or []), depth or None)
    texts = {
        GraphFormat.json: graph.to_json,
        GraphFormat.dot: lambda: graph.to_dot(everything=everything),
        GraphFormat.mermaid: lambda: graph.to_mermaid(everything=everything),
        GraphFormat.svg: lambda: graph.to_svg(everything=everything),
    }
    print_or_write(texts[GraphFormat.json if as_json else format], out, [scenario_file], force=force)


def _stages(chosen: list[str]) -> dict[str, str]:
    stages = {}
    for entry in chosen:
        block, equals, stage = entry.rpartition("=")
        if not (block and equals and stage):
            raise ParamsError(f"graph: expected --stage BLOCK=STAGE, got {entry!r}")
        stages[block] = stage
    return stages
