"""The rig file's key `robot`: a robot file, named relative to the rig file, whose model gives the load torques."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from drake_tc.config.files import is_file
from drake_tc.config.quoted import did_you_mean, quoted
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import RigError
from drake_tc.logs.loads import Load, RobotLoad
from drake_tc.logs.rig_document.sensors import JointSensorKeys


def parse_robot(source: str, value: object, rig: Path | str) -> Path | None:
    """The robot file, or None where the rig names none.

    Raises:
        RigError: Not a file's name, or no such file.
    """
    if value is None:
        return None
    if not isinstance(value, str) or not value:
        raise RigError(f"{source}: robot: expected the name of a robot file (YAML), got {quoted(value)}")
    path = Path(value) if not isinstance(rig, Path) else rig.parent / value
    if not is_file(path):
        raise RigError(f"{source}: robot: no such robot file: {path}")
    return path


def robot_joints(source: str, robot: Path) -> list[str]:
    """The driven joints that the robot file lists.

    Raises:
        RigError: The file cannot be read, or lists none.
    """
    try:
        document = read_yaml(robot, "robot file (YAML)", RigError)
    except RigError as error:
        raise RigError(f"{source}: robot: {error}") from None
    joints = document.get("joints") if isinstance(document, Mapping) else None
    if not isinstance(joints, list) or not joints:
        raise RigError(f"{source}: robot: {robot} has no `joints`; expected a robot file, or `joints` in the rig file")
    return [str(joint) for joint in joints]


def check_robot_load(source: str, load: Mapping[str, Load], robot: Path | None, *, coupled: bool) -> None:
    """A robot's model gives the loads of all joints of the rig, or of none; with coupled gears, of all.

    Raises:
        RigError: Only some joints take it, or no robot file is named.
    """
    taken = [joint for joint, entry in load.items() if isinstance(entry, RobotLoad)]
    if taken and robot is None:
        raise RigError(f"{source}: load: {{robot: ...}} requires the key `robot: FILE`")
    if coupled and not taken:
        raise RigError(f"{source}: coupled: requires load: {{robot: ...}}, which gives the torques of all joints")
    if taken and (len(taken) < len(load) or len({load[joint] for joint in taken}) > 1):
        others = [joint for joint in load if joint not in taken] or taken[1:]
        raise RigError(f"{source}: load: {{robot: ...}} must be the load of all joints; {others[0]!r} has another one")


def check_joint_tolerances(
    source: str,
    everywhere: JointSensorKeys,
    sensors: Mapping[str, JointSensorKeys],
    load: Mapping[str, Load],
    drive: Mapping[str, str],
) -> None:
    """A torque sensor that the rig file describes for one joint by its name is there, and an effort is that of a drive.

    Raises:
        RigError: The joint's load does not come from a torque sensor, or the joint (of what is said of all joints:
            every joint) has another kind of drive.
    """
    every = set(drive.values())
    for at, entry, kinds in (("", everywhere, every), *((f" {j}:", e, {drive[j]}) for j, e in sensors.items())):
        for name, kind in entry.drives.items():
            if kind not in kinds:
                raise RigError(
                    f"{source}: sensors:{at} {name}: this tolerance goes with drive: {kind}; got drive: "
                    f"{', '.join(sorted(kinds))}"
                )
    for joint, entry in sensors.items():
        if entry.torque is not None and load[joint] != "torque":
            raise RigError(
                f"{source}: sensors: {joint}: torque: the joint has no torque sensor; tolerances of one go with "
                f"load: torque"
            )


def robot_sensors(robot: Path | None) -> tuple[str, ...]:
    """`imu_<name>` and `ft_<name>` of the robot file's sensors; none where it cannot be read (others say so)."""
    if robot is None:
        return ()
    try:
        document = read_yaml(robot, error=RigError)
    except RigError:
        return ()
    found = []
    for key, prefix in (("imu", "imu_"), ("force_torque", "ft_")):
        entries = document.get(key) if isinstance(document, Mapping) else None
        found += [f"{prefix}{name}" for name in entries] if isinstance(entries, Mapping) else []
    return tuple(found)


def check_sensors(
    source: str, declared: Iterable[str], known: Sequence[str], robot: Path | None, key: str = "sensors"
) -> None:
    """Every sensor that the rig file names under `key` is one of the robot file.

    Raises:
        RigError: It is not; with the nearest match.
    """
    for column in declared:
        if column not in known:
            listed = (
                "a sensor needs `robot: FILE`" if robot is None else f"sensors of {robot}: {', '.join(known) or 'none'}"
            )
            raise RigError(
                f"{source}: {key}: {column}: the robot has no such sensor{did_you_mean(column, known)}; {listed}"
            )
