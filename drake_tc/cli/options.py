"""Options of the commands: records of them, those that several commands share, and what help and errors say of them."""

import inspect
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, get_args

import typer
from typer.core import TyperCommand
from typer.exceptions import TyperException

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from drake_tc.loops.entries import DiagramEntry

LARGEST_SEED = 2**32 - 1
"""Of `--seed`: the generators of some libraries take 32 bits."""


def with_flat_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command as Typer takes it: each dataclass among its parameters is replaced by its fields, an option each.

    A field that is a dataclass is replaced in the same way. The help lists the options in the order of the fields.
    """

    @wraps(command)
    def call(**given: Any) -> None:
        _made(command, given)

    vars(call)["__signature__"] = inspect.Signature(list(_options(command)))
    return call


def _options(made: Any) -> Iterator[inspect.Parameter]:
    for parameter in inspect.signature(made).parameters.values():
        if is_dataclass(parameter.annotation):
            yield from _options(parameter.annotation)
        else:
            yield parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)


def _made(kind: Any, given: dict[str, Any]) -> Any:
    """What a command returns, or a record, for the values of its options."""
    parts = {each.name: each.annotation for each in inspect.signature(kind).parameters.values()}
    values = {name: _made(of, given) if is_dataclass(of) else given[name] for name, of in parts.items()}
    return kind(**values)


Diagram: TypeAlias = Annotated[
    str,
    typer.Argument(
        help="Diagram name, or module:attribute of your own. An unknown name prints the available diagrams."
    ),
]
Declared: TypeAlias = Annotated[
    Path | None,
    typer.Option(help="File of your present model: URDF, MJCF, or a parameter file of BAM (JSON)."),
]
Force: TypeAlias = Annotated[
    bool, typer.Option("--force", help="Overwrite files that drake-tc did not write, or that were changed since.")
]
ScenarioSeed: TypeAlias = Annotated[
    int | None, typer.Option(min=0, max=LARGEST_SEED, help="Seed instead of the scenario's.")
]
UnusedSeed: TypeAlias = Annotated[
    int, typer.Option("--seed", help="Accepted by every command; this one does not use it.")
]


@dataclass(frozen=True, kw_only=True)
class ScenarioChoice:
    """A scenario of a diagram, and what is changed in it."""

    scenario_name: Annotated[str | None, typer.Option(help="Scenario; the file's first when left out.")] = None
    scenario_file: Annotated[Path | None, typer.Option(help="Scenario file (YAML) of your own.")] = None
    scenario_text: Annotated[str | None, typer.Option(help="YAML of fields to change: '{gains: {k6: 0.25}}'.")] = None

    def entry(self, diagram: str) -> "DiagramEntry[Any, Any]":
        """The diagram, whose errors name the user's file or changes.

        Raises:
            ParamsError: no such diagram.
        """
        from drake_tc.registry import runnable

        return runnable(diagram).naming(self.scenario_file, self.scenario_text)

    def of(self, entry: "DiagramEntry[Any, Any]") -> Any:
        """The scenario of a diagram.

        Raises:
            ParamsError: a file that cannot be read, or no such scenario.
        """
        return entry.scenario(self.scenario_name, self.scenario_file, self.scenario_text)


@dataclass(frozen=True, kw_only=True)
class Workers:
    """Where independent computations run."""

    workers: Annotated[int, typer.Option(min=1, help="Number of processes on this machine.")] = os.cpu_count() or 1
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead.")] = None

    @contextmanager
    def executor(self) -> "Iterator[Executor | None]":
        """Processes of this machine, a Dask cluster where an address is given, or None for one worker: this process.

        Raises:
            ParamsError: nothing answers at the address, or Dask is not installed.
        """
        from drake_tc.analysis.sweep import processes, scheduler_executor

        if self.scheduler is not None:
            with scheduler_executor(self.scheduler) as executor:
                yield executor
        elif self.workers > 1:
            with processes(self.workers) as executor:
                yield executor
        else:
            yield None


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
            return super().parse_args(ctx, self._apart(args))
        except TyperException as error:
            if getattr(error, "ctx", None) is None:
                vars(error)["ctx"] = ctx
            raise

    def _apart(self, args: list[str]) -> list[str]:
        """The arguments, `--position=-1.4,1.4` as `--position -1.4 1.4` where an option takes several values."""
        several = {name: option.nargs for option in self.params if option.nargs > 1 for name in option.opts}
        out = []
        for argument in args:
            name, _, values = argument.partition("=")
            apart = values.split(",")
            out += [name, *apart] if several.get(name) == len(apart) else [argument]
        return out

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
