"""MCAP files of recorders without ROS, written here as the specification says."""

import json
import struct

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from numpy.testing import assert_allclose

from drake_tc.errors import LogError
from drake_tc.logs.files.readers import read_table
from drake_tc.logs.inspection import inspect_log, trial

TIME = np.arange(400) / 200.0
POSITION = np.sin(3.0 * TIME)
GOAL = POSITION + 0.1 * np.cos(TIME)


def text(content: str | bytes) -> bytes:
    raw = content.encode() if isinstance(content, str) else content
    return struct.pack("<I", len(raw)) + raw


def record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def mcap(path, encoding, topics, *, schema=("State", "jsonschema", b""), chunked=False):
    """A file of one channel for each topic, whose messages (T) are recorded at the times."""
    body = b""
    for number, (topic, messages) in enumerate(topics.items(), 1):
        body += record(3, struct.pack("<H", number) + b"".join(map(text, schema)))
        body += record(4, struct.pack("<HH", number, number) + text(topic) + text(encoding) + text(b""))
        for t, message in zip(TIME, messages, strict=True):
            body += record(5, struct.pack("<HIQQ", number, 0, 10**18 + round(1e9 * t), 0) + message)
    if chunked:
        body = record(6, bytes(28) + text("") + struct.pack("<Q", len(body)) + body)
    end = record(15, bytes(4)) + record(2, bytes(20))
    path.write_bytes(b"\x89MCAP0\r\n" + record(1, text("") + text("here")) + body + end + b"\x89MCAP0\r\n")
    return path


def states(values, **more):
    return [json.dumps({"name": ["hip", "knee"], "position": [q, -q], **more}).encode() for q in values]


@pytest.mark.parametrize("chunked", [False, True])
def test_messages_in_json(tmp_path, chunked):
    topics = {"/joint_states": states(POSITION), "/joint_command": states(GOAL)}
    path = mcap(tmp_path / "run.mcap", "json", topics, chunked=chunked)
    table = read_table(path)
    assert_allclose(table["time"], TIME, atol=1e-9)
    assert_allclose(table["/joint_states/knee/position"], -POSITION)
    found = inspect_log(path)
    assert trial(found) == "" and found.rig["columns"]["hip/position_command"] == "/joint_command/hip/position"


def test_messages_of_one_topic_with_times_and_a_cut(tmp_path):
    lines = [json.dumps({"t": t, "knee": {"position": q}}).encode() for t, q in zip(TIME, POSITION, strict=True)]
    path = mcap(tmp_path / "run.mcap", "json", {"/telemetry": lines})
    path.write_bytes(path.read_bytes()[:-2000])
    table = read_table(path)
    assert list(table.columns) == ["t", "knee/position"] and 300 < len(table) < 400
    assert "cut off" in " ".join(table.attrs["notes"])


def test_messages_in_protobuf(tmp_path):
    file = descriptor_pb2.FileDescriptorProto(name="state.proto", package="lab", syntax="proto3")
    joint, state = file.message_type.add(name="Joint"), file.message_type.add(name="State")
    for number, (name, kind) in enumerate((("name", 9), ("position", 1), ("target", 1)), 1):
        joint.field.add(name=name, number=number, type=kind, label=1)
    state.field.add(name="joints", number=1, type=11, label=3, type_name=".lab.Joint")
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    message = message_factory.GetMessageClass(pool.FindMessageTypeByName("lab.State"))
    rows = [
        message(joints=[{"name": "knee", "position": q, "target": u}]).SerializeToString()
        for q, u in zip(POSITION, GOAL, strict=True)
    ]
    schema = "lab.State", "protobuf", descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    found = inspect_log(mcap(tmp_path / "run.mcap", "protobuf", {"/state": rows}, schema=schema))
    assert trial(found) == "" and found.rig["joint"] == "knee"
    assert_allclose(read_table(tmp_path / "run.mcap")["joints/knee/position"], POSITION)


def test_other_encodings_are_named(tmp_path):
    mcap(tmp_path / "run.mcap", "cbor", {"/state": [b"x"] * 400})
    with pytest.raises(LogError, match=r"expected messages in JSON or Protobuf, .* got /state \(cbor\)"):
        read_table(tmp_path / "run.mcap")
