"""`drake-tc`: the command line. Results go to stdout, everything else to stderr; bad input ends with 2 and one line."""

import sys

import typer

from drake_tc.cli.close_loop_command import close_loop_command
from drake_tc.cli.import_logs import import_logs
from drake_tc.errors import DrakeTcError

app = typer.Typer(
    name="drake-tc",
    help="Torque control of position-controlled robots in Drake, with a model held against measured data.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("close-loop")(close_loop_command)
app.command("import")(import_logs)


def main() -> None:
    """Entry point of the console script."""
    try:
        app()
    except DrakeTcError as error:
        print(f"drake-tc: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("drake-tc: interrupted", file=sys.stderr)
        sys.exit(130)
