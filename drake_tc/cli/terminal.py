"""What the commands share on the terminal: progress on stderr, wide tables, the next command."""

import math
import re
import shlex
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from drake_tc.config.files import utf8_text
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.analysis.tracking_error import JointTask

PAUSE = 10.0
"""Between two lines of one stage where there is no terminal [s]."""


def _silent(text: str, share: float) -> None:
    """With --json nothing is told."""


class _Lines:
    """Progress as plain lines; texts that differ in their numbers alone are of one stage."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._stage, self._told = "", -math.inf

    def report(self, text: str, share: float) -> None:
        stage, now = re.sub(r"\d+(\.\d+)?", "#", text), time.monotonic()
        if stage != self._stage or now - self._told >= PAUSE or share >= 1.0:
            print(f"{self._title}: {text}", file=sys.stderr)
            self._stage, self._told = stage, now


@contextmanager
def progress_bar(title: str, *, quiet: bool = False) -> Iterator[Callable[[str, float], None]]:
    """Yield report(text, share in [0, 1]).

    In a terminal it moves a bar; a narrow one keeps the text and drops the bar. Elsewhere it prints a line when a new
    stage begins, another one of the same stage after `PAUSE` at the earliest, and the last one (a share of 1).
    """
    if quiet or not sys.stderr.isatty():
        yield _silent if quiet else _Lines(title).report
        return
    console = Console(stderr=True)
    columns = [SpinnerColumn(), TextColumn("{task.description}")]
    if console.width > 60:
        columns += [BarColumn(bar_width=24), TimeElapsedColumn()]
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda text, share: bar.update(task, description=f"{title}: {text}", completed=share)


LEAST_TEXT = 16
"""Width of a column of wrapped texts."""
_NO_END = 10_000
"""Columns of a console in which nothing is cut."""


def print_wide(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    left: Sequence[str] = (),
    title: str = "",
    file: TextIO | None = None,
) -> None:
    """Print a table, as wide as its cells are.

    On a narrower terminal the last column, if it is a text, is wrapped. Where that is not enough, every row is a
    paragraph: its first cell, and below it the other cells with their headings.

    Args:
        headings: Of the columns.
        rows: Texts, one a column.
        left: Headings of columns that stand to the left; the others to the right.
        title: Above.
        file: Where to; None: stdout.
    """
    file = file or sys.stdout
    table = Table(box=None, padding=(0, 1), pad_edge=False, title=escape(title) or None, title_justify="left")
    for heading in headings:
        table.add_column(escape(heading), justify="left" if heading in left else "right", no_wrap=True)
    rows = list(rows)
    for row in rows:
        table.add_row(*map(escape, row))
    console = Console(file=file)
    width = Console(file=file, width=_NO_END).measure(table).maximum
    others = width - max(len(row[-1]) for row in [headings, *rows])
    if console.is_terminal and width > console.width:
        if headings[-1] not in left or others + LEAST_TEXT > console.width:
            file.writelines(
                f"{line}\n" for line in [*([title] if title else []), *_paragraphs(headings, rows, console.width)]
            )
            return
        table.columns[-1].no_wrap, width = False, 0
    drawn = StringIO()
    Console(file=drawn, width=max(console.width, width, len(title))).print(table)
    file.writelines(f"{line.rstrip()}\n" for line in drawn.getvalue().splitlines())


def _paragraphs(headings: Sequence[str], rows: Iterable[Sequence[str]], width: int) -> Iterator[str]:
    """Lines of a table whose rows are wider than a terminal; empty cells and dashes are left out."""
    for first, *others in rows:
        yield first
        cells = [
            f"{heading}: {cell}" if heading else cell
            for heading, cell in zip(headings[1:], others, strict=True)
            if cell not in ("", "-")
        ]
        yield from textwrap.wrap("; ".join(cells), width, initial_indent="    ", subsequent_indent="    ")


def command_line(*words: object) -> str:
    """A drake-tc command that a shell takes as it is; bytes of names that are not UTF-8 are replaced."""
    return shlex.join(["drake-tc", *(utf8_text(str(word)) for word in words)])


def say_next(text: str) -> None:
    """Print what to run next."""
    print(f"next: {text}", file=sys.stderr)


def tell_declared(command: str, rig: Path, declared: Path | None) -> None:
    """What files of other simulators declare, on stderr."""
    from drake_tc.logs.rig import load_rig

    for line in load_rig(rig, declared).declared_by_files:
        print(f"{command}: {line}", file=sys.stderr)


def tasks_of(tasks: Sequence["JointTask"], joints: Sequence[str] | None) -> list["JointTask"]:
    """The tasks of some joints, of all where none is named.

    Raises:
        ParamsError: a joint that is not there.
    """
    names = [task.joint for task in tasks]
    for joint in joints or []:
        if joint not in names:
            raise ParamsError(f"no joint {joint!r}; joints: {', '.join(names)}")
    return [task for task in tasks if not joints or task.joint in joints]
