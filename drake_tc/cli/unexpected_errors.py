"""Unexpected events: errors in one line with details in a file, warnings of libraries, requests to terminate."""

import logging
import os
import signal
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType

from drake_tc import __version__

UNEXPECTED = 70
"""Exit code of an unexpected error (EX_SOFTWARE of BSD's sysexits)."""
SHOWN = 200
"""Characters of an error's own message that stand in the line; the file has all."""


class Terminated(BaseException):
    """The process was asked to terminate (SIGTERM)."""


def write_details(error: BaseException, arguments: Sequence[str]) -> str:
    """One sentence about an unexpected error; its traceback goes to a file that the sentence names.

    The file lies in `$XDG_STATE_HOME/drake-tc` (by default `~/.local/state/drake-tc`), or in the folder for temporary
    files.

    Args:
        error: With notes (PEP 678) on what was being read.
        arguments: Of the command.
    """
    message = " ".join(str(error).split())
    shown = message if len(message) <= SHOWN else message[: SHOWN - 3] + "..."
    notes = "".join(f", {note}" for note in getattr(error, "__notes__", ()))
    name = f"{type(error).__name__}: {shown}" if shown else type(error).__name__
    text = "".join(
        [
            f"drake_tc {__version__}, Python {sys.version.split()[0]}\n",
            f"arguments: {list(arguments)!r}\n\n",
            *traceback.format_exception(error),
        ]
    )
    return f"unexpected error{notes} ({name}); {_written(text)}; this is a defect of drake-tc, please report it"


def _written(text: str) -> str:
    """Where the details are, as a clause."""
    state = Path(os.environ.get("XDG_STATE_HOME") or Path("~/.local/state").expanduser())
    now = datetime.now(UTC).strftime("%Y%m%dT%H%M%S")
    for folder in (state / "drake-tc", Path(tempfile.gettempdir())):
        path = folder / f"drake-tc-{now}-{os.getpid()}.log"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", errors="backslashreplace")
        except OSError:
            continue
        return f"the details are in {path}"
    return "the details could not be written; --debug shows them"


@contextmanager
def quiet_libraries(*, quiet: bool, debug: bool) -> Iterator[None]:
    """Within the block SIGTERM raises `Terminated`, and warnings of libraries do not reach stderr as they are.

    Python's warnings (numpy's among them) are dropped: what they are about is checked where it matters. Drake's log
    messages are printed once each, as one line; with `quiet` they are dropped. With `debug` all are shown as they are.

    Args:
        quiet: For `--json`: nothing but errors.
        debug: Leave everything as it is.
    """
    with _sigterm(), warnings.catch_warnings():
        if debug:
            yield
            return
        warnings.simplefilter("ignore")
        drake = logging.getLogger("drake")
        handler = _PrintOnce(quiet)
        before = (drake.propagate, drake.handlers[:])
        drake.propagate, drake.handlers = False, [handler]
        try:
            yield
        finally:
            drake.propagate, drake.handlers = before


class _PrintOnce(logging.Handler):
    """Prints each of Drake's messages once, as one line."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(logging.WARNING)
        self.quiet = quiet
        self.printed: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message that was not printed yet."""
        text = " ".join(record.getMessage().split())
        if not self.quiet and text not in self.printed:
            self.printed.add(text)
            print(f"drake-tc: Drake says: {text}", file=sys.stderr)


@contextmanager
def _sigterm() -> Iterator[None]:
    """SIGTERM raises `Terminated` in the main thread; elsewhere nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def terminate(number: int, frame: FrameType | None) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
