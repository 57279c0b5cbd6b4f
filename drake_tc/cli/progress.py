"""Progress on stderr: a bar in a terminal, plain lines elsewhere, nothing with --json."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn


@contextmanager
def progress_bar(title: str, *, quiet: bool = False) -> Iterator[Callable[[str, float], None]]:
    """Yield report(text, share in [0, 1]); a narrow terminal keeps the text and drops the bar."""
    if quiet or not sys.stderr.isatty():
        last = [""]

        def plain(text: str, share: float) -> None:
            if not quiet and text != last[0]:
                print(f"{title}: {text}", file=sys.stderr)
                last[0] = text

        yield plain
        return
    console = Console(stderr=True)
    columns = [SpinnerColumn(), TextColumn("{task.description}")]
    if console.width > 60:
        columns += [BarColumn(bar_width=24), TimeElapsedColumn()]
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda text, share: bar.update(task, description=f"{title}: {text}", completed=share)
