"""Entry point of the console script: the commands, or one line where Drake cannot be loaded."""

import os
import re
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from typing import NoReturn

from drake_tc.cli.allocator import restart_tuned
from drake_tc.system_libraries import how_to_install, import_error, missing_library

OLDEST = (1, 51)
"""The oldest Drake that is supported, as in pyproject.toml."""
STOPPED = (130, 143)
"""Exit codes after SIGINT and SIGTERM: the process ends at once, without joining the threads of the worker pool, which
wait forever where a worker was ended while it started. Files are cleaned up and workers are ended before."""


def main() -> None:
    """Run the command of `sys.argv`; where Drake cannot be loaded, say why in one line and end with 2."""
    restart_tuned(sys.argv[1:])
    problem = drake_problem()
    if problem is not None:
        print(f"drake-tc: {problem}", file=sys.stderr)
        sys.exit(2)
    from drake_tc.cli.main import run

    leave(run(sys.argv[1:]))


def leave(code: int) -> NoReturn:
    """End this process with the exit code of a command."""
    if code in STOPPED:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        os._exit(code)
    sys.exit(code)


def drake_problem() -> str | None:
    """Why Drake cannot be used here, in one line; None if it can."""
    oldest = ".".join(map(str, OLDEST))
    error = import_error("pydrake.common")
    if isinstance(error, ModuleNotFoundError) and error.name == "pydrake":
        return f"Drake is not installed in this Python environment: pip install 'drake>={oldest}'"
    if error is not None:
        library = missing_library(error)
        reason = how_to_install(library) if library else " ".join(str(error).split())
        return f"Drake could not be loaded: {reason}"
    found = installed_version()
    if found is not None and found < OLDEST:
        have = ".".join(map(str, found))
        return f"Drake {have} is too old; expected {oldest} or newer: pip install --upgrade 'drake>={oldest}'"
    return None


def installed_version() -> tuple[int, int] | None:
    """Major and minor version of the drake wheel; None if Drake was not installed from one, or tells no number."""
    try:
        found = re.match(r"(\d+)\.(\d+)", version("drake"))
    except PackageNotFoundError:
        return None
    return (int(found[1]), int(found[2])) if found else None
