"""`drake-tc`: the command line. Results go to stdout, everything else to stderr; bad input ends with 2 and one line."""

import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from typer.exceptions import TyperException

from drake_tc import __version__
from drake_tc.cli.bode_command import bode_command
from drake_tc.cli.close_loop_command import close_loop_command, demo_command
from drake_tc.cli.compare_command import compare_command
from drake_tc.cli.diagram_commands import graph_command, simulate_command
from drake_tc.cli.estimate_commands import estimate_base_command, estimate_torque_command
from drake_tc.cli.experiment_commands import design_command, rehearse_command
from drake_tc.cli.export_command import export_command
from drake_tc.cli.identify_command import identify_command
from drake_tc.cli.log_commands import check_command, import_logs, inspect_command
from drake_tc.cli.options import Command, usage_message, with_flat_options
from drake_tc.cli.reproduce_command import reproduce_command
from drake_tc.cli.run_command import run_command
from drake_tc.cli.schema_command import schema_command
from drake_tc.cli.stability_command import stability_command, stability_map_command
from drake_tc.cli.tune_command import tune_command
from drake_tc.cli.unexpected_errors import UNEXPECTED, Terminated, quiet_libraries, write_details
from drake_tc.errors import DrakeTcError

LONGEST = 1200
"""Characters of the line of an error; a longer one is cut in the middle."""
INTERRUPTED = 130
"""Exit code of a command that was interrupted (128 + SIGINT)."""

app = typer.Typer(
    name="drake-tc",
    help="Torque control of position-controlled robots in Drake, with models that are checked against measured data.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # tables cut the names of options in a narrow terminal
)
for _command, _name, _short_help in (
    (demo_command, "demo", "Find what a simulated joint lacks."),
    (check_command, "check", "Check what your logs can show."),
    (close_loop_command, "close-loop", "Find what a model lacks, and add it."),
    (compare_command, "compare", "Report what changed since a model."),
    (design_command, "design", "Compute the next experiment."),
    (estimate_base_command, "estimate-base", "Estimate the motion of a base."),
    (estimate_torque_command, "estimate-torque", "Estimate the torques of a robot."),
    (identify_command, "identify", "Fit drive gain and friction."),
    (import_logs, "import", "Convert BAM servo recordings."),
    (export_command, "export", "Write a model for a simulator."),
    (inspect_command, "inspect", "List what a log contains."),
    (schema_command, "schema", "Print the schema of an input file."),
    (run_command, "run", "Run a controller in real time."),
    (simulate_command, "simulate", "Simulate a diagram."),
    (graph_command, "graph", "Draw a diagram."),
    (rehearse_command, "rehearse", "Count how often an effect is found."),
    (reproduce_command, "reproduce", "Recompute the results of a paper."),
    (stability_command, "stability", "Margins of a diagram's loop."),
    (stability_map_command, "stability-map", "Stability over two parameters."),
    (tune_command, "tune", "Choose gains and filter windows."),
    (bode_command, "bode", "Measure a frequency response."),
):
    app.command(_name, cls=Command, short_help=_short_help)(with_flat_options(_command))


def _print_version(requested: bool) -> None:
    if requested:
        print(__version__)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", callback=_print_version, is_eager=True)
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks and the warnings of libraries.")] = False,
) -> None:
    """Torque control of position-controlled robots in Drake, with models that are checked against measured data."""


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit code.

    0: it ran. 2: input that cannot be used, in one line. 70: an error that nobody foresaw, in one line, with the
    details in a file. 130 and 143: interrupted and terminated; worker processes end too, and no result is half written.

    Args:
        arguments: What stands behind `drake-tc`; nothing at all asks for the help. `--debug` anywhere shows tracebacks
            and warnings of libraries.
    """
    return run_app(app, "drake-tc", arguments)


def run_app(app: typer.Typer, program: str, arguments: Sequence[str]) -> int:
    """`run` of any application; its name stands before every message."""
    debug = "--debug" in arguments
    given = [argument for argument in arguments if argument != "--debug"]
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files need not be UTF-8
        sys.stdout.reconfigure(errors="backslashreplace")
    with quiet_libraries(quiet="--json" in given, debug=debug):
        return _run(app, program, given, debug=debug)


def _run(app: typer.Typer, program: str, arguments: Sequence[str], *, debug: bool) -> int:
    try:
        code = app(list(arguments) or ["--help"], prog_name=program, standalone_mode=False)
    except DrakeTcError as error:
        print(f"{program}: {_one_line(str(error))}", file=sys.stderr)
        return 2
    except TyperException as error:
        print(f"{program}: {_one_line(usage_message(error, program))}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except Terminated:
        print(f"{program}: terminated", file=sys.stderr)
        return 143
    except BrokenPipeError:  # whoever read the output has closed it, as `head` does
        sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - for the last flush
        return 141
    except Exception as error:
        if debug:
            raise
        print(f"{program}: {_one_line(write_details(error, arguments))}", file=sys.stderr)
        return UNEXPECTED
    if code == INTERRUPTED:  # Typer makes this code of a KeyboardInterrupt
        print(f"{program}: interrupted", file=sys.stderr)
    return code if isinstance(code, int) else 0


def _one_line(text: str) -> str:
    """A message as one line of printable characters; what names in files hold may be neither."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))
    return line if len(line) <= LONGEST else f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"
