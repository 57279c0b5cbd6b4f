"""Entry point of the console script: the commands, or one line where Drake cannot be loaded.

The memory allocator of commands that simulate.

Drake's contact solver allocates and frees its memory anew in each step. glibc's allocator keeps only seven freed blocks
of each size at hand; with `BLOCKS` of them a step takes some percent less time, and its results are the same. glibc
reads the number when a process starts (`man ld.so`, GLIBC_TUNABLES), so the process replaces itself once by one with
it.
"""

import os
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from typing import NoReturn

from drake_tc.system_libraries import how_to_install, import_error, missing_library

TUNABLE, BLOCKS = "glibc.malloc.tcache_count", 100
SIMULATING = ("simulate", "reproduce")
"""Commands that last long enough for the start to pay."""


def tuned(environment: Mapping[str, str]) -> dict[str, str] | None:
    """The environment with the tunable; None where it has one already.

    Args:
        environment: Of a process.
    """
    tunables = environment.get("GLIBC_TUNABLES", "")
    if TUNABLE in tunables:
        return None
    own = f"{TUNABLE}={BLOCKS}"
    return {**environment, "GLIBC_TUNABLES": f"{tunables}:{own}" if tunables else own}


def restart_tuned(arguments: Sequence[str], *, simulates: bool = False) -> None:
    """Start this process anew with the tunable; do nothing where that has no use or is not possible.

    It has no use for other commands and without glibc. It is not possible where the arguments are not those with which
    the interpreter was started, as in a program that calls the command.

    Args:
        arguments: What stands behind `drake-tc`.
        simulates: Every command of the program simulates, whatever its name.
    """
    environment = tuned(os.environ)
    simulates = bool(arguments) and (simulates or arguments[0] in SIMULATING)
    started = list(arguments) == sys.orig_argv[len(sys.orig_argv) - len(arguments) :]
    if environment is not None and simulates and started and sys.executable and _has_glibc():
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], environment)


def _has_glibc() -> bool:
    try:
        return str(os.confstr("CS_GNU_LIBC_VERSION")).startswith("glibc")
    except (AttributeError, ValueError, OSError):
        return False


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
