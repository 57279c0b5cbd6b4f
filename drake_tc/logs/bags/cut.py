"""Bags that end early, as after a power failure or a copy that was broken off: what is whole in them, as a new file.

MCAP (mcap.dev/spec): records of an opcode, a length and content, some of them packed into chunks; a footer ends the
file. SQLite (sqlite.org/fileformat2): the header states the number of pages.
"""

import io
import shutil
import sqlite3
import struct
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import IO, Any

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END, FOOTER = 0x03, 0x04, 0x05, 0x06, 0x0F, 0x02
CHUNK_HEADER = 28
"""Bytes of a chunk before the name of its compression."""
SQLITE_MAGIC = b"SQLite format 3\0"
TABLES = ("schema", "metadata", "topics", "message_definitions", "messages")
"""Of a bag in SQLite."""


def is_cut(path: Path) -> bool:
    """Whether the file of a bag (.mcap, .db3) ends before what its format demands."""
    with path.open("rb") as file:
        begin = file.read(len(MAGIC))
        size = file.seek(0, io.SEEK_END)
        if path.suffix.lower() == ".mcap":
            file.seek(max(0, size - len(MAGIC)))
            return begin == MAGIC and (size < 2 * len(MAGIC) or file.read() != MAGIC)
        if path.suffix.lower() != ".db3" or size < 100:
            return False
        file.seek(0)
        header = file.read(100)
    pages, width = struct.unpack(">I", header[28:32])[0], struct.unpack(">H", header[16:18])[0]
    return header.startswith(SQLITE_MAGIC) and size < pages * (65536 if width == 1 else width)


def whole_part(path: Path, to: Path) -> Path:
    """Write what is whole in a bag's file that is cut to the file `to`.

    Raises:
        OSError, sqlite3.Error: nothing can be read or written.
    """
    return _of_mcap(path, to) if path.suffix.lower() == ".mcap" else _of_sqlite(path, to)


def _of_mcap(path: Path, to: Path) -> Path:
    """All records that are whole, those in a chunk that is cut included, and a footer without an index."""
    size = path.stat().st_size
    with path.open("rb") as file, to.open("wb") as mended:
        end, opcode = len(MAGIC), 0
        file.seek(end)
        while len(head := file.read(9)) == 9:
            opcode, length = head[0], struct.unpack("<Q", head[1:])[0]
            if opcode in (DATA_END, FOOTER) or end + 9 + length > size:
                break
            end = file.seek(end + 9 + length)
        file.seek(end)
        rest = file.read(size - end) if opcode == CHUNK else b""
        file.seek(0)
        _copy(file, mended, end)
        for kind, content in _records(_unpacked(rest[9:])):
            if kind in (SCHEMA, CHANNEL, MESSAGE):
                mended.write(struct.pack("<BQ", kind, len(content)) + content)
        mended.write(struct.pack("<BQQQI", FOOTER, 20, 0, 0, 0) + MAGIC)
    return to


def _copy(file: IO[bytes], to: IO[bytes], size: int) -> None:
    while size > 0 and (part := file.read(min(size, 2**24))):
        to.write(part)
        size -= len(part)


def _unpacked(chunk: bytes) -> bytes:
    """The beginning of the records in a chunk that is cut; empty where nothing of it can be unpacked."""
    if len(chunk) < CHUNK_HEADER + 4:
        return b""
    (length,) = struct.unpack_from("<I", chunk, CHUNK_HEADER)
    begin = CHUNK_HEADER + 4 + length
    packed = chunk[begin + 8 :]
    name = chunk[CHUNK_HEADER + 4 : begin]
    if not name:
        return packed
    try:
        return bytes(_unpacker(name.decode()).decompress(packed))
    except Exception:  # an unknown compression, or the unpackers' own errors: nothing of the chunk is usable
        return b""


def _unpacker(compression: str) -> Any:
    """What unpacks a chunk piece by piece. rosbags brings these packages; Python 3.14 has zstd of its own."""
    if compression == "lz4":
        return import_module("lz4.frame").LZ4FrameDecompressor()
    try:
        return import_module(f"compression.{compression}").ZstdDecompressor()
    except ModuleNotFoundError:
        return import_module(f"backports.{compression}").ZstdDecompressor()


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of the records that are whole."""
    at = 0
    while at + 9 <= len(content):
        kind, length = content[at], struct.unpack_from("<Q", content, at + 1)[0]
        if at + 9 + length > len(content):
            return
        yield kind, content[at + 9 : at + 9 + length]
        at += 9 + length


def _of_sqlite(path: Path, to: Path) -> Path:
    """The tables of a bag, and their rows up to the first that cannot be read."""
    to.unlink(missing_ok=True)
    old = sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)
    new = sqlite3.connect(to)
    try:
        old.execute("PRAGMA writable_schema=ON")  # SQLite then believes the size of the file, not of its header
        tables = old.execute("SELECT name, sql FROM sqlite_master WHERE type='table'").fetchall()
        for name, statement in tables:
            if name not in TABLES:
                continue
            new.execute(statement)
            rows = old.execute(f'SELECT * FROM "{name}" ORDER BY rowid')
            try:
                for row in rows:
                    new.execute(f'INSERT INTO "{name}" VALUES ({", ".join("?" * len(row))})', row)
            except sqlite3.DatabaseError:
                continue
        new.commit()
    finally:
        old.close()
        new.close()
    return to


def whole_bag(path: Path, files: list[Path], folder: Path) -> Path:
    """The bag with each cut file replaced by what is whole in it: in `folder`, a file or the folder of a bag.

    Args:
        path: Of the bag.
        files: Its files.
        folder: To write to.
    """
    if len(files) == 1:
        return whole_part(files[0], folder / files[0].name)
    for file in path.iterdir():
        if file in files and is_cut(file):
            whole_part(file, folder / file.name)
        elif file.is_file():
            (folder / file.name).symlink_to(file.resolve()) if file in files else shutil.copy(file, folder)
    return folder
