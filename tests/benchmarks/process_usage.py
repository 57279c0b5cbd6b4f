"""What a command costs with every process that it starts: `python -m tests.benchmarks.process_usage COMMAND ...`.

It is a process of its own, because it adopts and waits for whatever the command leaves behind, such as the server of
which workers are forks; the usage of a process counts once somebody has waited for it. Prints one line of JSON.
"""

import ctypes
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence

SUBREAPER = 36
"""PR_SET_CHILD_SUBREAPER of Linux: orphans among the descendants become children of this process."""
MAXRSS_UNIT = 1.0 if sys.platform == "darwin" else 1024.0
"""Bytes in the unit of `ru_maxrss`."""


def measure(command: Sequence[str]) -> tuple[int, dict[str, float]]:
    """Run a command to its end, its stdout thrown away.

    Returns:
        Its exit code, and `wall` [s], `cpu` [s] (user and system time of all processes) and `memory` [GiB] (peak of the
        largest process).
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(SUBREAPER, 1, 0, 0, 0)
    begin = time.perf_counter()
    code = subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode
    wall = time.perf_counter() - begin
    while True:
        try:
            os.wait()
        except ChildProcessError:
            break
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    memory = usage.ru_maxrss * MAXRSS_UNIT / 2**30
    return code, {"wall": wall, "cpu": usage.ru_utime + usage.ru_stime, "memory": memory}


if __name__ == "__main__":
    ended, costs = measure(sys.argv[1:])
    print(json.dumps(costs))
    sys.exit(ended)
