"""Starts workers, and goes on with the next case where one hangs or crashes."""

import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

from .sound import REPOSITORY

HANGS = 20.0
"""A case that takes longer hangs [s]."""
STARTING = 120.0
"""A worker that says nothing for so long at its start has failed [s]."""


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
    running, patience = first, STARTING
    try:
        while select.select([stream], [], [], patience)[0]:
            line = stream.readline()
            if not line:
                if running < last:
                    yield _failed(running, f"the process ended with {process.wait()}")
                return
            found = json.loads(line)
            patience = HANGS
            if "begin" in found:
                running = found["begin"]
            else:
                running = found["number"] + 1
                yield found
        yield _failed(running, f"hangs for {patience:.0f} s")
    finally:
        process.kill()
        process.wait()
        stream.close()
        shutil.rmtree(folder, ignore_errors=True)


def _failed(number: int, why: str) -> dict[str, Any]:
    return {"number": number, "kind": "", "code": None, "seconds": HANGS, "wrong": [why], "arguments": [], "err": ""}
