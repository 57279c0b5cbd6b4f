"""The rig file: which joints a log shows, how their drives and columns read, and what the owner already models.

    joint: knee                        # or  joints: [hip, knee]; not needed where `robot` says it
    robot: leg.yaml                    # optional; robot file, relative to this one: its model gives the load torques
    drive: position_servo              # current | voltage; or a mapping by joint
    columns: {position: q_meas}        # optional; canonical name (or its last part, for one joint): name in the file
    units: {position: deg, torque: -N*m, current: 0.001}   # optional; '-' flips the sign, a number is a factor
    load: torque                       # optional; or {pendulum: {mass: 0.5, length: 0.1, inertia:, zero:}}, unknown,
                                       # {robot: estimate | inverse_dynamics}, or a mapping by joint
    declared: {rotor_inertia: 0.31, stribeck: null}        # optional; or [stribeck, ...]; or by joint
    enabled: torque_on                 # optional; column that is 0 while the drive is off (those samples are left out)
    saturation: 12.0                   # optional; known effort limit of the drive [rad | A | V]
    drive_gain: 0.08                   # optional; gain of the drive as declared [rad | A | V for 1 N*m]
    sensors: {torque_noise: 0.25 N*m, correlation_time: 20 ms, encoder_step: 1.5 mrad,
              ft_foot: {bias: [2 N, 0.05 N*m], gain: 1 %, alignment: 0.5 deg}, imu_trunk: {part: mpu_6050}}  # optional

Viscous and Coulomb friction are always declared. `sensors` says what the sensors do (`drake_tc.logs.rig_sensors`): the
noise of the joints' channels replaces what is estimated from the log; biases, gains and alignments of F/T sensors and
IMUs are standard deviations, and errors within them are estimated along with everything else but never reported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from drake_tc.errors import RigError
from drake_tc.logs import rig_fields
from drake_tc.logs.loads import Load, Pendulum, RobotLoad
from drake_tc.logs.rig_fields import Declared, DriveKind
from drake_tc.logs.rig_robot import check_robot_load, parse_robot, robot_joints
from drake_tc.logs.rig_sensors import parse_sensors, sensors_entry
from drake_tc.logs.sensors import (
    FORCE_TORQUE_PARTS,
    IMU_PARTS,
    ForceTorqueTolerance,
    ImuTolerance,
    JointSensors,
    Tolerance,
)

_KEYS = (
    *("joint", "joints", "robot", "drive", "columns", "units", "load", "declared", "enabled", "saturation"),
    *("drive_gain", "sensors"),
)
_COMMAND: Mapping[DriveKind, str] = {"position_servo": "position_command", "current": "current", "voltage": "voltage"}


def _empty() -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True)
class Rig:
    """What the owner says of the rig; every mapping by joint has an entry for every joint.

    Attributes:
        joints: Names, in the order of the file.
        drive: Kind of drive by joint.
        load: By joint: "torque" (its column), "unknown", a `Pendulum`, or a `RobotLoad` (of all joints then).
        declared: By joint: effect id to its known value, or None for "modelled, value unknown". Always has viscous
            and coulomb. A parameter of an effect is `id.parameter`.
        columns: Canonical column name to the name in the log file, where they differ.
        units: Canonical name or suffix to a unit or scale factor, where not SI.
        enabled: Name in the log of the column that is 0 while the drive is off, or None.
        saturation: Known effort limit by joint [rad | A | V], where known.
        drive_gain: Declared gain K_0 by joint [effort/(N m)], where it is declared.
        source: The file it came from, or None.
        robot: The robot file whose model gives the loads, or None.
        sensors: Declared noise by joint; see `joint_sensors`.
        tolerances: Declared tolerances by the sensor's column name (`ft_foot`, `imu_trunk`).
    """

    joints: tuple[str, ...]
    drive: Mapping[str, DriveKind]
    load: Mapping[str, Load]
    declared: Mapping[str, Declared]
    columns: Mapping[str, str] = field(default_factory=_empty)
    units: Mapping[str, str | float] = field(default_factory=_empty)
    enabled: str | None = None
    saturation: Mapping[str, float] = field(default_factory=_empty)
    drive_gain: Mapping[str, float] = field(default_factory=_empty)
    source: Path | None = None
    robot: Path | None = None
    sensors: Mapping[str, JointSensors] = field(default_factory=_empty)
    tolerances: Mapping[str, Tolerance] = field(default_factory=_empty)

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

    def command_column(self, joint: str) -> str:
        """Canonical name of the drive's command: `<joint>/position_command`, `/current` or `/voltage`."""
        return f"{joint}/{_COMMAND[self.drive[joint]]}"

    def required_columns(self, joint: str) -> tuple[str, ...]:
        """Canonical columns without which the joint cannot be diagnosed."""
        needed = [f"{joint}/position", self.command_column(joint)]
        if self.load[joint] == "torque":
            needed.append(f"{joint}/torque")
        return tuple(needed)

    def known(self, joint: str, effect: str, default: float = 0.0) -> float:
        """The declared value of an effect, or `default` where it is not declared or its value is unknown."""
        value = self.declared[joint].get(effect)
        return default if value is None else value


def parse_rig(document: object, source: Path | str = "rig") -> Rig:
    """A rig from what its YAML says.

    Raises:
        RigError: Unknown or missing key, or a bad value; names file, key and what is possible.
    """
    name = str(source)
    if not isinstance(document, Mapping):
        raise RigError(f"{name}: wanted a mapping with the keys {', '.join(_KEYS)}, got {type(document).__name__}")
    for key in document:
        if key not in _KEYS:
            hint = rig_fields.near(str(key), _KEYS)
            raise RigError(f"{name}: unknown key {key!r}{hint}; allowed: {', '.join(_KEYS)}")
    robot = parse_robot(name, document.get("robot"), source)
    if robot is not None and not {"joint", "joints"} & set(document):
        document = {**document, "joints": robot_joints(name, robot)}
    if robot is not None and document.get("load") is None:
        document = {**document, "load": {"robot": "estimate"}}
    joints = rig_fields.parse_joints(name, document)
    if "drive" not in document:
        raise RigError(f"{name}: drive is missing; possible: position_servo, current, voltage")
    sensors, tolerances = parse_sensors(name, document.get("sensors"), joints, robot)
    rig = Rig(
        joints=joints,
        drive=rig_fields.parse_drive(name, document["drive"], joints),
        load=rig_fields.parse_load(name, document.get("load"), joints),
        declared=rig_fields.parse_declared(name, document.get("declared"), joints),
        columns=rig_fields.parse_columns(name, document.get("columns"), joints),
        units=rig_fields.parse_units(name, document.get("units"), joints),
        enabled=rig_fields.parse_enabled(name, document.get("enabled")),
        saturation=rig_fields.parse_positive(name, "saturation", document.get("saturation"), joints, "effort limit"),
        drive_gain=rig_fields.parse_positive(
            name, "drive_gain", document.get("drive_gain"), joints, "effort for 1 N*m of torque"
        ),
        source=source if isinstance(source, Path) else None,
        robot=robot,
        sensors=sensors,
        tolerances=tolerances,
    )
    check_robot_load(name, rig.load, robot)
    return rig


def load_rig(path: Path | str) -> Rig:
    """Read a rig file.

    Raises:
        RigError: No such file, not YAML, or not a rig; names file and key.
    """
    path = Path(path)
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RigError(f"{path}: no such rig file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"{path}: cannot be read: {error}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" at line {mark.line + 1}" if mark is not None else ""
        raise RigError(
            f"{path}: not valid YAML{where}: {getattr(error, 'problem', None) or 'cannot be parsed'}"
        ) from None
    return parse_rig(document, path)


def _load_entry(load: Load) -> object:
    if isinstance(load, RobotLoad):
        return {"robot": load.method}
    if not isinstance(load, Pendulum):
        return load
    entry = {"mass": load.mass, "length": load.length, "inertia": load.inertia}
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
        for key in [k for k in values if "." in k]:
            effect, parameter = key.split(".", 1)
            nested: Any = values.get(effect)
            values[effect] = (nested if isinstance(nested, dict) else {}) | {parameter: values.pop(key)}  # type: ignore[assignment]
    document: dict[str, Any] = {"joint": rig.joints[0]} if len(rig.joints) == 1 else {"joints": list(rig.joints)}
    if rig.robot is not None:
        document["robot"] = str(rig.robot)
    document["drive"] = _one_or_each(rig.drive)
    if any(load != "torque" for load in rig.load.values()):
        document["load"] = _one_or_each({joint: _load_entry(load) for joint, load in rig.load.items()})
    if any(declared.values()):
        document["declared"] = _one_or_each(declared)
    document |= {
        key: dict(getattr(rig, key)) for key in ("columns", "units", "saturation", "drive_gain") if getattr(rig, key)
    }
    if rig.enabled is not None:
        document["enabled"] = rig.enabled
    sensors = sensors_entry(rig.sensors, rig.tolerances)
    if sensors:
        document["sensors"] = sensors
    return document


def save_rig(rig: Rig, path: Path | str, comment: str = "") -> Path:
    """Write a rig file that `load_rig` reads back; `comment` goes on top, one '#' a line."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    body = yaml.safe_dump(rig_document(rig), sort_keys=False, allow_unicode=True)
    path.write_text(head + body, encoding="utf-8")
    return path
