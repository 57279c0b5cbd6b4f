"""How commands show the values of their options, and what they say of values that they cannot read."""

import sys
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_args

import typer
from typer.core import TyperCommand
from typer.exceptions import TyperException

KINDS = {int: "<integer>", float: "<number>", str: "<text>", Path: "<path>"}
"""Kinds of values as the help shows them."""
EXPECTED = {
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "int_parsing": "an integer",
    "int_from_float": "an integer",
    "greater_than_equal": "at least {ge:.10g}",
    "less_than_equal": "at most {le:.10g}",
}
"""By the type of an error of Pydantic, which reads the values: what was expected."""


LARGEST_SEED = 2**32 - 1
"""Of `--seed`: the generators of some libraries take 32 bits."""


class Command(TyperCommand):
    """A command whose help has words for the kinds of values, and capitals for arguments."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        for parameter in self.params:
            if parameter.param_type_name == "argument" and parameter.metavar is None:
                parameter.metavar = parameter.name.upper()

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Some errors of parsing do not know the command, whose help the message names."""
        try:
            return super().parse_args(ctx, args)
        except TyperException as error:
            if getattr(error, "ctx", None) is None:
                vars(error)["ctx"] = ctx
            raise

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Typer shows annotations of Python, such as `<list[Path]>`; `KINDS` replaces them."""
        for parameter in self.params:
            if parameter.param_type_name == "option" and parameter.metavar is None:
                parameter.metavar = _kind(parameter)
        super().format_options(ctx, formatter)


def _kind(option: Any) -> str | None:
    """The kind of an option's values; None where Typer's own text serves: of flags and choices."""
    annotation = option.type_descriptor.annotation
    elements = [each for each in get_args(annotation) if each is not type(None)]
    return KINDS.get(elements[0] if elements else annotation)


def usage_message(error: TyperException, program: str) -> str:
    """One line: what of the command line cannot be used, what was expected and what came, and where the help is.

    Args:
        error: Of parsing.
        program: Its name.
    """
    command = getattr(getattr(error, "ctx", None), "command_path", program)
    return f"{_message(error)} (see {command} --help)"


def _message(error: TyperException) -> str:
    text = error.format_message()
    details: list[dict[str, Any]] = getattr(error.__cause__, "errors", list)()
    if not details:
        return text
    first = details[0]
    named = text.partition(": ")[0]
    if first["type"] not in EXPECTED:
        return f"{named}: {first['msg'].removeprefix('Value error, ')}"
    expected = EXPECTED[first["type"]].format(**first.get("ctx", {}))
    return f"{named}: expected {expected}, got {first['input']}"


Declared: TypeAlias = Annotated[
    Path | None,
    typer.Option(help="File of your present model: URDF, MJCF, or a parameter file of BAM (JSON)."),
]


def tell_declared(command: str, rig: Path, declared: Path | None) -> None:
    """What files of other simulators declare, on stderr."""
    from drake_tc.logs.rig import load_rig

    for line in load_rig(rig, declared).declared_by_files:
        print(f"{command}: {line}", file=sys.stderr)
