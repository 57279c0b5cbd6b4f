"""Starts workers, and goes on with the next case where one hangs or crashes."""

import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .sound import REPOSITORY

HANGS = 20.0
"""A case hangs that computes for longer [s]."""
STARTING = 120.0
"""The same of the first case of a worker, which loads libraries and compiles the kernels where they are not [s]."""
WAITS = 300.0
"""A case hangs that is not over after so long, whether it computes or waits [s]."""
LOOK = 1.0
"""Interval at which the time that a worker has computed is read [s]."""


def outcomes(first: int, last: int) -> Iterator[dict[str, Any]]:
    """The outcome of each case from `first` to `last` - 1, as `worker.run_case` has it."""
    while first < last:
        for found in _worker(first, last):
            yield found
            first = found["number"] + 1


def _worker(first: int, last: int) -> Iterator[dict[str, Any]]:
    """Outcomes until the worker ends; one that hangs or crashes is the last."""
    folder = tempfile.mkdtemp(prefix="fuzz")
    environment = os.environ | {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", "MUJOCO_GL": "disable"}
    environment |= {"XDG_STATE_HOME": folder, "TMPDIR": folder}
    command = [sys.executable, "-m", "fuzz.worker", str(first), str(last)]
    process = subprocess.Popen(command, cwd=REPOSITORY / "tests", env=environment, stdout=subprocess.PIPE, text=True)
    stream = process.stdout
    assert stream is not None
    running, most = first, STARTING
    try:
        while _answers(process, most):
            line = stream.readline()
            if not line:
                if running < last:
                    yield _failed(running, f"the process ended with {process.wait()}")
                return
            found = json.loads(line)
            if "begin" in found:
                running = found["begin"]
            else:
                running, most = found["number"] + 1, HANGS
                yield found
        yield _failed(running, f"hangs: {most:.0f} s of computation, or {WAITS:.0f} s of waiting")
    finally:
        process.kill()
        process.wait()
        stream.close()
        shutil.rmtree(folder, ignore_errors=True)


def _answers(process: "subprocess.Popen[str]", most: float) -> bool:
    """Whether the worker writes a line before it has computed for `most` seconds, or waited too long.

    Time of computation counts, so that a busy machine is no hang.
    """
    begin, computed = time.monotonic(), _computed(process.pid)
    while not select.select([process.stdout], [], [], LOOK)[0]:
        if time.monotonic() - begin > WAITS or _computed(process.pid) - computed > most:
            return False
    return True


def _computed(process: int) -> float:
    """Time that a process has computed [s]; the time of day where the system does not tell."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return time.monotonic()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _failed(number: int, why: str) -> dict[str, Any]:
    return {"number": number, "kind": "", "code": None, "seconds": HANGS, "wrong": [why], "arguments": [], "err": ""}
