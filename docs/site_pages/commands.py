"""Reference of the commands, from Typer's own description of them, with the examples of docs/cli_examples.yaml."""

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, get_args

import typer
import yaml

from drake_tc.cli.main import app
from drake_tc.config.page import table

EXAMPLES = Path(__file__).parents[1] / "cli_examples.yaml"
PROGRAM = "drake-tc"
PROCESSES = ("workers", "jobs")
"""Options whose default is the number of CPUs of the machine."""
WIDEST = 76
"""Letters of a line of an example."""


def commands() -> dict[str, Any]:
    """Name to its command."""
    return dict(_walk(typer.main.get_command(app), ""))


def _walk(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    if not hasattr(command, "commands"):
        yield name, command
        return
    for each, inner in command.commands.items():
        yield from _walk(inner, f"{name} {each}".strip())


def examples() -> dict[str, list[dict[str, str]]]:
    """Name of a command to its examples: `run` is the line, `does` says what it does."""
    read: dict[str, list[dict[str, str]]] = yaml.safe_load(EXAMPLES.read_text(encoding="utf-8"))
    return read


def arguments_of(line: str) -> list[str]:
    """What stands behind `drake-tc` on the line of an example, comments left out."""
    words = shlex.split(line, comments=True)
    if not words or words[0] != PROGRAM:
        raise ValueError(f"an example begins with {PROGRAM}; got {line!r}")
    return words[1:]


def pages() -> dict[str, str]:
    """Page to its text: one a command."""
    shown = examples()
    texts = {f"cli/{name}.md": _text(name, command, shown.get(name, [])) for name, command in commands().items()}
    return texts | {"cli/index.md": _overview()}


def _overview() -> str:
    rows = []
    for name, command in commands().items():
        rows.append((f"[`{PROGRAM} {name}`]({name}.md)", _paragraphs(command.help)[0]))
    return f"# Commands\n\n{_RULES}\n\n{table(('command', 'what it does'), rows)}\n"


_RULES = """
Every command has `--help`. Commands that compute have `--json`, which leaves nothing but JSON on stdout. Results go
to stdout, progress and notes to stderr.

A command ends with exit code 0 when it ran, whatever it found. It ends with 2 and one line on stderr when it cannot
use its input, with 70 after an error that nobody foresaw (the line names a file with the details; `--debug` shows
the traceback instead), and with 130 or 143 when it was interrupted or terminated.

Results are written beside their place and moved there together. No result takes the place of an input. A file that
drake-tc did not write, or that was changed since, is overwritten with `--force` only.
""".strip()


def _text(name: str, command: Any, shown: Sequence[Mapping[str, str]]) -> str:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option"]
    usage = " ".join([PROGRAM, name, *(p.name.upper() for p in arguments), "[OPTIONS]"])
    parts = [f"# `{PROGRAM} {name}`", *_paragraphs(command.help), f"```text\n{usage}\n```"]
    if arguments:
        rows = [(f"`{p.name.upper()}`", _help(p), _choices(p)) for p in arguments]
        parts.append(table(("argument", "meaning", "values"), rows))
    if options:
        rows = [(_names(p), _help(p), _choices(p), _default(p)) for p in options]
        parts.append(table(("option", "meaning", "values", "default"), rows))
    for example in shown:
        parts.append(f"{example['does']}\n\n```console\n$ {_wrapped(example['run'])}\n```")
    return "\n\n".join(parts) + "\n"


def _wrapped(line: str) -> str:
    """A long line continued on further lines, each of which begins with an option."""
    lines = [""]
    for part in re.split(r" (?=--)", line):
        if lines[-1] and len(lines[-1]) + len(part) > WIDEST:
            lines.append("   ")
        lines[-1] += f" {part}" if lines[-1] else part
    return " \\\n".join(lines)


def _paragraphs(text: str | None) -> list[str]:
    return [" ".join(part.split()) for part in (text or "").split("\n\n")]


def _names(option: Any) -> str:
    return " ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))


def _help(parameter: Any) -> str:
    more = (
        " May be repeated." if getattr(parameter, "multiple", False) and "repeat" not in (parameter.help or "") else ""
    )
    return f"{parameter.help or ''}{more}".replace("<", "&lt;")


def _choices(parameter: Any) -> str:
    """What may stand there: the choices, or the kind of value."""
    if getattr(parameter, "is_flag", False):
        return "–"
    kind = parameter.type_descriptor.annotation
    kind = next((each for each in get_args(kind) if each is not type(None)), kind)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return ", ".join(f"`{each.value}`" for each in kind)
    return {int: "integer", float: "number", str: "text", Path: "file or folder"}.get(kind, "text")


def _default(option: Any) -> str:
    if option.required:
        return "required"
    value = option.default
    if value is None or value == () or value == []:
        return "–"
    if option.is_flag:
        names = option.opts if value else option.secondary_opts
        return f"`{names[0]}`" if names else "off"
    if option.name in PROCESSES:
        return "number of CPUs"
    return f"`{getattr(value, 'value', value)}`"
