"""ROS 1 and ROS 2 bags and MCAP files to tables, without ROS installed."""

import math
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from drake_tc.config.files import is_folder
from drake_tc.errors import LogError
from drake_tc.logs.bags.cut import is_cut, whole_bag
from drake_tc.logs.bags.joined import joined
from drake_tc.logs.bags.messages import EXTRACT, SENDER, Kind, Row, Stream, complete

SUFFIXES = (".mcap", ".db3", ".bag")
"""Files that hold bags; a folder with `metadata.yaml` is one, too."""
METADATA = "metadata.yaml"
REMEDIES = {
    "Truncated record": "; the file is damaged: `mcap recover IN.mcap -o OUT.mcap` may repair it",
    "seems to be empty": "; record it anew",
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
    streams, told = complete(list(read_streams(path).values())), _told_of_files(path)
    shared = dict.fromkeys(s.topic.partition(SENDER)[0] for s in streams if SENDER in s.topic)
    told += [f"Two nodes send joint states of the same joints on {topic}." for topic in shared]
    try:
        table = joined(streams, path, needed)
    except LogError as error:
        raise LogError(f"{error} ({' '.join(told)})" if told else str(error)) from None
    table.attrs["hints"] = [*told, *table.attrs["hints"]]
    return table


def read_streams(path: Path) -> dict[tuple[str, tuple[str, ...]], Stream]:
    """By topic and sorted columns, the rows of every message type that is known.

    Raises:
        LogError: as `read_bag`.
    """
    found: dict[tuple[str, tuple[str, ...]], Stream] = {}
    with _opened(path) as reader:
        requested = [connection for connection in reader.connections if connection.msgtype in EXTRACT]
        if requested:
            for connection, received, raw in reader.messages(connections=requested):
                message = reader.deserialize(raw, connection.msgtype)
                for row in EXTRACT[connection.msgtype](connection.topic, message):
                    _add(found, connection.topic, int(received), row)
    return found


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

    Args:
        path: See `read_bag`.

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
                info.msgtype in EXTRACT,
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
        files = _files(path)
        if not any(is_cut(file) for file in files):
            with _reader(path, path if (path / METADATA).is_file() or not is_folder(path) else files[0]) as reader:
                yield reader
            return
        with TemporaryDirectory() as folder, _reader(path, whole_bag(path, files, Path(folder))) as reader:
            yield reader
    except (OSError, sqlite3.Error) as error:
        raise LogError(f"{path}: cannot be read as a ROS bag: {_text_of(error)}{_remedy(_text_of(error))}") from None


@contextmanager
def _reader(path: Path, file: Path) -> Iterator[Any]:
    """The reader of the bag `file`; messages name `path`."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError:
        raise LogError(f"{path}: reading a ROS bag needs the package rosbags: pip install 'drake-tc[bags]'") from None
    try:
        with AnyReader([file], default_typestore=get_typestore(Stores.LATEST)) as reader:
            yield reader
    except LogError:
        raise
    except Exception as error:  # the reader's own errors, those of its decompressors and of the system
        reason = _text_of(error)
        raise LogError(f"{path}: cannot be read as a ROS bag: {reason}{_remedy(reason)}") from error


def _text_of(error: Exception) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:200].rstrip(".")


def _remedy(reason: str) -> str:
    return next((text for part, text in REMEDIES.items() if part in reason), "")
