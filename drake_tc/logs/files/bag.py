"""ROS 1 and ROS 2 bags and MCAP files to tables, without ROS installed.

Of a bag that ends early, as after a power failure or a copy that was broken off, what is whole is read as a new file.
MCAP (mcap.dev/spec): records of an opcode, a length and content, some of them packed into chunks; a footer ends the
file. SQLite (sqlite.org/fileformat2): the header states the number of pages.
"""

import io
import math
import shutil
import sqlite3
import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from drake_tc.config.files import is_folder
from drake_tc.errors import LogError
from drake_tc.logs.files.bag_joined import joined
from drake_tc.logs.files.bag_messages import (
    EXTRACT,
    SENDER,
    Extract,
    Kind,
    Row,
    Stream,
    complete,
    named_vectors,
    names_its_joints,
)

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


def _whole_part(path: Path, to: Path) -> Path:
    """Write what is whole in a bag's file that is cut to the file `to`."""
    return _of_mcap(path, to) if path.suffix.lower() == ".mcap" else _of_sqlite(path, to)


def _of_mcap(path: Path, to: Path) -> Path:
    """All records that are whole, those in a chunk that is cut included, and a footer without an index."""
    shutil.copyfile(path, to)
    size, end, opcode = path.stat().st_size, len(MAGIC), 0
    with to.open("r+b") as file:
        file.seek(end)
        while len(head := file.read(9)) == 9:
            opcode, length = head[0], struct.unpack("<Q", head[1:])[0]
            if opcode in (DATA_END, FOOTER) or end + 9 + length > size:
                break
            end = file.seek(end + 9 + length)
        file.seek(end)
        rest = file.read() if opcode == CHUNK else b""
        file.truncate(file.seek(end))
        for kind, content in records(unpacked(rest[9:])):
            if kind in (SCHEMA, CHANNEL, MESSAGE):
                file.write(struct.pack("<BQ", kind, len(content)) + content)
        file.write(struct.pack("<BQQQI", FOOTER, 20, 0, 0, 0) + MAGIC)
    return to


def unpacked(chunk: bytes) -> bytes:
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


def records(content: bytes) -> Iterator[tuple[int, bytes]]:
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


def _whole_bag(path: Path, files: list[Path], folder: Path) -> Path:
    """The bag with each cut file replaced by what is whole in it: in `folder`, a file or the folder of a bag."""
    if len(files) == 1:
        return _whole_part(files[0], folder / files[0].name)
    for file in path.iterdir():
        if file in files and is_cut(file):
            _whole_part(file, folder / file.name)
        elif file.is_file():
            (folder / file.name).symlink_to(file.resolve()) if file in files else shutil.copy(file, folder)
    return folder


SUFFIXES = (".mcap", ".db3", ".bag")
"""Files that hold bags; a folder with `metadata.yaml` is one, too."""
METADATA = "metadata.yaml"
REMEDIES = {
    "Truncated record": "; the file is damaged: `mcap recover IN.mcap -o OUT.mcap` may repair it",
    "seems to be empty": "; record it again",
    "malformed": "; the file is damaged: `sqlite3 IN.db3 .recover | sqlite3 OUT.db3`, then `ros2 bag"
    " reindex` of its folder, may repair it",
    "database files are missing": "; put the .db3 or .mcap file beside metadata.yaml, or run `ros2 bag reindex`",
    "not indexed": "; `rosbag reindex` repairs it",
}
"""What a reason of the reader means and what to do, by words of the reason."""


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: a folder with its metadata or with one bag's file alone, or a file by its ending."""
    if not is_folder(path):
        return path.name.lower().endswith(SUFFIXES)
    return (path / METADATA).is_file() or sum(each.name.lower().endswith(SUFFIXES) for each in path.iterdir()) == 1


def read_bag(path: Path, needed: Collection[str] = ()) -> pd.DataFrame:
    """The joints' states and commands, IMUs and wrenches of a bag, on the clock of the joint states.

    Columns have canonical names; an effort is `<joint>/effort`, as drivers mean different things by it. What was joined
    how is in `attrs["notes"]`. Messages stream through: only numbers of the types that are known stay in memory.

    Args:
        path: A ROS 2 bag (its folder, or one .mcap or .db3 file) or a ROS 1 bag (.bag).
        needed: Columns that the caller uses: the topic with their positions gives the clock.

    Raises:
        LogError: no bag, damaged, without joint states; or the package that reads bags is missing.
    """
    found, undefined = _read_streams(path)
    streams, told = complete(list(found.values())), _told_of_files(path)
    told += [
        f"{topic} was not read, because the bag has no definition of its messages ({kind}); `ros2 bag convert` to MCAP"
        " adds it."
        for topic, kind in undefined.items()
    ]
    shared = dict.fromkeys(s.topic.partition(SENDER)[0] for s in streams if SENDER in s.topic)
    told += [f"Two nodes send joint states of the same joints on {topic}." for topic in shared]
    try:
        table = joined(streams, path, needed)
    except LogError as error:
        unread = [f"{each.name} ({each.kind})" for each in topics(path) if not each.read]
        told += [f"Topics of other types: {', '.join(unread[:20])}."] if unread else []
        raise LogError(f"{error} ({' '.join(told)})" if told else str(error)) from None
    table.attrs["hints"] = [*told, *table.attrs["hints"]]
    return table


def _read_streams(path: Path) -> tuple[dict[tuple[str, tuple[str, ...]], Stream], dict[str, str]]:
    """By topic and sorted columns, the rows of every message type that is known; and topics without a definition."""
    found: dict[tuple[str, tuple[str, ...]], Stream] = {}
    with _opened(path) as reader:
        readers = {
            kind: extract for kind in {c.msgtype for c in reader.connections} if (extract := _extract(reader, kind))
        }
        known = [connection for connection in reader.connections if connection.msgtype in readers]
        requested = [each for each in known if _is_defined(reader, each.msgtype)]
        undefined = {each.topic: each.msgtype for each in known if each not in requested}
        if requested:
            for connection, received, raw in reader.messages(connections=requested):
                message = reader.deserialize(raw, connection.msgtype)
                for row in readers[connection.msgtype](connection.topic, message):
                    _add(found, connection.topic, int(received), row)
    return found, undefined


def _extract(reader: Any, kind: str) -> Extract | None:
    """What reads the messages of a type; None for a type without numbers of joints."""
    if kind in EXTRACT or not _is_defined(reader, kind):
        return EXTRACT.get(kind)
    return named_vectors if names_its_joints(reader.typestore.fielddefs[kind][1]) else None


def _is_defined(reader: Any, kind: str) -> bool:
    """Whether the reader knows the fields of a type: SQLite bags of older distributions have no definitions."""
    return kind in reader.typestore.fielddefs


@dataclass(frozen=True)
class Topic:
    """One topic of a bag.

    Attributes:
        name: Of the topic.
        kind: Its message type.
        messages: How many.
        rate: Mean rate over the bag [Hz]; NaN with fewer than two messages.
        read: Whether messages of this type become columns.
    """

    name: str
    kind: str
    messages: int
    rate: float
    read: bool


def topics(path: Path) -> tuple[Topic, ...]:
    """The topics of a bag, by name.

    Raises:
        LogError: as `read_bag`.
    """
    with _opened(path) as reader:
        seconds = 1e-9 * float(reader.duration)
        return tuple(
            Topic(
                name,
                str(info.msgtype),
                int(info.msgcount),
                (info.msgcount - 1) / seconds if info.msgcount > 1 and seconds > 0.0 else math.nan,
                _extract(reader, str(info.msgtype)) is not None and _is_defined(reader, info.msgtype),
            )
            for name, info in sorted(reader.topics.items())
        )


def _add(found: dict[tuple[str, tuple[str, ...]], Stream], topic: str, received: int, row: Row) -> None:
    """Append a row to the stream of its topic and columns, whose order the first message gives."""
    stream = found.setdefault((topic, tuple(sorted(row.names))), Stream(topic, row.kind, row.names))
    values = row.values
    if stream.names != row.names:
        value_of = dict(zip(row.names, row.values, strict=True))
        values = [value_of[name] for name in stream.names]
    if row.first and row.kind is Kind.planned:
        stream.replan(row.stamp, received)
    stream.add(row.stamp + row.after if row.stamp else 0, received + row.after, values)


def _files(path: Path) -> list[Path]:
    """The files of a bag's folder, or the file itself."""
    return sorted(each for each in path.iterdir() if is_bag(each)) if is_folder(path) else [path]


def _told_of_files(path: Path) -> list[str]:
    """What is missing of a bag: its end, or its metadata."""
    files = _files(path)
    told = [
        f"The file {file.name} is cut off, as after a recording that was not stopped; it was read up to the cut."
        for file in files
        if is_cut(file)
    ]
    if is_folder(path) and not (path / METADATA).is_file():
        told.append(f"The folder has no {METADATA}; its only bag file, {files[0].name}, was read.")
    return told


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The reader of a bag, or of what is whole in one that is cut; whatever goes wrong with the bag is one line."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError:
        raise LogError(f"{path}: reading a ROS bag needs the package rosbags: pip install 'drake-tc[bags]'") from None
    try:
        files = _files(path)
        alone = is_folder(path) and not (path / METADATA).is_file()
        with TemporaryDirectory() as folder:
            whole = _whole_bag(path, files, Path(folder)) if any(map(is_cut, files)) else files[0] if alone else path
            with AnyReader([whole], default_typestore=get_typestore(Stores.LATEST)) as reader:
                yield reader
    except LogError:
        raise
    except Exception as error:  # the reader's own errors, those of its decompressors and of the system
        reason = (" ".join(str(error).split()) or type(error).__name__)[:200].rstrip(".")
        remedy = next((text for part, text in REMEDIES.items() if part in reason), "")
        raise LogError(f"{path}: cannot be read as a ROS bag: {reason}{remedy}") from error
