"""`drake-tc run`: a controller against wall-clock time, between a robot's readings and its commands."""

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drake_tc.cli.options import ScenarioChoice, UnusedSeed
from drake_tc.errors import DrakeTcError, ParamsError

if TYPE_CHECKING:
    from drake_tc.control.guard import GuardSpec
    from drake_tc.hardware.link import RobotLink
    from drake_tc.hardware.loop import RunReport
    from drake_tc.hardware.watch import ModelWatch
    from drake_tc.loops.built_loop import Controller

LCM, STOPPED_EARLY = "lcm", 3
"""The transport that is built in; and the exit code of a run that no sound readings came in for."""


@dataclass(frozen=True, kw_only=True)
class ControllerScenario(ScenarioChoice):
    """The scenario of the diagram whose controller is run."""

    scenario_name: Annotated[str | None, typer.Option(help="Scenario of a diagram; its first when left out.")] = None


@dataclass(frozen=True, kw_only=True)
class CommandLimits:
    """Limits of the guard between controller and robot; those that are None stay."""

    offset_limit: Annotated[
        float | None, typer.Option(help="Largest offset of a servo from its joint [rad], or |command| of other drives.")
    ] = None
    rate_limit: Annotated[float | None, typer.Option(help="Largest rate of a command [1/s].")] = None
    start_time: Annotated[float | None, typer.Option(help="From the first position to the command [s].")] = None

    def guard(self) -> "GuardSpec | None":
        """The guard; None: that of the controller."""
        from drake_tc.control.guard import GuardSpec

        given = {name: value for name, value in vars(self).items() if value is not None}
        return GuardSpec(**given) if given else None


@dataclass(frozen=True, kw_only=True)
class Timing:
    """How the loop waits for the robot and for the clock: fields of `RealTimeSpec`."""

    max_age: Annotated[float, typer.Option(help="Readings that are older are missing [s].")] = 5e-3
    patience: Annotated[float, typer.Option(help="How long to wait for sound readings [s].")] = 10.0
    stop_time: Annotated[float, typer.Option(help="How long to hold and damp after a stop [s].")] = 1.0
    spin: Annotated[float, typer.Option(help="How long before a tick to look at the clock, not to sleep [s].")] = 0.0
    priority: Annotated[int, typer.Option(min=0, max=99, help="Real-time priority (SCHED_FIFO); 0: none.")] = 0


@dataclass(frozen=True, kw_only=True)
class WatchFiles:
    """Files of the watch that compares joints with their models."""

    watch: Annotated[
        Path | None,
        typer.Option(
            help="Report joints that change from their models; file of --learn-watch, or torque_uncertainty.yaml."
        ),
    ] = None
    learn_watch: Annotated[
        Path | None, typer.Option(help="Write the file for --watch from this run, in which nothing is wrong.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Options of `drake-tc run`."""

    controller: Annotated[
        str,
        typer.Argument(
            help="module:attribute of a function that returns a controller, as torque_controller does; or the name of a"
            " diagram, whose scenario's controller is taken."
        ),
    ]
    robot: Annotated[
        str,
        typer.Option(
            help="lcm, lcm=URL, or module:attribute of a function that returns an object with read() and write()."
        ),
    ] = LCM
    duration: Annotated[float | None, typer.Option(help="Seconds until the stop; without end when left out.")] = None
    scenario: ControllerScenario
    dry: Annotated[bool, typer.Option("--dry", help="Send no commands.")] = False
    limits: CommandLimits
    timing: Timing
    watch_files: WatchFiles
    stop: Annotated[bool, typer.Option("--stop", help="Only send the stop message of LCM.")] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False
    seed: UnusedSeed = 0


def run_command(options: RunOptions) -> None:
    """Run a controller against wall-clock time. SIGINT, SIGTERM and the robot's stop message stop it."""
    from drake_tc.control.torque_uncertainty_file import save_torque_uncertainty
    from drake_tc.hardware.lcm_link import URL, send_stop
    from drake_tc.hardware.loop import RealTimeLoop, RealTimeSpec

    controller, duration = options.controller, options.duration
    if duration is not None and not 0.0 < duration < math.inf:
        raise typer.BadParameter(f"expected a positive number [s], got {duration!r}", param_hint="--duration")
    if options.stop:
        send_stop(_url(options.robot) or URL)
        return
    spec = RealTimeSpec(guard=options.limits.guard(), dry=options.dry, **vars(options.timing))
    own = ":" in controller
    if own and any(vars(options.scenario).values()):
        raise typer.BadParameter(
            "expected the name of a diagram beside it, got module:attribute", param_hint="--scenario"
        )
    made = _controller(controller) if own else _of_diagram(controller, options.scenario)
    learned = options.watch_files.learn_watch
    watched = _watch(made, options.watch_files.watch, learned)
    loop = RealTimeLoop(made, _link(options.robot, made), spec, watch=watched)
    report = loop.run(math.inf if duration is None else duration)
    if options.as_json:
        print(json.dumps(report.to_json()))
    else:
        print("\n".join(lines(report)))
    if watched is not None and learned is not None:
        save_torque_uncertainty(watched.learned().uncertainty(), learned)
    if report.ended == "no readings":
        print(
            f"run: no sound readings within {options.timing.patience:g} s: expected all of them, finite, with joints"
            " within their ranges",
            file=sys.stderr,
        )
        raise typer.Exit(STOPPED_EARLY)


def _watch(controller: "Controller", known: Path | None, learned: Path | None) -> "ModelWatch | None":
    """The watch of the models, if there is to be one."""
    from drake_tc.control.torque_uncertainty_file import load_torque_uncertainty
    from drake_tc.hardware.watch import ModelWatch
    from drake_tc.watch.health import ModelHealth

    if known is not None and learned is not None:
        raise typer.BadParameter("expected --watch or --learn-watch, got both", param_hint="--learn-watch")
    if known is None and learned is None:
        return None
    return ModelWatch(controller, None if known is None else ModelHealth.of(load_torque_uncertainty(known)))


def lines(report: "RunReport") -> list[str]:
    """The report for people."""
    counts, times = report.counts, report.percentiles()
    told = [
        f"ended by {report.ended} after {report.seconds:.2f} s and {counts.ticks} ticks of {1e3 * report.period:g} ms",
        f"deadlines missed {counts.missed} ({100.0 * report.miss_share:.3f} %), ticks skipped {counts.skipped}",
        f"readings late {counts.late}, missing {counts.missing}, malformed {counts.malformed}",
        f"ticks held or damped {counts.held}, errors of the link {counts.link_errors}, of the controller"
        f" {counts.controller_errors}",
    ]
    for name, title in (("wake", "began late by"), ("work", "took")):
        shares = ", ".join(f"{share.replace('_', '.')} {1e6 * value:.0f}" for share, value in times[name].items())
        told.append(f"a tick {title} [us]: {shares}")
    if report.flags:
        told.append("flags [ticks]: " + ", ".join(f"{name} {n}" for name, n in report.flags.items()))
    if counts.watch_errors:
        told.append("model: an error ended the watch")
    elif report.watch is not None and not report.watch["learns"]:
        told += [f"model: {event}" for event in report.watch["events"]] or ["model: no change"]
    return told + ([f"last error: {report.last_error}"] if report.last_error else [])


def _controller(text: str) -> "Controller":
    from drake_tc.loops.built_loop import Controller

    made = _made(text, "CONTROLLER")
    if not isinstance(made, Controller):
        raise ParamsError(
            f"{text}: expected a function that returns a controller, such as torque_controller(...), got"
            f" {type(made).__name__}"
        )
    return made


def _of_diagram(name: str, scenario: ScenarioChoice) -> "Controller":
    """The controller of a diagram's scenario."""
    from drake_tc.loops.torque.wiring import scenario_controller as torque
    from drake_tc.loops.whole_body.wiring import scenario_controller as whole_body

    entry = scenario.entry(name)
    chosen = scenario.of(entry)
    if entry.kind not in ("torque", "whole_body"):
        raise ParamsError(
            f"{name}: expected the diagram of a torque loop or of a whole-body loop, got one of {entry.kind}; make its"
            " controller in Python and give module:attribute"
        )
    return torque(chosen) if entry.kind == "torque" else whole_body(chosen)


def _url(robot: str) -> str | None:
    """URL of LCM; empty for its default, None where the robot is another."""
    name, _, url = robot.partition("=")
    return url if name == LCM else None


def _link(robot: str, controller: "Controller") -> "RobotLink":
    from drake_tc.hardware.lcm_link import URL, LcmLink
    from drake_tc.hardware.link import whole_link

    url = _url(robot)
    if url is not None:
        ports = [controller.get_input_port(index) for index in range(controller.num_input_ports())]
        sizes = {port.get_name(): int(port.size()) for port in ports}
        return LcmLink(sizes, len(controller.controlled.joints), url or URL)
    return whole_link(_made(robot, "--robot"), robot)


def _made(text: str, where: str) -> Any:
    """What the function that `module:attribute` names returns; modules of the working directory are found."""
    from drake_tc.registry import loaded

    if (here := str(Path.cwd())) not in sys.path:
        sys.path.insert(0, here)
    try:
        make = loaded(text)
    except ParamsError as error:
        raise ParamsError(f"{where}: {error}") from None
    try:
        return make() if callable(make) else make
    except DrakeTcError:
        raise
    except Exception as error:
        raise ParamsError(f"{where}: {text}() raised {type(error).__name__}: {' '.join(str(error).split())}") from error
