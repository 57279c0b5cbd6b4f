"""The ROS messages that logs of joints are made of, one function a type: message -> rows of streams.

Types: `sensor_msgs/JointState`, `sensor_msgs/Imu`, `geometry_msgs/WrenchStamped`, `std_msgs/Float64MultiArray`,
`std_msgs/Float64`, `std_msgs/Float32`, `sensor_msgs/Temperature`,
`trajectory_msgs/JointTrajectory`, `control_msgs/JointTrajectoryControllerState`. Units are those of REP 103: rad,
rad/s, N, N m, m/s^2.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from drake_tc.logs.bags.streams import Kind, is_command, place

SECOND = 1_000_000_000
GENERIC = (
    "imu",
    "data",
    "raw",
    "sensor",
    "wrench",
    "ft",
    "force",
    "torque",
    "broadcaster",
    "filtered",
    "link",
    "frame",
)
"""Words of topics and frames that name no sensor."""


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
    commanded = is_command(topic)
    suffixes = ("position_command", "velocity_command", "torque_command") if commanded else STATE
    columns = list(zip(suffixes, (message.position, message.velocity, message.effort), strict=True))
    joints = list(message.name)
    names = [f"{joint}/{suffix}" for suffix, values in columns if len(values) == len(joints) for joint in joints]
    row = [float(value) for _, values in columns if len(values) == len(joints) for value in values]
    if names:
        yield Row(Kind.commanded if commanded else Kind.measured, tuple(names), _stamp(message), row)


STATE = ("position", "velocity", "effort")
"""Effort is no canonical column: drivers put currents, torques or load percentages there."""


def _imu(topic: str, message: Any) -> Iterator[Row]:
    prefix = f"imu_{place(topic, message.header.frame_id, GENERIC)}"
    axes = [(f"{prefix}/gyro_{axis}", getattr(message.angular_velocity, axis)) for axis in "xyz"]
    axes += [(f"{prefix}/accel_{axis}", getattr(message.linear_acceleration, axis)) for axis in "xyz"]
    yield Row(Kind.measured, tuple(name for name, _ in axes), _stamp(message), [float(value) for _, value in axes])


def _wrench(topic: str, message: Any) -> Iterator[Row]:
    prefix = f"ft_{place(topic, message.header.frame_id, GENERIC)}"
    axes = [(f"{prefix}/f{axis}", getattr(message.wrench.force, axis)) for axis in "xyz"]
    axes += [(f"{prefix}/t{axis}", getattr(message.wrench.torque, axis)) for axis in "xyz"]
    yield Row(Kind.measured, tuple(name for name, _ in axes), _stamp(message), [float(value) for _, value in axes])


def _array(topic: str, message: Any) -> Iterator[Row]:
    """Commands of forward controllers, whose joints the message does not tell: columns `TOPIC[0] ...`."""
    names = tuple(f"{topic}[{i}]" for i in range(len(message.data)))
    if names:
        yield Row(Kind.commanded, names, 0, [float(value) for value in message.data])


def _scalar(topic: str, message: Any) -> Iterator[Row]:
    """One number a message without a stamp: the column is called like the topic."""
    kind = Kind.commanded if is_command(topic) else Kind.measured
    yield Row(kind, (topic.strip("/"),), 0, [float(message.data)])


def _temperature(topic: str, message: Any) -> Iterator[Row]:
    yield Row(Kind.measured, (topic.strip("/"),), _stamp(message), [float(message.temperature)])


def _controller_state(topic: str, message: Any) -> Iterator[Row]:
    """Reference and feedback of a joint trajectory controller; older distributions say desired and actual."""
    joints = list(message.joint_names)
    for fields, kind, suffix in (
        (("reference", "desired"), Kind.commanded, "position_command"),
        (("feedback", "actual"), Kind.feedback, "position"),
    ):
        point = next((getattr(message, name) for name in fields if hasattr(message, name)), None)
        if point is not None and len(point.positions) == len(joints):
            names = tuple(f"{joint}/{suffix}" for joint in joints)
            yield Row(kind, names, _stamp(message), [float(value) for value in point.positions])


def _trajectory(topic: str, message: Any) -> Iterator[Row]:
    """Each point is a command at the trajectory's start plus its time from start."""
    names = tuple(f"{joint}/position_command" for joint in message.joint_names)
    for number, point in enumerate(message.points):
        if len(point.positions) == len(names):
            after = int(point.time_from_start.sec) * SECOND + int(point.time_from_start.nanosec)
            values = [float(value) for value in point.positions]
            yield Row(Kind.planned, names, _stamp(message), values, after, first=number == 0)


Extract = Callable[[str, Any], Iterator[Row]]
EXTRACT: Mapping[str, Extract] = MappingProxyType(
    {
        "sensor_msgs/msg/JointState": _joint_state,
        "sensor_msgs/msg/Imu": _imu,
        "geometry_msgs/msg/WrenchStamped": _wrench,
        "std_msgs/msg/Float64MultiArray": _array,
        "std_msgs/msg/Float64": _scalar,
        "std_msgs/msg/Float32": _scalar,
        "sensor_msgs/msg/Temperature": _temperature,
        "trajectory_msgs/msg/JointTrajectory": _trajectory,
        "control_msgs/msg/JointTrajectoryControllerState": _controller_state,
    }
)
"""Message type to what reads it."""
