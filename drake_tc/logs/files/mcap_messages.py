"""MCAP files whose messages are JSON or Protobuf, as recorders without ROS write them.

Every value of a message is a column, with the name that `json_log` gives it. If there are several topics, the topic
comes before the name, the times are those of the recording, and the table has the rows of all topics. A single topic
has the times in its messages, if there are any.
"""

import json
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drake_tc.config.files import check_size, is_file
from drake_tc.errors import LogError
from drake_tc.logs.files.bag import CHANNEL, CHUNK, MAGIC, MESSAGE, SCHEMA, is_cut, records, unpacked
from drake_tc.logs.files.json_log import sample
from drake_tc.logs.files.table_forms import of_series
from drake_tc.logs.names import time_among

HEADER = 0x01
MESSAGE_HEADER = struct.Struct("<HIQQ")
"""Channel, number, and times of recording and sending [ns]."""
Decoder = Callable[[bytes], Any]


def is_without_ros(path: Path) -> bool:
    """Whether a path is an MCAP file whose profile is none of ROS."""
    if path.suffix.lower() != ".mcap" or not is_file(path):
        return False
    with path.open("rb") as file:
        begin = file.read(4096)
    first = next(records(begin[len(MAGIC) :]), (0, b""))
    return begin.startswith(MAGIC) and first[0] == HEADER and not _text(first[1], 0)[0].startswith("ros")


def read_messages(path: Path) -> pd.DataFrame:
    """The messages of an MCAP file of JSON or Protobuf as a table.

    Raises:
        LogError: No message of these encodings, or one that cannot be decoded.
    """
    schemas: dict[int, tuple[str, bytes]] = {}
    channels: dict[int, tuple[str, str, Decoder | None]] = {}
    rows: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    left_out: Counter[str] = Counter()
    check_size(path, path.stat().st_size, float(path.stat().st_size))
    for kind, content in _every_record(path.read_bytes()[len(MAGIC) :]):
        if kind == SCHEMA:
            name, at = _text(content, 2)
            schemas[struct.unpack_from("<H", content)[0]] = name, content[_text(content, at)[1] + 4 :]
        elif kind == CHANNEL:
            number, schema = struct.unpack_from("<HH", content)
            topic, at = _text(content, 4)
            encoding = _text(content, at)[0]
            channels[number] = topic, encoding, _decoder(encoding, *schemas.get(schema, ("", b"")), path)
        elif kind == MESSAGE:
            number, _, recorded, _ = MESSAGE_HEADER.unpack_from(content)
            topic, encoding, decode = channels[number]
            if decode is None:
                left_out[f"{topic} ({encoding})"] += 1
            else:
                value = decode(content[MESSAGE_HEADER.size :])
                rows.setdefault(topic, []).append(
                    (recorded, sample(value if isinstance(value, dict) else {topic: value}))
                )
    if not rows:
        came = ", ".join(left_out) or "no messages"
        raise LogError(f"{path}: expected messages in JSON or Protobuf, or a file with a ROS profile, got {came}")
    table = _table(rows)
    notes = [f"The messages of {', '.join(rows)} were read."]
    notes += [f"The messages of {', '.join(left_out)} cannot be read."] if left_out else []
    notes += [f"The file {path.name} is cut off; it was read up to the cut."] if is_cut(path) else []
    table.attrs["notes"] = notes
    return table


def _table(rows: dict[str, list[tuple[int, dict[str, Any]]]]) -> pd.DataFrame:
    first = min(own[0][0] for own in rows.values())
    series = []
    for topic, own in rows.items():
        values = pd.DataFrame.from_records([row for _, row in own])
        if len(rows) == 1 and time_among(map(str, values.columns)):
            return values
        values.index = pd.Index(1e-9 * (np.array([recorded for recorded, _ in own]) - first))
        series += [values[name].rename(name if len(rows) == 1 else f"{topic}/{name}") for name in values.columns]
    return of_series(series, "time")


def _every_record(content: bytes) -> Iterator[tuple[int, bytes]]:
    """The records of a file, those in its chunks included."""
    for kind, own in records(content):
        if kind == CHUNK:
            yield from records(unpacked(own))
        else:
            yield kind, own


def _text(content: bytes, at: int) -> tuple[str, int]:
    """A text behind its length, and where it ends."""
    end = at + 4 + struct.unpack_from("<I", content, at)[0]
    return content[at + 4 : end].decode("utf-8", "replace"), end


def _decoder(encoding: str, name: str, schema: bytes, path: Path) -> Decoder | None:
    """What reads the messages of a channel, for Protobuf by a FileDescriptorSet; None for other encodings."""
    if encoding == "json":
        return json.loads
    if encoding != "protobuf":
        return None
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory
    except ModuleNotFoundError:
        raise LogError(f"{path}: Protobuf messages need the package protobuf: pip install 'drake-tc[bags]'") from None
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(name))

    def decode(content: bytes) -> Any:
        message = kind.FromString(content)
        return json_format.MessageToDict(
            message, always_print_fields_with_no_presence=True, preserving_proto_field_name=True
        )

    return decode
