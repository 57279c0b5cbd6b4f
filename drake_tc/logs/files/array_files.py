"""Files of arrays: MATLAB's, read by SciPy, and NumPy's.

A damaged MATLAB file may end the process in which SciPy reads it, or fill the memory. It is therefore read in a process
of its own (`main`), whose memory is limited. NumPy's reader is Python, and unpacks no more than is checked.
"""

import os
import struct
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from drake_tc.config.files import LARGEST, check_size
from drake_tc.errors import LogError

PATIENCE = 600.0
"""For a MATLAB file of the largest size [s]."""
MARK = "_"
"""Before each name in the NPZ: `numpy.savez` has an argument `file`, and a variable may have that name."""
SCRATCH = 2**30
"""Memory beside the content of the file [bytes]."""


def read_mat(path: Path) -> dict[str, np.ndarray]:
    """The numeric arrays of a MATLAB file of the versions 4 to 7 by name; a field of a struct is called `struct/field`.

    What is neither a number nor a struct (texts, cells, objects, sparse matrices) is left out.

    Raises:
        LogError: No MATLAB file, one of version 7.3, a damaged one, or one that is larger than a recording can be.
    """
    with path.open("rb") as file:
        start = file.read(10)
    if start[:8] == b"\x89HDF\r\n\x1a\n" or start == b"MATLAB 7.3":
        raise LogError(f"{path}: MATLAB 7.3 file; save it with '-v7', or as CSV, Parquet or NPZ")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "arrays.npz"
        command = [sys.executable, "-m", "drake_tc.logs.files.array_files", str(path), str(out)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        try:
            done = subprocess.run(command, capture_output=True, env=environment, timeout=PATIENCE, check=False)
        except subprocess.TimeoutExpired:
            raise LogError(f"{path}: cannot be read as .mat within {PATIENCE:g} s; save it again") from None
        if done.returncode == 0:
            return {name.removeprefix(MARK): array for name, array in read_arrays(out).items()}
    told = done.stderr.decode("utf-8", "replace") if done.returncode == 1 else ""
    why = (told.splitlines() or ["it is damaged"])[-1]
    raise LogError(why if why.startswith(str(path)) else f"{path}: cannot be read as .mat: {why[:200]}; save it again")


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz file by name.

    Raises:
        LogError: No zip file, damaged, encrypted, larger unpacked than a recording can be, or a member that is no
            array of numbers or texts.
    """
    found = {}
    try:
        with zipfile.ZipFile(path) as archive:
            check_size(path, path.stat().st_size, sum(info.file_size for info in archive.infolist()))
            for info in archive.infolist():
                with archive.open(info) as member:
                    found[info.filename.removesuffix(".npy")] = _array(member, f"{path}: {info.filename!r}")
    except OSError as error:  # a damaged directory points outside of the file
        raise LogError(f"{path}: cannot be read as .npz: {error.strerror or 'it is damaged'}; save it again") from None
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: cannot be read as .npz: {error}; save it again") from None
    return found


def _array(member: IO[bytes], where: str) -> np.ndarray:
    """One member; errors of the zip file are passed on."""
    try:
        return np.asarray(np.lib.format.read_array(member, allow_pickle=False))
    except (zipfile.BadZipFile, zlib.error, EOFError):
        raise
    except Exception as error:  # the header is Python text, and what parses it raises errors of many kinds
        why = " ".join(str(error).split())[:200]
        raise LogError(f"{where} is no array of numbers that can be read ({why}); save it with numpy.savez") from None


def _numeric(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """(name, array) of an array of numbers, or of each field of a struct."""
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _numeric(f"{name}/{field}", value[field].item())
    elif value.dtype.kind in "biufc":
        yield name, value


def main(source: str, target: str) -> str | None:
    """Read one file and write the other.

    Returns:
        What is wrong with the file; None where nothing is.
    """
    from scipy.io import loadmat

    path = Path(source)
    if sys.platform == "linux":
        import resource

        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + LARGEST + SCRATCH, used + LARGEST + SCRATCH))
    try:
        values = loadmat(path, appendmat=False)
        found = dict(pair for name, value in values.items() for pair in _numeric(name, value))
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
