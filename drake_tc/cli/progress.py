"""Progress on stderr: a bar in a terminal, plain lines elsewhere, nothing with --json."""

import math
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

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
