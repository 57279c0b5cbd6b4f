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
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from drake_tc.config.files import LARGEST, check_size
from drake_tc.errors import LogError

PATIENCE = 600.0
"""For a MATLAB file of the largest size [s]."""
MARK, LEFT_OUT = "_", "-"
"""Before each name in the NPZ: `numpy.savez` has an argument `file`, and a variable may have that name. The second
stands before what cannot be read."""
OPAQUE = ("s0", "s1", "s2", "arr")
"""Parts in which SciPy keeps an object of a MATLAB class; the first is the name of the variable."""
LABELS = ("label", "name", "blockname")
"""Fields of an array of structs that name its elements, as those of a Simulink scope do."""
SCRATCH = 2**30
"""Memory beside the content of the file [bytes]."""


def read_mat(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a MATLAB file of the versions 4 to 7 by name; a field of a struct is called `struct/field`.

    Elements of an array of structs have their label or number in place of `field`, and cells of texts are an array.
    What cannot be read (other cells, objects such as a `timeseries`, sparse matrices) is an array of type object.

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
            found = read_arrays(out).items()
            return {name[1:]: array if name.startswith(MARK) else unread() for name, array in found}
    told = done.stderr.decode("utf-8", "replace") if done.returncode == 1 else ""
    why = (told.splitlines() or ["it is damaged"])[-1]
    raise LogError(why if why.startswith(str(path)) else f"{path}: cannot be read as .mat: {why[:200]}; save it again")


def unread() -> np.ndarray:
    """What stands for the content of an array that cannot be read."""
    return np.empty((), dtype=object)


def read_array(path: Path) -> dict[str, np.ndarray]:
    """The array of an .npy file, with the name of the file.

    Raises:
        LogError: Damaged, or objects of Python, which only `pickle` reads.
    """
    with path.open("rb") as file:
        array = _array(file, f"{path}: it")
    if array.dtype.kind == "O":
        raise LogError(f"{path}: it holds Python objects, which are not unpacked; save its arrays with numpy.savez")
    return {path.stem: array}


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz file by name; one of Python objects, which only `pickle` reads, is empty.

    Raises:
        LogError: No zip file, damaged, encrypted, larger unpacked than a recording can be, or no array in it.
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
        version = np.lib.format.read_magic(member)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        if header(member)[2].hasobject:
            return unread()
        member.seek(0)
        return np.asarray(np.lib.format.read_array(member, allow_pickle=False))
    except (zipfile.BadZipFile, zlib.error, EOFError):
        raise
    except Exception as error:  # the header is Python text, and what parses it raises errors of many kinds
        why = " ".join(str(error).split())[:200]
        raise LogError(f"{where} is no array of numbers that can be read ({why}); save it with numpy.savez") from None


def _members(name: str, value: Any) -> Iterator[tuple[str, np.ndarray | None]]:
    """(name, array) of an array of numbers or texts, or of each field of a struct; None for what cannot be read."""
    if not isinstance(value, np.ndarray):
        if not name.startswith("__"):  # notes of SciPy on the file
            yield name, None
    elif value.dtype.names == OPAQUE:
        yield value["s0"].item().decode("utf-8", "replace"), None
    elif value.dtype.kind == "O" and value.size and all(map(_text, value.flat)):
        yield name, np.array([_text(each) for each in value.flat])
    elif value.dtype.names or (value.dtype.kind == "O" and all(_is_struct(each) for each in value.flat)):
        elements = [each.flat[0] if isinstance(each, np.ndarray) else each for each in value.flat]
        labels = _labels(elements)
        for label, element in zip(labels, elements, strict=True):
            owner = name if value.size == 1 else f"{name}/{label}"
            for field in element.dtype.names:
                yield from _members(f"{owner}/{field}", element[field])
    else:
        yield name, value if value.dtype.kind in "biufcU" else None


def _is_struct(cell: Any) -> bool:
    return isinstance(cell, np.ndarray) and bool(cell.dtype.names) and cell.dtype.names != OPAQUE and cell.size == 1


def _labels(elements: Sequence[np.void]) -> list[str]:
    """What the elements of an array of structs are called: their labels where all differ, else numbers."""
    for field in LABELS:
        own = [next((_text(each[f]) for f in each.dtype.names or () if f.lower() == field), "") for each in elements]
        if all(own) and len(set(own)) == len(own):
            return own
    return [str(number) for number in range(len(elements))]


def _text(value: Any) -> str:
    """The text of a cell or of a field; empty if it holds another thing."""
    return str(value.item()) if isinstance(value, np.ndarray) and value.dtype.kind == "U" and value.size == 1 else ""


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
        found = dict(pair for name, value in values.items() for pair in _members(name, value))
        check_size(path, path.stat().st_size, sum(0 if array is None else array.nbytes for array in found.values()))
    except LogError as error:
        return str(error)
    except Exception as error:  # damaged bytes raise errors of any kind
        return " ".join(f"{type(error).__name__} {error}".split())
    named: dict[str, Any] = {
        (LEFT_OUT if array is None else MARK) + name: 0.0 if array is None else array for name, array in found.items()
    }
    np.savez(target, **named)
    return None


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
