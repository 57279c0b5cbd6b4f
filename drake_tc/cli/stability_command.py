"""`drake-tc stability` and `drake-tc stability-map`.

`drake-tc stability`: a diagram's loop linearised, its margins, and its verdict held against time simulation.

`drake-tc stability-map`: stability of one joint's loop over any two of its parameters.
"""

import json
import math
import sys
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.cli.options import LARGEST_SEED, Diagram, Force, ScenarioChoice, UnusedSeed, Workers
from drake_tc.cli.out_files import result_file
from drake_tc.cli.terminal import progress_bar
from drake_tc.config.quoted import json_value
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.analysis.release import Release
    from drake_tc.analysis.sampled import SampledSystem
    from drake_tc.control.stability_margins import Margins
    from drake_tc.loops.entries import DiagramEntry

SHOWN = 8
"""Eigenvalues that are printed."""
KICK = 1e-3
"""Of every joint's speed, in the simulation that checks the verdict [rad/s]."""


@dataclass(frozen=True)
class _Found:
    """What was computed; `channel` is the one that was asked for."""

    system: "SampledSystem"
    channel: str
    channels: "Mapping[str, Margins]"
    release: "Release"
    radius: float

    @property
    def margins(self) -> "Margins | None":
        return self.channels.get(self.channel)

    @property
    def verdict(self) -> str:
        return "stable" if self.radius < 1.0 else "unstable"

    @property
    def agrees(self) -> bool:
        return (self.radius < 1.0) == self.release.stable


@dataclass(frozen=True, kw_only=True)
class LoopCut:
    """Where the loop is cut open."""

    open_at: Annotated[str, typer.Option(help="SYSTEM:PORT or SYSTEM:PORT[i] where the loop is cut.")] = (
        "torque_control:command"
    )
    relative_to: Annotated[
        str | None,
        typer.Option(help="SYSTEM:PORT that is taken off there: torque_control:position cuts the effort of servos."),
    ] = None
    joint: Annotated[
        str | None, typer.Option(help="Joint whose channel is cut, or its number from 0; the first when left out.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class StabilityOptions:
    """Options of `drake-tc stability`."""

    diagram: Diagram
    scenario: ScenarioChoice
    cut: LoopCut
    at: Annotated[float, typer.Option(min=0.0, help="Time in the scenario at which the loop is linearised [s].")] = 0.7
    friction: Annotated[
        str,
        typer.Option(
            help="sliding: joints move, dry friction is constant; modelled: friction and dead zone of the drives."
        ),
    ] = "sliding"
    direction: Annotated[
        float, typer.Option(min=-1.0, max=1.0, help="Direction of the sliding: 1, -1, or 0 for the mean of both.")
    ] = 0.0
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the signs of the initial kick, joint by joint.")
    ] = 0
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False


def stability_command(options: StabilityOptions) -> None:
    """Print eigenvalues, margins and stability of a diagram's loop at one time of a scenario, with perfect sensors."""
    from drake_tc.analysis.release import settled_at
    from drake_tc.analysis.sampled import loop_margins
    from drake_tc.control.stability_margins import frequency_grid
    from drake_tc.loops.entries import naming_errors

    diagram, friction, file = options.diagram, options.friction, options.scenario.scenario_file
    if friction not in ("sliding", "modelled"):
        raise typer.BadParameter(f"expected sliding or modelled, got {friction!r}", param_hint="--friction")
    entry = options.scenario.entry(diagram)
    if entry.kind == "whole_body":
        raise ParamsError(
            f"stability: expected a diagram without contacts, got {diagram}, which stands on contacts: its"
            " linearisation does not decide its stability; simulate it instead"
        )
    scenario = options.scenario.of(entry)
    with progress_bar(f"stability {diagram}", quiet=options.as_json) as progress, TemporaryDirectory() as folder:
        if friction == "sliding":
            with naming_errors(f"stability {diagram}" if file is None else str(file)):
                scenario = _in_sliding(entry, scenario, Path(folder), options.direction)
        if entry.kind == "torque":
            scenario = replace(scenario, sensors="perfect")
        with naming_errors(f"stability {diagram}"):
            progress("to the operating point", 0.0)
            loop, context = settled_at(entry, scenario, options.at)
            progress("linearising", 0.15)
            cut, channel = _cut(loop, context, options.cut)
            progress("eigenvalues", 0.6)
            closed = cut.closed()
            radius = closed.radius_but_for_drift()
            progress("margins", 0.7)
            grid = frequency_grid(loop.period, 0.5, 400)
            channels = loop_margins(cut, grid=grid) if radius < 1.0 else {}
            progress("simulating the verdict", 0.8)
            found = _Found(closed, channel, channels, _released(loop, context, options.seed), radius)
            progress("done", 1.0)
    relative_to = options.cut.relative_to
    if options.as_json:
        where = {"diagram": diagram, "at": options.at, "friction": friction}
        where |= {"open_at": channel, "relative_to": relative_to}
        print(json.dumps({**where, **_to_json(found)}))
        return
    _print(found, channel if relative_to is None else f"{channel} relative to {relative_to}")


def _in_sliding(entry: "DiagramEntry[Any, Any]", scenario: Any, folder: Path, direction: float) -> Any:
    """The scenario as a linear analysis takes it.

    Raises:
        ParamsError: a direction, where the drives of the diagram cannot be told to slide in one.
    """
    if entry.kind == "torque":
        from drake_tc.loops.torque.stages import sliding_scenario

        return sliding_scenario(scenario, folder, direction)
    if direction != 0.0:
        raise ParamsError(f"--direction: expected 0 for {entry.name}; only a torque loop's drives have a direction")
    return scenario if entry.sliding is None else entry.sliding(scenario, folder)


def _cut(loop: Any, context: Any, where: LoopCut) -> "tuple[SampledSystem, str]":
    """The loop cut open at a port, and the name of the channel that is asked for.

    Raises:
        ParamsError: no such joint or channel, or a joint and an index.
    """
    from drake_tc.analysis.frequency_response import channel
    from drake_tc.analysis.sampled import open_loop

    place = _channel(loop, where.joint)
    requested = channel(where.open_at)
    if where.joint is not None and where.open_at != requested.port:
        raise ParamsError(
            f"--joint: expected --open-at without an index, got {where.open_at}; give --joint or an index, not both"
        )
    cut = open_loop(loop.diagram, context, loop.period, requested.port, relative_to=where.relative_to)
    index = requested.index if where.joint is None else place
    if index >= len(cut.inputs):
        which = f"element {index}" if where.joint is None else f"joint {where.joint!r}"
        raise ParamsError(f"--open-at: {requested.port} has {len(cut.inputs)} channels, none of {which}")
    return cut, cut.inputs[index]


def _released(loop: Any, context: Any, seed: int) -> "Release":
    """The loop after a kick of every joint's speed, to either side at random."""
    import numpy as np

    from drake_tc.analysis.release import release, speed_states

    kicked = speed_states(loop, context)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=len(kicked))
    kick = {state: KICK * float(sign) for state, sign in zip(kicked, signs, strict=True)}
    return release(loop.diagram, context, loop.period, kick, 1.0)


def _channel(loop: Any, joint: str | None) -> int:
    """Which channel of the cut port is meant.

    Raises:
        ParamsError: a joint that is not there, or no number where the diagram names no joints.
    """
    joints = loop.robot.joints if hasattr(loop, "robot") else getattr(loop, "joints", ())
    if joint is None:
        return 0
    if joint in joints:
        return int(joints.index(joint))
    if joint.isdecimal():
        return int(joint)
    known = f"joints: {', '.join(joints)}" if joints else "the diagram names none; expected a number from 0"
    raise ParamsError(f"--joint: no joint {joint!r}; {known}")


def _to_json(found: _Found) -> dict[str, Any]:
    largest = found.system.moving()[:SHOWN]
    return {
        "states": len(found.system.states),
        "eigenvalues": [[float(value.real), float(value.imag)] for value in largest],
        "spectral_radius": found.system.spectral_radius,
        "spectral_radius_but_for_drift": found.radius,
        "margins": None if found.margins is None else json_value(vars(found.margins)),
        "channels": {name: json_value(vars(each)) for name, each in found.channels.items()},
        "kinks": list(found.system.kinks),
        "verdict": found.verdict,
        "simulation": {"growth": json_value(found.release.growth), "stable": found.release.stable},
        "agree": found.agrees,
    }


def _print(found: _Found, channel: str) -> None:
    console = Console(file=sys.stdout, highlight=False)
    table = Table(box=None, padding=(0, 1), pad_edge=False, show_header=False)
    moving = found.system.moving()
    for value in moving[:SHOWN]:
        table.add_row("eigenvalue", f"{value.real:.6f} {value.imag:+.6f}j", f"|z| = {abs(value):.6f}")
    console.print(table)
    console.print(
        f"{len(found.system.states)} states; spectral radius {found.system.spectral_radius:.6f};"
        f" {found.radius:.6f} without the {len(found.system.states) - len(moving)} eigenvalues at z = 1"
        " (free positions and friction states)",
        soft_wrap=True,
    )
    if found.margins is None:
        console.print("no margins are given, because the closed loop is unstable")
    else:
        m = found.margins
        console.print(
            f"cut at {channel}: gain margin {m.gain_margin:.3g}, phase margin {math.degrees(m.phase_margin):.1f} deg,"
            f" delay margin {1e3 * m.delay_margin:.2f} ms, sensitivity peak {m.sensitivity_peak:.2f}",
            soft_wrap=True,
            markup=False,
        )
    kinks = list(dict.fromkeys(name.partition("@")[0] for name in found.system.kinks))  # a window's samples once
    if kinks:
        more = f" and {len(kinks) - SHOWN} more" if len(kinks) > SHOWN else ""
        console.print(
            "the linear verdict may not hold: the loop is not differentiable at this point in the states"
            f" {', '.join(kinks[:SHOWN])}{more}",
            soft_wrap=True,
            markup=False,
        )
    console.print(f"verdict: {found.verdict}")
    word = "decays" if found.release.stable else "grows"
    console.print(
        f"simulation: an initial velocity of {KICK:g} rad/s {word} (ratio of late to early speed"
        f" {found.release.growth:.3g}); this {'agrees with' if found.agrees else 'CONTRADICTS'} the verdict",
        soft_wrap=True,
    )


def _torque_loop(diagram: str, choice: ScenarioChoice) -> Any:
    """The scenario of a torque loop, or what the loop of a function was wired from.

    Raises:
        ParamsError: the diagram is no torque loop, or the function does not return its loop.
    """
    from drake_tc.loops.function_diagram import FunctionEntry
    from drake_tc.registry import diagram_entry, runnable

    named = runnable(diagram)
    if not isinstance(named, FunctionEntry):
        return choice.of(diagram_entry(diagram))
    built = named.build(choice.of(named))
    if built.torque_loop is None:
        raise ParamsError(
            f"{diagram}: expected a function that returns the diagram and the loop of add_torque_loop, as"
            " (diagram, loop), which a stability map needs; got the diagram alone"
        )
    return built.torque_loop.design


@dataclass(frozen=True, kw_only=True)
class MapOptions:
    """Options of `drake-tc stability-map`."""

    diagram: Diagram
    joint: Annotated[
        str, typer.Option(help="Joint that is mapped; the others are held still. An unknown name prints the joints.")
    ]
    x: Annotated[str, typer.Option(help="NAME=FIRST:LAST:STEP or NAME=A,B,C, such as window=20:160:20.")]
    y: Annotated[
        str, typer.Option(help="Second parameter, such as kp=0:4:0.2. An unknown NAME prints the available ones.")
    ]
    figure: Annotated[
        str, typer.Option(help="spectral_radius, sensitivity_peak, gain_margin, phase_margin or delay_margin.")
    ] = "spectral_radius"
    scenario: ScenarioChoice
    kf: Annotated[float | None, typer.Option(help="Force feedback gain instead of the scenario's.")] = None
    environment_stiffness: Annotated[
        float, typer.Option(min=0.0, help="Stiffness of the environment at the joint [N m/rad].")
    ] = 0.0
    workers: Workers
    out: Annotated[Path | None, typer.Option(help="File for the plot, .svg or .png.")] = None
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the map as JSON.")] = False
    seed: UnusedSeed = 0


def stability_map_command(options: MapOptions) -> None:
    """Map the stability of one joint over two parameters.

    All other parameters are those of the scenario. K6 and K7 stay when Kp changes.
    """
    from drake_tc.analysis.stability_map import Axis, draw_map, stability_map
    from drake_tc.loops.torque.default_gains import joint_loops

    joint, out = options.joint, options.out
    across, up = Axis.parse(options.x), Axis.parse(options.y)
    loops = joint_loops(_torque_loop(options.diagram, options.scenario))
    if joint not in loops:
        raise ParamsError(f"no joint {joint!r}; joints: {', '.join(loops)}")
    kf = loops[joint].kf if options.kf is None else options.kf
    loop = replace(loops[joint], kf=kf, environment_stiffness=options.environment_stiffness)
    if out is not None and out.suffix.lower() not in (".svg", ".png", ".pdf"):
        raise ParamsError(f"stability-map: expected --out FILE.svg, .png or .pdf, got {out}")
    inputs = [options.scenario.scenario_file]
    place = nullcontext() if out is None else result_file(out, "--out", inputs=inputs, force=options.force)
    with (
        place as file,
        progress_bar("stability-map", quiet=options.as_json) as progress,
        options.workers.executor() as executor,
    ):
        figure: Any = options.figure
        found = stability_map(loop, across, up, figure, executor=executor, progress=progress)
        if file is not None:
            from matplotlib.figure import Figure

            drawn = Figure(figsize=(8.0, 5.5), layout="constrained")
            draw_map(drawn, found)
            drawn.savefig(file, dpi=120)
    if options.as_json:
        files = [str(out)] if out else []
        print(json.dumps({"diagram": options.diagram, "joint": joint, **found.to_json(), "files": files}))
        return
    print(
        f"{joint}: {found.stable.mean():.1%} of {found.stable.size} points over {across.name} and {up.name} are stable"
    )
    for row in found.failed[:3]:
        print(f"not computed: {row}")
    if out:
        print(out)
