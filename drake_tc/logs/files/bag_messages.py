"""The ROS messages that logs of joints are made of, one function a type: message -> rows of streams.

Types: `sensor_msgs/JointState`, `sensor_msgs/Imu`, `geometry_msgs/WrenchStamped`, `std_msgs/Float64MultiArray`,
`std_msgs/Float64`, `std_msgs/Float32`, `sensor_msgs/Temperature`,
`trajectory_msgs/JointTrajectory`, `control_msgs/JointTrajectoryControllerState`, `control_msgs/DynamicJointState`, and
every other type that names its joints in a list beside vectors. Units are those of REP 103: rad,
rad/s, N, N m, m/s^2. A row is numbers with the sender's and the receiver's time stamps.
"""

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from drake_tc.logs.names import COMMANDS, meaning, names_joints
from drake_tc.types import FloatArray

COMMAND_WORDS = ("command", "cmd", "desired", "reference", "target", "setpoint", "goal")
"""In the name of a topic: its joint states are commanded, not measured."""


class Kind(StrEnum):
    """What a stream holds, and so how it is brought to another clock.

    A measurement is interpolated; a command is held; between the points of a trajectory it is interpolated, too. The
    feedback of a controller repeats a measurement.
    """

    measured = "measured"
    feedback = "feedback"
    commanded = "commanded"
    planned = "planned"


@dataclass
class Stream:
    """Rows of one topic and one set of names.

    Attributes:
        topic: Of the bag.
        kind: Measured or commanded.
        names: Of the columns; canonical names, or `command_0 ...` of an array whose joints are not told.
        stamps: (T,) the sender's clock [ns]; 0 where a message has none.
        received: (T,) the recorder's clock [ns].
        values: T rows after each other.
    """

    topic: str
    kind: Kind
    names: tuple[str, ...]
    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    received: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, stamp: int, received: int, row: Sequence[float]) -> None:
        """Append one row of `len(names)` numbers."""
        self.stamps.append(stamp)
        self.received.append(received)
        self.values.extend(row)

    def replan(self, stamp: int, received: int) -> None:
        """Begin a new trajectory: drop what was planned for later, and start from what is commanded now."""
        width, later = len(self.names), None
        while self.received and self.received[-1] > received:
            later = self.received.pop(), self.values[-width:]
            self.stamps.pop()
            del self.values[-width:]
        if not self.received:
            return
        now = self.values[-width:]
        if later is not None:
            share = (received - self.received[-1]) / (later[0] - self.received[-1])
            now = array("d", (a + share * (b - a) for a, b in zip(now, later[1], strict=True)))
        self.add(stamp, received, now)

    def __len__(self) -> int:
        """Rows so far."""
        return len(self.stamps)

    def table(self) -> FloatArray:
        """(T, n) the rows."""
        return np.frombuffer(self.values, dtype=np.float64).reshape(len(self), len(self.names))

    def columns(self) -> Mapping[str, FloatArray]:
        """(T,) by name."""
        return dict(zip(self.names, self.table().T, strict=True))


def complete(streams: Sequence[Stream]) -> list[Stream]:
    """The streams, where those of one topic's measurements that share columns are one; what a message lacks is NaN.

    Where two nodes send joint states of the same joints on one topic, each has a stream of its own: the topic's name
    with `#1` and `#2`, or, for the sender of fewer quantities, with `#2`.
    """
    result: list[Stream] = []
    for stream in (part for each in _by_quantities(streams) for part in _senders(each)):
        alike = [
            s for s in result if (s.topic, s.kind) == (stream.topic, Kind.measured) and set(s.names) & set(stream.names)
        ]
        if not alike:
            result.append(stream)
            continue
        parts = [*alike, stream]
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        whole = Stream(stream.topic, stream.kind, names)
        for part in parts:
            table = np.full((len(part), len(names)), np.nan)
            table[:, [names.index(name) for name in part.names]] = part.table()
            whole.stamps += part.stamps
            whole.received += part.received
            whole.values.frombytes(table.tobytes())
        result = [s for s in result if not any(s is each for each in alike)]
        result.append(whole)
    return result


SENDER = "#"
"""Before the number of a sender, where several use one topic."""
LEAST_SHARE = 0.1
"""Share of a topic's messages from which those with fewer quantities are another sender's."""
TURNS = 0.3
"""Step of the positions over two messages, relative to that over one, below which two senders take turns."""
MOST_ROWS, LEAST_ROWS = 20_000, 100


def _by_quantities(streams: Sequence[Stream]) -> list[Stream]:
    """The streams; one whose messages lack a quantity that others of its topic have of the same joints gets a name.

    Its positions are others, too: by more than those of the topic change from one message to the next.
    """
    result = []
    for stream in streams:
        richer = [
            other
            for other in streams
            if other.topic == stream.topic and other.kind is stream.kind is Kind.measured and _has_more(other, stream)
        ]
        most = max(richer, key=len, default=None)
        apart = most is not None and len(stream) > LEAST_SHARE * len(most) and _is_elsewhere(stream, most)
        result.append(replace(stream, topic=f"{stream.topic}{SENDER}2") if apart else stream)
    return result


def _is_elsewhere(stream: Stream, other: Stream) -> bool:
    """Whether its positions are not those of another stream at its times."""
    shared = [name for name in stream.names if name.endswith("/position") and name in other.names]
    mine, theirs = (each.columns() for each in (stream, other))
    stamped = all(each.stamps[-1] != 0 for each in (stream, other))
    at, known = (
        np.frombuffer(each.stamps if stamped else each.received, dtype=np.int64).astype(np.float64)
        for each in (stream, other)
    )
    order = np.argsort(known, kind="stable")
    apart = sum(np.abs(mine[name] - np.interp(at, known[order], theirs[name][order])) for name in shared)
    step = sum(np.abs(np.diff(theirs[name][order], prepend=theirs[name][order[0]])) for name in shared)
    return float(np.median(apart)) > float(np.median(step))


def _has_more(other: Stream, stream: Stream) -> bool:
    positions = [name for name in stream.names if name.endswith("/position") and name in other.names]
    of_shared = {name.rpartition("/")[0] for name in positions}

    def quantities(each: Stream) -> set[str]:
        return {suffix for joint, _, suffix in (name.rpartition("/") for name in each.names) if joint in of_shared}

    return bool(positions) and quantities(other) > quantities(stream)


def _senders(stream: Stream) -> list[Stream]:
    """The stream, or two where messages with other positions alternate with its own."""
    places = [i for i, name in enumerate(stream.names) if name.endswith("/position")]
    if stream.kind is not Kind.measured or not places or len(stream) < LEAST_ROWS:
        return [stream]
    table = stream.table()[:, places]
    some = table[:MOST_ROWS]
    one, two = (np.abs(some[k:] - some[:-k]).sum(axis=1) for k in (1, 2))
    if not 0.0 < float(np.median(two)) < TURNS * float(np.median(one)):
        return [stream]
    last, parts = [table[0], table[1]], [Stream(stream.topic, stream.kind, stream.names) for _ in range(2)]
    width, values = len(stream.names), stream.values
    for row in range(len(stream)):
        nearest = int(np.abs(table[row] - last[1]).sum() < np.abs(table[row] - last[0]).sum())
        last[nearest] = table[row]
        own = values[row * width : (row + 1) * width]
        parts[nearest].add(stream.stamps[row], stream.received[row], own)
    return [replace(part, topic=f"{stream.topic}{SENDER}{number}") for number, part in enumerate(parts, 1)]


def _is_command(topic: str) -> bool:
    """Whether a topic's name says that it holds commands."""
    return any(word in topic.lower() for word in COMMAND_WORDS)


GENERIC = (
    *("imu", "data", "raw", "sensor", "wrench", "ft", "force", "torque", "broadcaster", "filtered", "link", "frame"),
)
"""Words of topics and frames that name no sensor."""


def place(topic: str, frame: str) -> str:
    """Name of a sensor from its topic such as "/torso/imu/data", without generic words; else its frame, else "main"."""
    for text in (topic, frame):
        words = [word for word in text.replace("/", "_").lower().split("_") if word and word not in GENERIC]
        if name := "_".join("".join(filter(str.isalnum, word)) for word in words):
            return name
    return "main"


SECOND = 1_000_000_000


class Row(NamedTuple):
    """A row for one stream.

    Attributes:
        kind: Measured or commanded.
        names: Columns.
        stamp: Sender's clock [ns]; 0 for none.
        values: One a column.
        after: Time from the stamp at which the row counts [ns].
        first: Begins a trajectory, which replaces what an earlier one had planned for later.
    """

    kind: Kind
    names: tuple[str, ...]
    stamp: int
    values: Sequence[float]
    after: int = 0
    first: bool = False


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def _joint_state(topic: str, message: Any) -> Iterator[Row]:
    """Positions, velocities and efforts by joint; a topic that is named as a command holds commands."""
    commanded = _is_command(topic)
    suffixes = ("position_command", "velocity_command", "torque_command") if commanded else STATE
    columns = list(zip(suffixes, (message.position, message.velocity, message.effort), strict=True))
    joints = list(message.name)
    names = [f"{joint}/{suffix}" for suffix, values in columns if len(values) == len(joints) for joint in joints]
    row = [float(value) for _, values in columns if len(values) == len(joints) for value in values]
    if names:
        yield Row(Kind.commanded if commanded else Kind.measured, tuple(names), _stamp(message), row)


def _dynamic_joint_state(topic: str, message: Any) -> Iterator[Row]:
    """All interfaces of ros2_control's joints, such as `elbow/position` and `elbow/current`."""
    pairs = [
        (f"{joint}/{name}", float(value))
        for joint, of in zip(message.joint_names, message.interface_values, strict=True)
        for name, value in zip(of.interface_names, of.values, strict=True)
    ]
    if pairs:
        yield Row(Kind.measured, tuple(name for name, _ in pairs), _stamp(message), [value for _, value in pairs])


STATE = ("position", "velocity", "effort")
"""Effort is no canonical column: drivers put currents, torques or load percentages there."""


def _vectors(prefix: str, parts: Mapping[str, Any], message: Any) -> Iterator[Row]:
    """The vectors of a sensor's message, by what stands before the axis in their names."""
    names = tuple(f"{prefix}/{part}{axis}" for part in parts for axis in "xyz")
    values = [float(getattr(vector, axis)) for vector in parts.values() for axis in "xyz"]
    yield Row(Kind.measured, names, _stamp(message), values)


def _imu(topic: str, message: Any) -> Iterator[Row]:
    parts = {"gyro_": message.angular_velocity, "accel_": message.linear_acceleration}
    return _vectors(f"imu_{place(topic, message.header.frame_id)}", parts, message)


def _wrench(topic: str, message: Any) -> Iterator[Row]:
    parts = {"f": message.wrench.force, "t": message.wrench.torque}
    return _vectors(f"ft_{place(topic, message.header.frame_id)}", parts, message)


def _array(topic: str, message: Any) -> Iterator[Row]:
    """Commands of forward controllers, whose joints the message does not tell: columns `TOPIC[0] ...`."""
    names = tuple(f"{topic}[{i}]" for i in range(len(message.data)))
    if names:
        yield Row(Kind.commanded, names, 0, [float(value) for value in message.data])


def _scalar(topic: str, message: Any) -> Iterator[Row]:
    """One number a message without a stamp: the column is called like the topic."""
    kind = Kind.commanded if _is_command(topic) else Kind.measured
    yield Row(kind, (topic.strip("/"),), 0, [float(message.data)])


def _temperature(topic: str, message: Any) -> Iterator[Row]:
    yield Row(Kind.measured, (topic.strip("/"),), _stamp(message), [float(message.temperature)])


def _controller_state(topic: str, message: Any) -> Iterator[Row]:
    """Reference and feedback of a joint trajectory controller; older distributions fill desired and actual."""
    joints = list(message.joint_names)
    for fields, kind, suffixes in (
        (("reference", "desired"), Kind.commanded, ("position_command",)),
        (("feedback", "actual"), Kind.feedback, STATE),
    ):
        points = [getattr(message, name) for name in fields if hasattr(message, name)]
        point = next((each for each in points if len(each.positions) == len(joints)), None)
        if point is not None:
            values = zip(suffixes, (point.positions, point.velocities, point.effort), strict=False)
            columns = [(suffix, own) for suffix, own in values if len(own) == len(joints)]
            names = tuple(f"{joint}/{suffix}" for suffix, _ in columns for joint in joints)
            yield Row(kind, names, _stamp(message), [float(value) for _, own in columns for value in own])


def _trajectory(topic: str, message: Any) -> Iterator[Row]:
    """Each point is a command at the trajectory's start plus its time from start."""
    names = tuple(f"{joint}/position_command" for joint in message.joint_names)
    for number, point in enumerate(message.points):
        if len(point.positions) == len(names):
            after = int(point.time_from_start.sec) * SECOND + int(point.time_from_start.nanosec)
            values = [float(value) for value in point.positions]
            yield Row(Kind.planned, names, _stamp(message), values, after, first=number == 0)


def names_its_joints(fields: Sequence[tuple[str, Any]]) -> bool:
    """Whether a type of message has a list of the joints' names, by its fields as rosbags defines them."""
    return any(names_joints(name) and _is_list_of_texts(kind) for name, kind in fields)


def _is_list_of_texts(kind: Any) -> bool:
    """Of a definition such as (4, ((1, ("string", 0)), 0)): a sequence (4) or an array (3) of a base type."""
    return len(kind) == 2 and kind[0] in (3, 4) and kind[1][0][1][0] == "string"


def named_vectors(topic: str, message: Any) -> Iterator[Row]:
    """The vectors of any message that names its joints: each field by what its name says, others as they are called."""
    fields = {name: getattr(message, name) for name in message.__dataclass_fields__ if not name.startswith("_")}
    joints = next((each for name, each in fields.items() if names_joints(name) and isinstance(each, list)), [])
    rows: dict[Kind, list[tuple[str, float]]] = {Kind.measured: [], Kind.commanded: []}
    for name, values in fields.items():
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "iuf" or values.shape != (len(joints),):
            continue
        told = meaning(name)
        commanded = _is_command(topic) or (told is not None and told.by not in EFFORTS and "command" in told.quantity)
        suffix = name if told is None or told.joint or told.by in EFFORTS else told.quantity
        suffix = COMMANDS.get(suffix, suffix) if commanded else suffix
        own = zip((f"{joint}/{suffix}" for joint in joints), map(float, values), strict=True)
        rows[Kind.commanded if commanded else Kind.measured] += own
    for kind, pairs in rows.items():
        if joints and pairs:
            stamp = _stamp(message) if hasattr(message, "header") else 0
            yield Row(kind, tuple(name for name, _ in pairs), stamp, [value for _, value in pairs])


EFFORTS = ("effort", "eff")
"""Names of a field that is no canonical column; see `STATE`."""
Extract = Callable[[str, Any], Iterator[Row]]
EXTRACT: Mapping[str, Extract] = MappingProxyType(
    {
        "sensor_msgs/msg/JointState": _joint_state,
        "sensor_msgs/msg/Imu": _imu,
        "geometry_msgs/msg/WrenchStamped": _wrench,
        "std_msgs/msg/Float64MultiArray": _array,
        "std_msgs/msg/Float32MultiArray": _array,
        "std_msgs/msg/Float64": _scalar,
        "std_msgs/msg/Float32": _scalar,
        "sensor_msgs/msg/Temperature": _temperature,
        "trajectory_msgs/msg/JointTrajectory": _trajectory,
        "control_msgs/msg/JointTrajectoryControllerState": _controller_state,
        "control_msgs/msg/DynamicJointState": _dynamic_joint_state,
    }
)
"""Message type to what reads it."""
