"""The memory allocator of commands that simulate.

Drake's contact solver allocates and frees its memory anew in each step. glibc's allocator keeps only seven freed blocks
of each size at hand; with `BLOCKS` of them a step takes some percent less time, and its results are the same. glibc
reads the number when a process starts (`man ld.so`, GLIBC_TUNABLES), so the process replaces itself once by one with
it.
"""

import os
import sys
from collections.abc import Mapping, Sequence

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
