"""NPZ files (numpy's zip of arrays), of which nothing is believed before it is checked."""

import io
import math
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.errors import LogError
from drake_tc.logs.sizes import check_size

ENCRYPTED = 0x1
"""Flag of a member of a zip file."""

DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    NotImplementedError,
    RuntimeError,
    UnicodeDecodeError,
)
"""What Python's zip reader raises for damaged files."""


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz file by name.

    Raises:
        LogError: No zip file, damaged, encrypted, larger unpacked than a recording can be, or a member that is no
            array of numbers or texts.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            check_size(path, path.stat().st_size, sum(info.file_size for info in archive.infolist()))
            return {info.filename.removesuffix(".npy"): _array(archive, info, path) for info in archive.infolist()}
    except OSError as error:  # a damaged directory points outside of the file
        raise LogError(f"{path}: cannot be read as .npz: {error.strerror or 'it is damaged'}; save it anew") from None
    except DAMAGED as error:
        raise LogError(f"{path}: cannot be read as .npz: {error}; save it anew") from None


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, path: Path) -> np.ndarray:
    """One member."""
    where = f"{path}: {info.filename!r}"
    if info.flag_bits & ENCRYPTED:
        raise LogError(f"{where} is encrypted; save the arrays without a password")
    content = io.BytesIO(archive.read(info))
    try:
        version = np.lib.format.read_magic(content)
        header: Any = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_columns, dtype = header(content)
    except Exception:  # the header is Python text, and what parses it raises errors of many kinds
        raise LogError(f"{where} is not an array of an .npz file; save it with numpy.savez") from None
    if dtype.hasobject:
        raise LogError(f"{where} holds Python objects; expected an array of numbers")
    expected, there = math.prod(shape) * dtype.itemsize, len(content.getvalue()) - content.tell()
    if expected != there or any(length < 0 for length in shape):
        raise LogError(f"{where} is cut: its header states {expected} bytes, and it has {there}; save it anew")
    values = np.frombuffer(content.read(), dtype) if expected else np.zeros(0, dtype)
    return values.reshape(shape, order="F" if by_columns else "C").copy()
