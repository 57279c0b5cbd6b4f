"""A process that reads a MATLAB file with SciPy and writes its arrays into an NPZ; its caller survives a crash."""

import resource
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from drake_tc.config.files import LARGEST, check_size
from drake_tc.errors import LogError

MARK = "_"
"""Before each name in the NPZ: `numpy.savez` has an argument `file`, and a variable may have that name."""
SCRATCH = 2**30
"""Memory beside the content of the file [bytes]."""


def numeric(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """(name, array) of an array of numbers, or of each field of a struct.

    Args:
        name: Of the value.
        value: As SciPy gives it.
    """
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from numeric(f"{name}/{field}", value[field].item())
    elif value.dtype.kind in "biufc":
        yield name, value


def main(source: str, target: str) -> str | None:
    """Read one file and write the other.

    Returns:
        What is wrong with the file; None where nothing is.
    """
    path = Path(source)
    if sys.platform == "linux":
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + LARGEST + SCRATCH, used + LARGEST + SCRATCH))
    try:
        values = loadmat(path, appendmat=False)
        found = dict(pair for name, value in values.items() for pair in numeric(name, value))
        check_size(path, path.stat().st_size, sum(array.nbytes for array in found.values()))
    except LogError as error:
        return str(error)
    except Exception as error:  # damaged bytes raise errors of any kind
        return " ".join(f"{type(error).__name__} {error}".split())
    named: dict[str, Any] = {MARK + name: array for name, array in found.items()}
    np.savez(target, **named)
    return None


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
