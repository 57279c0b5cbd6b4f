"""A large bag streams: memory grows with the joints' numbers, not with the file."""

import json
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("rosbags")
from .recorded import STORE, T, bag, header, joint_states, nanoseconds

GIBIBYTE = 2**30
IMAGE = 2**20
"""Bytes of one camera image."""
GROWTH = 128 * 2**20
"""Memory by which reading 1 GiB may exceed reading the joint states alone [bytes]: an eighth of the file."""
PEAK = """
import json, resource, sys
from drake_tc.logs.files.bag import read_bag
table = read_bag(__import__("pathlib").Path(sys.argv[1]))
peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({"peak": peak, "rows": len(table), "columns": list(table.columns)}))
"""


def images(count, step):
    """Pictures of a camera, which no log of joints needs; they do not compress."""
    rng = np.random.default_rng(0)
    kind = "sensor_msgs/msg/CompressedImage"
    for i in range(count):
        stamp = nanoseconds(i * step)
        data = rng.integers(0, 256, IMAGE, dtype=np.uint8)
        yield "/camera/image", kind, stamp, T[kind](header(stamp, "camera"), "jpeg", data)


def written(path, pictures):
    """A bag of 20 s of joint states at 100 Hz, with pictures between them, written picture by picture."""
    from rosbags.rosbag2 import Writer
    from rosbags.rosbag2.enums import StoragePlugin

    time = np.arange(0.0, 20.0, 0.01)
    states = list(joint_states("/joint_states", time, {"elbow": [np.sin(time), np.cos(time)]}))
    if not pictures:
        return bag(path, states)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        pending = iter(states)
        following = next(pending, None)
        for message in images(pictures, 20.0 / pictures):
            while following is not None and following[2] <= message[2]:
                _write(writer, connections, following)
                following = next(pending, None)
            _write(writer, connections, message)
        while following is not None:
            _write(writer, connections, following)
            following = next(pending, None)
    return path


def _write(writer, connections, message):
    topic, kind, when, content = message
    if topic not in connections:
        connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
    writer.write(connections[topic], when, STORE.serialize_cdr(content, kind))


def measured(path):
    """Peak memory [bytes] of a process that reads the bag, and what it read."""
    ran = subprocess.run([sys.executable, "-c", PEAK, str(path)], capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)


@pytest.mark.slow
def test_a_gibibyte_streams_in_bounded_memory(tmp_path):
    small, large = written(tmp_path / "small", 0), written(tmp_path / "large", GIBIBYTE // IMAGE)
    assert sum(file.stat().st_size for file in large.iterdir()) >= GIBIBYTE
    alone, among = measured(small), measured(large)
    print(f"peak memory: {alone['peak'] / 2**20:.0f} MiB alone, {among['peak'] / 2**20:.0f} MiB among pictures")
    assert (among["rows"], among["columns"]) == (alone["rows"], alone["columns"])
    assert among["peak"] - alone["peak"] <= GROWTH
