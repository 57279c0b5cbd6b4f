"""The rig file: which joints a log shows, how their drives and columns read, and what the owner already models.

RIG.md beside this file explains every key; `drake_tc.logs.rig_document` is the model that it is written from.

The drive gain is declared directly, or as what a data sheet or a firmware states:

    current drive      K = 1/(torque_constant gear_ratio)     [A/(N m)]
    position servo     K = 1/proportional_gain                [rad/(N m)]

of a servo whose law is  tau = proportional_gain (q_d - q) - derivative_gain qdot.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from drake_tc.config.files import write_whole
from drake_tc.config.joint_units import JointType, JointUnits
from drake_tc.config.keys import check_sizes
from drake_tc.config.quoted import quoted
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import RigError
from drake_tc.logs.loads import (
    FORCE_TORQUE_PARTS,
    IMU_PARTS,
    ForceTorqueTolerance,
    ImuTolerance,
    JointSensors,
    Load,
    Pendulum,
    RobotLoad,
    Tolerance,
    UnknownLoad,
)
from drake_tc.logs.rig_document.declared import (
    EFFECT_IDS,
    Declared,
    check_sliding_loads,
    declared_of,
    is_file,
    joint_types,
    with_declared_file,
)
from drake_tc.logs.rig_document.document import Condition, DriveKind, RigDocument, read_document, values_by_joint
from drake_tc.logs.rig_document.loads import (
    check_joint_tolerances,
    check_robot_load,
    check_sensors,
    load_of,
    parse_robot,
    robot_joints,
    robot_sensors,
)
from drake_tc.logs.rig_document.sensors import SensorsKeys, sensors_entry

STATED = ("drive_gain", "torque_constant", "gear_ratio", "proportional_gain", "derivative_gain")
"""Keys of numbers > 0, one for all joints or by joint, that say how strong a drive is."""
_ONLY_FOR: Mapping[str, DriveKind] = {
    "torque_constant": "current",
    "gear_ratio": "current",
    "proportional_gain": "position_servo",
    "derivative_gain": "position_servo",
}
_NEEDS: Mapping[str, tuple[str, ...]] = {
    "torque_constant": ("gear_ratio",),
    "gear_ratio": ("torque_constant",),
    "derivative_gain": ("proportional_gain", "drive_gain"),
}
_WHY: Mapping[str, str] = {
    "torque_constant": "the motor's torque times the gear ratio is the joint's torque; write gear_ratio: 1 for a "
    "direct drive",
    "gear_ratio": "the ratio alone does not say how strong the drive is",
    "derivative_gain": "without it the scale of the servo's torques is not known",
}


def _declared_gains(read: RigDocument) -> tuple[dict[str, float], dict[str, float]]:
    """By joint: the declared drive gain K [effort/(N m)], and the servo's derivative gain [N m s/rad]."""
    joints = read.joint_names
    stated = {key: values_by_joint(getattr(read, key), joints) for key in STATED}
    drives = values_by_joint(read.drive, joints)
    gains: dict[str, float] = {}
    derivative: dict[str, float] = {}
    for joint in joints:
        given = {key: float(values[joint]) for key, values in stated.items() if values[joint] is not None}
        _check(joint, drives[joint], given)
        if "drive_gain" in given:
            gains[joint] = given["drive_gain"]
        elif "torque_constant" in given:
            gains[joint] = 1.0 / (given["torque_constant"] * given["gear_ratio"])
        elif "proportional_gain" in given:
            gains[joint] = 1.0 / given["proportional_gain"]
        if "derivative_gain" in given:
            derivative[joint] = given["derivative_gain"]
    return gains, derivative


def _check(joint: str, drive: DriveKind, given: Mapping[str, float]) -> None:
    for key in given:
        if drive != _ONLY_FOR.get(key, drive):
            raise ValueError(f"{key}: it belongs to `drive: {_ONLY_FOR[key]}`; the drive of {joint} is {drive}")
        if key in _NEEDS and not set(_NEEDS[key]) & set(given):
            raise ValueError(f"{key}: expected {' or '.join(_NEEDS[key])} for {joint} too: {_WHY[key]}")
        if "drive_gain" in given and key in ("torque_constant", "proportional_gain"):
            raise ValueError(f"{key}: {joint} has drive_gain too, and both state the drive's gain; remove one of them")


COMMAND_COLUMN: Mapping[DriveKind, str] = {
    "position_servo": "position_command",
    "current": "current",
    "voltage": "voltage",
    "torque": "torque_command",
}
"""Kind of drive to the last part of the column with its command."""
WRENCH_AXES = ("fx", "fy", "fz", "tx", "ty", "tz")
"""Last parts of an F/T sensor's columns."""


def _empty() -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True)
class Rig:
    """What the owner says of the rig; every mapping by joint has an entry for every joint.

    Attributes:
        joints: Names, in the order of the file.
        drive: Kind of drive by joint.
        load: By joint: "torque" (its column), "unknown", an `UnknownLoad`, a `Pendulum`, or a `RobotLoad` (of
            all joints then).
        declared: By joint: effect id to its known value, or None for "modelled, value unknown". Always has viscous
            and coulomb. A parameter of an effect is `id.parameter`.
        columns: Canonical column name to the name in the log file, where they differ.
        units: Canonical name or suffix to a unit or scale factor, where not SI.
        enabled: Name in the log of the column that is 0 while the drive is off, or None.
        valid: Conditions that all samples meet which may be used.
        saturation: Known effort limit by joint [rad | A | V | N m], where known.
        drive_gain: Declared gain K_0 by joint [effort/(N m)], where it is declared.
        derivative_gain: Declared damping of a position servo by joint [N m s/rad], where it is declared.
        command_hold: Whether the command acts unchanged until the next sample; None where the file does not say.
        source: The file it came from, or None.
        robot: The robot file whose model gives the loads, or None.
        sensors: Declared noise and tolerances by joint; see `joint_sensors`.
        tolerances: Declared tolerances by the sensor's column name (`ft_foot`, `imu_trunk`).
        coupled: By joint, turns of its motor for one turn of another joint (`estimation.robot_loads`).
        tares: Begin and end of the stretch of every run in which an F/T sensor is zeroed [s], by its column name.
        robot_sensors: Column names of the sensors that the robot file lists (`ft_foot`, `imu_trunk`).
        declared_by_files: Sentences on what files of other simulators declare, and what of them is not used.
        joint_types: Whether a joint turns or slides, by joint; see `joint_type`. The units above are those of joints
            that turn; `units_of` gives those of each joint.

    Example:
        >>> _ = (FOLDER / "rig.yaml").write_text("{joint: knee, drive: current, load: torque}")
        >>> load_rig(FOLDER / "rig.yaml").joints
        ('knee',)
    """

    joints: tuple[str, ...]
    drive: Mapping[str, DriveKind]
    load: Mapping[str, Load]
    declared: Mapping[str, Declared]
    columns: Mapping[str, str] = field(default_factory=_empty)
    units: Mapping[str, str | float] = field(default_factory=_empty)
    enabled: str | None = None
    valid: tuple[Condition, ...] = ()
    saturation: Mapping[str, float] = field(default_factory=_empty)
    drive_gain: Mapping[str, float] = field(default_factory=_empty)
    derivative_gain: Mapping[str, float] = field(default_factory=_empty)
    command_hold: bool | None = None
    source: Path | None = None
    robot: Path | None = None
    sensors: Mapping[str, JointSensors] = field(default_factory=_empty)
    tolerances: Mapping[str, Tolerance] = field(default_factory=_empty)
    tares: Mapping[str, tuple[float, float]] = field(default_factory=_empty)
    coupled: Mapping[str, Mapping[str, float]] = field(default_factory=_empty)
    robot_sensors: tuple[str, ...] = ()
    joint_types: Mapping[str, JointType] = field(default_factory=_empty)
    declared_by_files: tuple[str, ...] = ()

    def joint_sensors(self, joint: str) -> JointSensors:
        """What is declared of the joint's own channels; all None where nothing is."""
        return self.sensors.get(joint, JointSensors())

    def force_torque_tolerance(self, name: str) -> ForceTorqueTolerance:
        """The tolerance of the robot's F/T sensor `name`; a typical sensor's where none is declared."""
        found = self.tolerances.get(f"ft_{name}")
        return found if isinstance(found, ForceTorqueTolerance) else FORCE_TORQUE_PARTS["typical"]

    def imu_tolerance(self, name: str) -> ImuTolerance:
        """The tolerance of the robot's IMU `name`; a typical one's where none is declared."""
        found = self.tolerances.get(f"imu_{name}")
        return found if isinstance(found, ImuTolerance) else IMU_PARTS["typical"]

    def joint_type(self, joint: str) -> JointType:
        """Whether the joint turns or slides."""
        return self.joint_types.get(joint, "revolute")

    def units_of(self, joint: str) -> JointUnits:
        """Units of the joint's quantities."""
        return JointUnits(self.joint_type(joint), self.drive[joint])

    def opposite_unit(self, column: str, si: str) -> str | float:
        """The entry of `units` that turns a column: its unit in this file, else `si`, with the other sign."""
        unit = self.units.get(column, self.units.get(column.rpartition("/")[2], si))
        if isinstance(unit, str):
            return unit.strip()[1:].strip() if unit.strip().startswith("-") else f"-{unit.strip()}"
        return -unit

    def command_column(self, joint: str) -> str:
        """Canonical name of the drive's command, e.g. `<joint>/position_command`; see `COMMAND_COLUMN`."""
        return f"{joint}/{COMMAND_COLUMN[self.drive[joint]]}"

    def required_columns(self, joint: str) -> tuple[str, ...]:
        """Canonical columns without which the joint cannot be diagnosed."""
        needed = [f"{joint}/position", self.command_column(joint)]
        if self.load[joint] == "torque":
            needed.append(f"{joint}/torque")
        return tuple(needed)

    def required_sensor_columns(self) -> tuple[str, ...]:
        """Canonical columns of the robot's F/T sensors, without which its load torques cannot be estimated."""
        if RobotLoad("estimate") not in self.load.values():
            return ()
        sensors = [name for name in self.robot_sensors if name.startswith("ft_")]
        return tuple(f"{name}/{axis}" for name in sensors for axis in WRENCH_AXES)

    def known(self, joint: str, effect: str) -> float:
        """The declared value of an effect, or 0 where it is not declared or its value is unknown."""
        return self.declared[joint].get(effect) or 0.0


def parse_rig(document: object, source: Path | str = "rig") -> Rig:
    """A rig from what its YAML says.

    Raises:
        RigError: Unknown or missing key, or a bad value; names file, key and what is possible.
    """
    name = str(source)
    if not isinstance(document, Mapping):
        raise RigError(f"{name}: expected a mapping, got {quoted(document)} ({RigDocument.how_explained()})")
    entries = _with_text_keys(document)
    try:
        check_sizes(entries)
    except ValueError as error:
        raise RigError(f"{name}: {error}") from None
    robot = parse_robot(name, entries.get("robot"), source)
    if robot is not None and not {"joint", "joints"} & set(entries):
        entries["joints"] = robot_joints(name, robot)
    if robot is not None and entries.get("load") is None:
        entries["load"] = {"robot": "estimate"}
    read = read_document(name, entries)
    try:
        rig = _rig_of(read, robot, source if isinstance(source, Path) else None)
    except ValueError as error:
        raise RigError(f"{name}: {error}") from None
    rig = _with_declared_files(rig, read)
    check_robot_load(name, rig.load, robot, coupled=bool(rig.coupled))
    check_sensors(name, rig.tolerances, rig.robot_sensors, robot)
    sensors = read.sensors or SensorsKeys()
    check_joint_tolerances(name, sensors, sensors.of_joints, rig.load, rig.drive)
    if robot is not None:
        mapped = (column.rpartition("/")[0] for column in rig.columns)
        named = [owner for owner in mapped if owner.startswith(("ft_", "imu_"))]
        check_sensors(name, named, rig.robot_sensors, robot, key="columns")
    return rig


def _with_text_keys(value: object) -> Any:
    """The same document; keys that YAML takes for numbers or truth values become text."""
    if isinstance(value, Mapping):
        return {str(key): _with_text_keys(entry) for key, entry in value.items()}
    return [_with_text_keys(entry) for entry in value] if isinstance(value, list) else value


def _rig_of(read: RigDocument, robot: Path | None, source: Path | None) -> Rig:
    joints = read.joint_names
    sensors, declared = read.sensors or SensorsKeys(), values_by_joint(read.declared, joints)
    gains, derivative_gains = _declared_gains(read)
    stated = values_by_joint(read.joint_type, joints)
    types = joint_types(joints, stated, robot, read.units or {})
    drives, limits = (values_by_joint(entry, joints) for entry in (read.drive, read.saturation))
    load = {joint: load_of(entry) for joint, entry in values_by_joint(read.load, joints).items()}
    check_sliding_loads(load, types)
    return Rig(
        joints=joints,
        drive=drives,
        load=load,
        declared={
            joint: declared_of(entry)
            | _servo_limit(drives[joint], limits[joint], gains.get(joint), derivative_gains.get(joint))
            for joint, entry in declared.items()
        },
        columns={name: str(in_log) for name, in_log in (read.columns or {}).items()},
        units=read.units or {},
        enabled=read.enabled,
        command_hold=read.command_hold,
        valid=read.conditions,
        source=source,
        robot=robot,
        sensors={joint: sensors.of_joint(joint, torque_sensor=load[joint] == "torque") for joint in joints},
        tolerances=sensors.tolerances(),
        tares=sensors.tares(),
        coupled=read.coupled or {},
        robot_sensors=robot_sensors(robot),
        joint_types=types,
        saturation={joint: limit for joint, limit in limits.items() if limit is not None},
        drive_gain=gains,
        derivative_gain=derivative_gains,
    )


def _servo_limit(
    drive: DriveKind, limit: float | None, gain: float | None, damping: float | None
) -> dict[str, float | None]:
    """The stated limit of a position servo as a declared effect, with the servo's damping where that is stated."""
    if limit is None or drive != "position_servo":
        return {}
    if damping is None or gain is None:
        return {"saturation": limit}
    time = damping * gain
    return {"saturation.servo": None, "saturation.servo.limit": limit, "saturation.servo.derivative_time": time}


def _with_declared_files(rig: Rig, read: RigDocument) -> Rig:
    """The rig with what the files that `declared` names say of their joints."""
    entries = values_by_joint(read.declared, rig.joints)
    named = {joint: entry for joint, entry in entries.items() if isinstance(entry, str) and is_file(entry)}
    for file in dict.fromkeys(named.values()):
        joints = [joint for joint, entry in named.items() if entry == file]
        path = Path(file) if rig.source is None else rig.source.parent / file
        rig = with_declared_file(rig, path, joints)
    return rig


def load_rig(path: Path | str, declared: Path | None = None) -> Rig:
    """Read a rig file.

    Args:
        path: Of the rig file.
        declared: A file of another simulator that declares what its model has (`rig_document.declared`).

    Raises:
        RigError: No such file, not YAML, or not a rig; names file and key. Or `declared` cannot be used.

    Example:
        >>> _ = (FOLDER / "rig.yaml").write_text("{joint: knee, drive: current, load: torque}")
        >>> load_rig(FOLDER / "rig.yaml").drive
        {'knee': 'current'}
    """
    path = Path(path)
    rig = parse_rig(read_yaml(path, "rig file", RigError), path)
    return rig if declared is None else with_declared_file(rig, declared)


def _load_entry(load: Load) -> object:
    if isinstance(load, RobotLoad):
        robot: dict[str, object] = {"robot": load.method}
        robot |= {"tolerance": load.tolerance} if load.tolerance != RobotLoad().tolerance else {}
        robot |= {"drive_gain_tolerance": load.gain_tolerance} if load.gain_tolerance else {}
        robot |= {"unknown_payload": list(load.payload)} if load.payload else {}
        return robot | ({"payload_link": load.carrier} if load.carrier else {})
    if isinstance(load, UnknownLoad):
        return {"unknown": load.form}
    if not isinstance(load, Pendulum):
        return load
    names = ("mass", "length", "inertia")
    entry: dict[str, object] = {name: getattr(load, name) for name in names}
    if load.by_run:
        entry = {name: {pattern: getattr(each, name) for pattern, each in load.by_run} for name in names}
    return {"pendulum": entry | ({"zero": load.zero} if load.zero else {})}


def _one_or_each(by_joint: Mapping[str, Any]) -> object:
    """One entry for all when they agree, else a mapping by joint."""
    values = list(by_joint.values())
    return values[0] if all(value == values[0] for value in values) else dict(by_joint)


def rig_document(rig: Rig) -> dict[str, Any]:
    """The rig as a YAML document; `parse_rig` gives the same rig back."""
    always = {"viscous", "coulomb"}
    declared = {
        joint: {k: v for k, v in values.items() if not (k in always and v is None)}
        for joint, values in rig.declared.items()
    }
    for values in declared.values():  # `id.parameter` goes back under `id`
        for key in [k for k in values if "." in k and k not in EFFECT_IDS]:
            effect, _, parameter = key.rpartition(".")
            nested: Any = values.get(effect)
            values[effect] = (nested if isinstance(nested, dict) else {}) | {parameter: values.pop(key)}  # type: ignore[assignment]
    document: dict[str, Any] = {"joint": rig.joints[0]} if len(rig.joints) == 1 else {"joints": list(rig.joints)}
    if rig.robot is not None:
        document["robot"] = str(rig.robot)
    document["drive"] = _one_or_each(rig.drive)
    if "prismatic" in rig.joint_types.values():
        document["joint_type"] = _one_or_each(rig.joint_types)
    if any(load != "torque" for load in rig.load.values()):
        document["load"] = _one_or_each({joint: _load_entry(load) for joint, load in rig.load.items()})
    if any(declared.values()):
        document["declared"] = _one_or_each(declared)
    document |= {
        key: dict(getattr(rig, key))
        for key in ("columns", "units", "saturation", "drive_gain", "derivative_gain", "coupled")
        if getattr(rig, key)
    }
    document |= {key: getattr(rig, key) for key in ("enabled", "command_hold") if getattr(rig, key) is not None}
    if rig.valid:
        document["valid"] = [condition.text for condition in rig.valid]
    sensors = sensors_entry(rig.sensors, rig.tolerances, rig.tares)
    if sensors:
        document["sensors"] = sensors
    return document


def save_rig(rig: Rig, path: Path | str, comment: str = "") -> Path:
    """Write a rig file that `load_rig` reads back; `comment` goes on top, one '#' a line.

    The robot file is named relative to the rig file, as `load_rig` reads it.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    document = rig_document(rig)
    if rig.robot is not None:
        document["robot"] = os.path.relpath(rig.robot, path.parent)
    body = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    write_whole(path, head + body)
    return path
