"""Files of arrays: MATLAB's and NumPy's, of which nothing is believed before it is checked.

MATLAB files of versions 4 to 7: numeric arrays and structs of them, read here so that no damaged file ends Python.

The format is that of "MAT-File Format" (The MathWorks, 2024): a header of 128 bytes, and elements of a tag (type and
size) and data; version 4 has none of that, but matrices of a header of five numbers each. What is neither a number nor
a struct (texts, cells, objects, sparse matrices) is left out.

NPZ files (numpy's zip of arrays), of which nothing is believed before it is checked.
"""

import io
import math
import struct
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.config.files import check_size
from drake_tc.errors import LogError

Value = np.ndarray | dict[str, Any]
"""An array, or the fields of a struct, which are values too."""

HEADER = 128
MATRIX, COMPRESSED = 14, 15
STRUCT, COMPLEX, FIRST_NUMERIC, LAST_NUMERIC = 2, 0x0800, 6, 15
DEEPEST = 20
"""Structs in structs."""
NUMBERS: Mapping[int, str] = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
"""Types of data elements that hold numbers."""
NUMBERS_4 = ("f8", "f4", "i4", "i2", "u2", "u1")
"""The same of version 4."""


class _Damaged(Exception):
    """What is wrong with a file, behind "damaged: "."""


@dataclass
class _Bytes:
    """Content that is read from the start.

    Attributes:
        content: All of it.
        order: "<" or ">".
        at: Where reading goes on.
    """

    content: memoryview
    order: str
    at: int = 0

    def take(self, size: int) -> memoryview:
        """The next bytes."""
        if size < 0 or self.at + size > len(self.content):
            raise _Damaged(f"{size} bytes were expected at byte {self.at}, and {len(self.content) - self.at} are left")
        found = self.content[self.at : self.at + size]
        self.at += size
        return found

    def numbers(self, kind: str, count: int) -> np.ndarray:
        """The next numbers."""
        dtype = np.dtype(self.order + kind)
        return np.frombuffer(self.take(count * dtype.itemsize), dtype)

    def element(self) -> tuple[int, "_Bytes"]:
        """Type and data of the next element."""
        (word,) = struct.unpack(self.order + "I", self.take(4))
        if word >> 16:  # a small element: size and type in one word, and four bytes of data
            small = self.take(4)
            if word >> 16 > 4:
                raise _Damaged(f"a small element of {word >> 16} bytes")
            return word & 0xFFFF, _Bytes(small[: word >> 16], self.order)
        (size,) = struct.unpack(self.order + "I", self.take(4))
        data = self.take(size)
        if word != COMPRESSED:
            self.at = min(len(self.content), self.at + -size % 8)
        return word, _Bytes(data, self.order)

    @property
    def ended(self) -> bool:
        return self.at >= len(self.content)


def read_mat(path: Path) -> dict[str, Value]:
    """The numeric arrays and structs of a MATLAB file by name.

    Raises:
        LogError: No MATLAB file, one of version 7.3, or a damaged one.
    """
    content = memoryview(path.read_bytes())
    if bytes(content[:8]) == b"\x89HDF\r\n\x1a\n" or bytes(content[:10]) == b"MATLAB 7.3":
        raise LogError(f"{path}: MATLAB 7.3 file; save it with '-v7', or as CSV, Parquet or NPZ")
    try:
        if len(content) < 20:
            raise _Damaged(f"the file has {len(content)} bytes")
        return _version_4(content) if 0 in bytes(content[:4]) else _version_5(content, path)
    except zlib.error:
        raise LogError(f"{path}: cannot be read as .mat: the packed data are damaged; save it again") from None
    except _Damaged as error:
        raise LogError(f"{path}: cannot be read as .mat: {error}; save it again") from None


def _version_5(content: memoryview, path: Path) -> dict[str, Value]:
    mark = bytes(content[HEADER - 2 : HEADER])
    if mark not in (b"IM", b"MI"):
        raise _Damaged("its header has no mark of the byte order")
    file = _Bytes(content, "<" if mark == b"IM" else ">", HEADER)
    found: dict[str, Value] = {}
    unpacked = 0
    while not file.ended:
        kind, data = file.element()
        if kind == COMPRESSED:
            room = zlib.decompressobj()
            text = room.decompress(data.content, 2**31)
            unpacked += len(text)
            check_size(path, len(content), unpacked)
            kind, data = _Bytes(memoryview(text), file.order).element()
        if kind == MATRIX:
            name, value = _matrix(data, 0)
            if value is not None:
                found[name] = value
    return found


def _matrix(data: _Bytes, depth: int) -> tuple[str, Value | None]:
    """Name and value of a matrix element; None for what is left out."""
    if data.ended:
        return "", np.zeros((0, 0))
    flags = _sized(data, "u4", 2)
    kind, is_complex = int(flags[0]) & 0xFF, bool(int(flags[0]) & COMPLEX)
    shape = tuple(int(length) for length in _sized(data, "i4"))
    if not shape or any(length < 0 for length in shape) or prod(shape) > 2**40:
        raise _Damaged(f"an array of the shape {shape}")
    _, raw = data.element()
    name = bytes(raw.content).decode("latin-1").rstrip("\0")
    if kind == STRUCT:
        return name, _struct(data, shape, depth)
    if not FIRST_NUMERIC <= kind <= LAST_NUMERIC:
        return name, None
    real = _part(data, prod(shape))
    values = real + 1j * _part(data, prod(shape)) if is_complex else real
    return name, values.reshape(shape, order="F")


def _sized(data: _Bytes, kind: str, least: int = 0) -> np.ndarray:
    """The numbers of an element that describes an array."""
    _, raw = data.element()
    count = len(raw.content) // np.dtype(kind).itemsize
    if count < least:
        raise _Damaged(f"{count} numbers where {least} describe an array")
    return raw.numbers(kind, count)


def _part(data: _Bytes, count: int) -> np.ndarray:
    """(count,) real or imaginary part of an array, in the machine's byte order."""
    kind, raw = data.element()
    if kind not in NUMBERS:
        raise _Damaged(f"an array of numbers of type {kind}")
    values = raw.numbers(NUMBERS[kind], count)
    return values.astype(values.dtype.newbyteorder("="))


def _struct(data: _Bytes, shape: tuple[int, ...], depth: int) -> Value | None:
    """The fields of a single struct; None for an array of structs."""
    if depth > DEEPEST:
        raise _Damaged(f"more than {DEEPEST} structs in each other")
    width = int(_sized(data, "i4", 1)[0])
    _, raw = data.element()
    if width <= 0 or len(raw.content) % width:
        raise _Damaged(f"names of fields of {width} bytes")
    text = bytes(raw.content)
    names = [text[i : i + width].split(b"\0")[0].decode("latin-1") for i in range(0, len(text), width)]
    if prod(shape) != 1:
        return None
    fields: dict[str, Value] = {}
    for name in names:
        kind, inner = data.element()
        if kind != MATRIX:
            raise _Damaged(f"a field of type {kind}")
        _, value = _matrix(inner, depth + 1)
        if value is not None:
            fields[name] = value
    return fields


def _version_4(content: memoryview) -> dict[str, Value]:
    (first,) = struct.unpack("<i", content[:4])
    file = _Bytes(content, "<" if 0 <= first < 5000 else ">")
    found: dict[str, Value] = {}
    while not file.ended:
        code, rows, columns, imaginary, length = (int(number) for number in file.numbers("i4", 5))
        precision, kind = code // 10 % 10, code % 10
        if not (0 <= code < 5000 and precision < len(NUMBERS_4) and kind < 3 and min(rows, columns) >= 0):
            raise _Damaged(f"a matrix of the kind {code} and of {rows} by {columns}")
        name = bytes(file.take(length)).decode("latin-1").rstrip("\0")
        parts = [file.numbers(NUMBERS_4[precision], rows * columns) for _ in range(2 if imaginary else 1)]
        if kind == 0:
            values = parts[0] + 1j * parts[1] if imaginary else parts[0]
            found[name] = values.astype(values.dtype.newbyteorder("=")).reshape((rows, columns), order="F")
    return found


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
        raise LogError(f"{path}: cannot be read as .npz: {error.strerror or 'it is damaged'}; save it again") from None
    except DAMAGED as error:
        raise LogError(f"{path}: cannot be read as .npz: {error}; save it again") from None


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
        raise LogError(f"{where} is cut: its header states {expected} bytes, and it has {there}; save it again")
    values = np.frombuffer(content.read(), dtype) if expected else np.zeros(0, dtype)
    return values.reshape(shape, order="F" if by_columns else "C").copy()
