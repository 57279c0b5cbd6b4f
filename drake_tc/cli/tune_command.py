"""`drake-tc tune`: window and gains of a loop's joints for the least tracking error under a stated margin."""

import json
import sys
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.cli.options import LARGEST_SEED, Force, ScenarioChoice, Workers
from drake_tc.cli.out_files import result_folder
from drake_tc.cli.terminal import progress_bar, tasks_of
from drake_tc.config.quoted import json_value

if TYPE_CHECKING:
    from drake_tc.analysis.torque_loop.tuned import Confirmed
    from drake_tc.analysis.tracking_error import JointTask
    from drake_tc.analysis.tuning import SearchSpace, Tuning

FILES = ("tuned.yaml", "pareto.svg", "pareto.png")
WINDOWS = (3, 500)
"""Shortest and longest filter that is tried [samples]: a velocity must be seen, and the filter's lag be bearable."""
LARGEST_DELAY = 1.0
"""Longest delay margin that can be required [s]; loops of position servos keep some tens of milliseconds."""


@dataclass(frozen=True, kw_only=True)
class TunedSettings:
    """Which settings are tried, and which of them are good enough."""

    joint: Annotated[
        list[str] | None,
        typer.Option(help="Tune only this joint, at its present window; repeat for more. Default: all joints."),
    ] = None
    margin: Annotated[
        float | None, typer.Option(help="Largest sensitivity peak [-]; by default each joint's present one.")
    ] = None
    delay_margin: Annotated[
        float | None,
        typer.Option(help=f"Smallest delay margin [s], up to {LARGEST_DELAY:g}; by default each joint's present one."),
    ] = None
    noise: Annotated[
        float,
        typer.Option(
            min=0.0, help="Largest noise in the effort, as a multiple of the noise with the manufacturer's servo."
        ),
    ] = 1.0
    window: Annotated[
        list[int] | None, typer.Option(help=f"Windows to try [samples], {WINDOWS[0]} to {WINDOWS[1]}; repeat.")
    ] = None

    def check(self) -> None:
        """Refuse goals that no loop can keep, and filters that no loop can bear.

        Raises:
            BadParameter: states the range.
        """
        if self.margin is not None and not self.margin > 1.0:
            raise typer.BadParameter(f"expected a sensitivity peak above 1, got {self.margin:g}", param_hint="--margin")
        if self.delay_margin is not None and not 0.0 <= self.delay_margin <= LARGEST_DELAY:
            raise typer.BadParameter(
                f"expected a delay margin of 0 to {LARGEST_DELAY:g} s, got {self.delay_margin:g}",
                param_hint="--delay-margin",
            )
        shortest, longest = WINDOWS
        odd = next((each for each in self.window or [] if not shortest <= each <= longest), None)
        if odd is not None:
            raise typer.BadParameter(f"expected {shortest} to {longest} samples, got {odd}", param_hint="--window")

    def space(self, tasks: "list[JointTask]") -> "SearchSpace":
        """What is tried: with `joint`, the window stays unless others are given."""
        from drake_tc.analysis.tuning import SearchSpace

        if not (self.window or self.joint):
            return SearchSpace()
        return replace(SearchSpace(), windows=tuple(self.window or [tasks[0].loops[0].window]))


@dataclass(frozen=True, kw_only=True)
class TuneOptions:
    """Options of `drake-tc tune`."""

    diagram: Annotated[
        str,
        typer.Argument(
            help="Diagram name, or module:function of your own that returns (diagram, loop of add_torque_loop). "
            "An unknown name prints the available diagrams."
        ),
    ]
    scenario: ScenarioChoice
    settings: TunedSettings
    begin: Annotated[float | None, typer.Option(min=0.0, help="Time from which errors are counted [s].")] = None
    simulate: Annotated[bool, typer.Option(help="Confirm by simulating the complete loop, before and after.")] = True
    plants: Annotated[int, typer.Option(min=0, help="Number of perturbed plants on which the result is confirmed.")] = 0
    workers: Workers
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the sensors' noise and of the perturbed plants.")
    ] = 0
    out: Annotated[Path | None, typer.Option(help="Folder for tuned.yaml and the Pareto fronts (SVG, PNG).")] = None
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False


def tune_command(options: TuneOptions) -> None:
    """Choose filter window and gains of each joint for the least tracking error that keeps a stated margin.

    The tracking error is that of the scenario's motion. The stiffness K6 stays. Without --margin and --delay-margin, no
    joint gets smaller margins than it has.
    """
    from drake_tc.analysis.torque_loop.tuned import (
        PerturbedPlants,
        confirm,
        confirm_function,
        function_tasks,
        joint_tasks,
    )
    from drake_tc.analysis.tuning import default_goals, tune
    from drake_tc.loops.function_diagram import FunctionEntry
    from drake_tc.loops.torque.running import SETTLED
    from drake_tc.registry import diagram_entry, runnable

    settings, seed, out = options.settings, options.seed, options.out
    settings.check()
    named = runnable(options.diagram)
    own = named if isinstance(named, FunctionEntry) else None
    scenario: Any = options.scenario.of(own or diagram_entry(options.diagram)).changed(seed=seed)
    first = min(SETTLED, 0.5 * scenario.duration) if options.begin is None else options.begin
    if own and options.plants:
        raise typer.BadParameter(
            "perturbed plants need a scenario, got the diagram of a function", param_hint="--plants"
        )
    tasks = tasks_of(function_tasks(own, scenario, first) if own else joint_tasks(scenario, first), settings.joint)
    goals = default_goals(tasks, settings.margin, settings.delay_margin, settings.noise)
    confirmed = None
    inputs = [options.scenario.scenario_file]
    place = (
        nullcontext() if out is None else result_folder(out, "--out", names=FILES, inputs=inputs, force=options.force)
    )
    with place as folder, options.workers.executor() as executor:
        with progress_bar("tune", quiet=options.as_json) as progress:
            found = tune(tasks, goals, settings.space(tasks), executor=executor, progress=progress)
        if options.simulate:
            with progress_bar("tune: simulating", quiet=options.as_json) as progress:
                if own:
                    confirmed = confirm_function(own, scenario, found, first)
                else:
                    motions = [(scenario, first)]
                    drawn = PerturbedPlants(options.plants, seed=seed)
                    confirmed = confirm(motions, found, drawn, executor=executor, progress=progress)
        if folder is not None:
            _write(found, folder)
    files = [] if out is None else [out / name for name in FILES]
    if options.as_json:
        what = {"diagram": options.diagram, "seed": seed}
        print(json.dumps({**what, **_plain(found, confirmed), "files": list(map(str, files))}))
        return
    _print(found, confirmed)
    for file in files:
        print(file)


def _write(found: "Tuning", folder: Path) -> None:
    """The fields for a scenario, and the fronts."""
    import yaml
    from matplotlib.figure import Figure

    from drake_tc.analysis.torque_loop.tuned import tuned_fields
    from drake_tc.analysis.tuning import draw_fronts

    text = yaml.safe_dump(tuned_fields(found), sort_keys=False, default_flow_style=None)
    (folder / FILES[0]).write_text(
        f"# Fields of a scenario, as `--scenario-text` takes them.\n{text}", encoding="utf-8"
    )
    for name in FILES[1:]:
        figure = Figure(figsize=(11.0, 6.5), layout="constrained")
        draw_fronts(figure, found)
        figure.savefig(folder / name, dpi=120)


def _plain(found: "Tuning", confirmed: "Confirmed | None") -> dict[str, Any]:
    from dataclasses import asdict

    from drake_tc.analysis.torque_loop.tuned import tuned_fields

    joints = [
        {
            "joint": joint.joint,
            "before": asdict(joint.before) if joint.before else None,
            "after": asdict(joint.after),
            "front": [asdict(each) for each in joint.front],
        }
        for joint in found.joints
    ]
    result: dict[str, Any] = {
        "window": found.window,
        "order": found.order,
        "tried": found.tried,
        "predicted_ratio": found.ratio,
        "joints": joints,
        "fields": tuned_fields(found),
    }
    if confirmed is not None:
        before, after = confirmed.nominal[0]
        result["simulated"] = {
            "joints": list(confirmed.joints),
            "before": before.tolist(),
            "after": after.tolist(),
            "ratio": confirmed.ratio(found),
            "plant_ratios": confirmed.plant_ratios.tolist(),
        }
    return json_value(result)  # type: ignore[no-any-return]


def _print(found: "Tuning", confirmed: "Confirmed | None") -> None:
    console = Console(file=sys.stdout, highlight=False)
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    table.add_column("joint", no_wrap=True)
    simulated = ["simulated \\[mrad]"] if confirmed is not None else []
    for heading in ("Kp", "Ki \\[1/s]", "K7 \\[ms]", "predicted \\[mrad]", *simulated, "peak", "delay \\[ms]"):
        table.add_column(heading, justify="right")
    for joint in found.joints:
        before, after, chosen = joint.before, joint.after, joint.after.setting
        cells = [f"{chosen.kp:.2f}", f"{chosen.ki:.1f}", f"{1e3 * chosen.k7:.1f}"]
        cells.append(_change(1e3 * before.error if before else None, 1e3 * after.error, 3))
        if confirmed is not None:
            was, now = (1e3 * row[confirmed.joints.index(joint.joint)] for row in confirmed.nominal[0])
            cells.append(_change(was, now, 3))
        cells.append(_change(before.sensitivity_peak if before else None, after.sensitivity_peak, 2))
        cells.append(_change(1e3 * before.delay_margin if before else None, 1e3 * after.delay_margin, 1))
        table.add_row(joint.joint, *cells)
    console.print(table)
    console.print(f"window {found.window}, order {found.order}; {found.tried} settings tried; present -> tuned")
    mean = "tuned over present (geometric mean of the joints)"
    if confirmed is None:
        console.print(f"predicted error, {mean}: {found.ratio:.2f}; not simulated")
    else:
        console.print(f"simulated error, {mean}: {confirmed.ratio(found):.2f}; predicted: {found.ratio:.2f}")
        for line in _missed(found, confirmed):
            console.print(line, markup=False, soft_wrap=True)
    if confirmed is not None and confirmed.plant_ratios.size:
        ratios = sorted(confirmed.plant_ratios.tolist())
        middle, worst = ratios[len(ratios) // 2], ratios[-1]
        console.print(f"{len(ratios)} perturbed plants, simulated: median {middle:.2f}, worst {worst:.2f}")


MISSED = 1.2
"""Simulated over predicted error, up or down, from which on the difference is told."""
NOTHING = 1e-5
"""Errors below this are not compared [rad]."""


def _missed(found: "Tuning", confirmed: "Confirmed") -> list[str]:
    """One line for each joint whose simulated error is not the predicted one, or is no smaller than it was."""
    lines = []
    for joint in found.joints:
        was, now = (float(row[confirmed.joints.index(joint.joint)]) for row in confirmed.nominal[0])
        predicted = joint.after.error
        if max(now, predicted) > NOTHING and not 1.0 / MISSED <= now / max(predicted, 1e-12) <= MISSED:
            lines.append(
                f"{joint.joint}: {1e3 * now:.2f} mrad are simulated where {1e3 * predicted:.2f} are predicted: the"
                " simulated ones count, as joints disturb each other and limits are not linear"
            )
        if now > max(was, NOTHING):
            lines.append(f"{joint.joint}: the tuned setting is worse in the simulation than the present one")
    return lines


def _change(before: float | None, after: float, digits: int) -> str:
    return f"{'unstable' if before is None else format(before, f'.{digits}f')} -> {after:.{digits}f}"
