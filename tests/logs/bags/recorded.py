"""Bags as `ros2 bag record` writes them, made from arrays."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.rosbag2.enums import StoragePlugin
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
EPOCH = 1_700_000_000_000_000_000
"""[ns]: when the bag was recorded."""

Message = tuple[str, str, int, Any]
"""Topic, type, time of recording [ns], message."""


def nanoseconds(seconds: float) -> int:
    return EPOCH + round(1e9 * seconds)


def header(stamp: int | None, frame: str = "") -> Any:
    sec, nanosec = divmod(stamp or 0, 10**9)
    return T["std_msgs/msg/Header"](stamp=T["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec), frame_id=frame)


def joint_states(
    topic: str, time: np.ndarray, states: Mapping[str, Sequence[np.ndarray]], *, stamped: bool = True, late: float = 0.0
) -> Iterable[Message]:
    """Joint to position, velocity, effort (each optional from the right); recorded `late` after their stamps [s]."""
    for i, t in enumerate(time):
        parts = [[values[k][i] for values in states.values() if len(values) > k] for k in range(3)]
        message = T["sensor_msgs/msg/JointState"](
            header(nanoseconds(t) if stamped else None),
            list(states),
            *(np.array(part, dtype=np.float64) for part in parts),
        )
        yield topic, "sensor_msgs/msg/JointState", nanoseconds(t + late), message


def arrays(topic: str, time: np.ndarray, values: np.ndarray) -> Iterable[Message]:
    layout = T["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    for t, row in zip(time, values, strict=True):
        yield topic, "std_msgs/msg/Float64MultiArray", nanoseconds(t), T["std_msgs/msg/Float64MultiArray"](layout, row)


def imus(
    topic: str, frame: str, time: np.ndarray, gyro: np.ndarray, accel: np.ndarray, clock: float = 0.0
) -> Iterable[Message]:
    """Angular velocity and specific force (T, 3); the sender's clock is ahead by `clock` [s]."""
    vector, nothing = T["geometry_msgs/msg/Vector3"], np.zeros(9)
    turn = T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    for t, w, a in zip(time, gyro, accel, strict=True):
        stamp = header(nanoseconds(t + clock), frame)
        message = T["sensor_msgs/msg/Imu"](stamp, turn, nothing, vector(*w), nothing, vector(*a), nothing)
        yield topic, "sensor_msgs/msg/Imu", nanoseconds(t + 0.001), message


def wrenches(topic: str, frame: str, time: np.ndarray, force: np.ndarray, torque: np.ndarray) -> Iterable[Message]:
    vector = T["geometry_msgs/msg/Vector3"]
    for t, f, m in zip(time, force, torque, strict=True):
        message = T["geometry_msgs/msg/WrenchStamped"](
            header(nanoseconds(t), frame), T["geometry_msgs/msg/Wrench"](vector(*f), vector(*m))
        )
        yield topic, "geometry_msgs/msg/WrenchStamped", nanoseconds(t + 0.001), message


def trajectory(
    topic: str, start: float, joints: Sequence[str], points: Sequence[tuple[float, Sequence[float]]]
) -> Iterable[Message]:
    """One message without a stamp: points (time from start [s], positions)."""
    duration, point = T["builtin_interfaces/msg/Duration"], T["trajectory_msgs/msg/JointTrajectoryPoint"]
    none = np.zeros(0)
    rows = [
        point(np.array(q, dtype=np.float64), none, none, none, duration(*divmod(round(1e9 * t), 10**9)))
        for t, q in points
    ]
    message = T["trajectory_msgs/msg/JointTrajectory"](header(None), list(joints), rows)
    yield topic, "trajectory_msgs/msg/JointTrajectory", nanoseconds(start), message


def bag(path: Path, *messages: Iterable[Message], mcap: bool = True) -> Path:
    """A folder with the messages in the order of their recording, as MCAP or SQLite."""
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    every = sorted((m for each in messages for m in each), key=lambda m: m[2])
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections: dict[str, Any] = {}
        for topic, kind, when, message in every:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], when, STORE.serialize_cdr(message, kind))
    return path
