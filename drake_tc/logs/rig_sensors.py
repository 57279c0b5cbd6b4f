"""The rig file's key `sensors`: noise of the joints' channels, tolerances of F/T sensors and IMUs.

    sensors:
      torque_noise: 0.25               # of every joint [N m]; or with a unit: 250 mN*m
      correlation_time: 20 ms          # of that noise; 0 for white noise
      encoder_step: 0.09 deg
      position_noise: 0.1 mrad
      knee: {encoder_step: 0.18 deg}   # of one joint, in place of what is said of all
      ft_foot: {bias: [2 N, 0.05 N*m], gain: 1 %, alignment: 0.01 rad}
      imu_trunk: {part: mpu_6050, bias: [0.02 m/s^2, 0.002 rad/s]}

Plain numbers are SI. Tolerances are standard deviations; what is not said of a sensor is that of its `part`, or of a
typical one (`drake_tc.logs.sensors`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import yaml

from drake_tc.errors import RigError
from drake_tc.logs.rig_fields import mapping, near
from drake_tc.logs.sensors import FORCE_TORQUE_PARTS, IMU_PARTS, ForceTorqueTolerance, JointSensors, Tolerance, typical
from drake_tc.logs.units import quantity

_JOINT_FIELDS: Mapping[str, tuple[str, str]] = {
    "torque_noise": ("torque_noise", "torque"),
    "correlation_time": ("torque_correlation_time", "time"),
    "encoder_step": ("encoder_step", "position"),
    "position_noise": ("position_noise", "position"),
}
"""Key in the file to the attribute and the channel whose units it may have."""
_SENSOR_KEYS = ("part", "bias", "gain", "alignment")
_BIASES: Mapping[str, tuple[tuple[str, str], tuple[str, str]]] = {
    "ft": (("force_bias", "fx"), ("torque_bias", "tx")),
    "imu": (("accel_bias", "accel_x"), ("gyro_bias", "gyro_x")),
}


def parse_sensors(
    source: str, value: object, joints: tuple[str, ...], robot: Path | None
) -> tuple[Mapping[str, JointSensors], Mapping[str, Tolerance]]:
    """Noise by joint, with an entry for each, and declared tolerances by the sensor's column name (`ft_foot`).

    Raises:
        RigError: Unknown key, joint, sensor, part or unit, or a bad value; names file and key.
    """
    entries = mapping(source, "sensors", value)
    known = _sensor_columns(robot)
    shared = {key: entry for key, entry in entries.items() if key in _JOINT_FIELDS}
    own: dict[str, object] = {}
    tolerances: dict[str, Tolerance] = {}
    for key, entry in entries.items():
        if key in joints:
            own[key] = entry
        elif key.startswith(("ft_", "imu_")):
            tolerances[key] = _tolerance(source, key, entry, known)
        elif key not in shared:
            allowed = (*_JOINT_FIELDS, *joints, *known)
            raise RigError(
                f"{source}: sensors: unknown key {key!r}{near(key, allowed)}; possible: {', '.join(allowed)}"
            )
    everywhere = _noise(source, "sensors", shared, JointSensors())
    return {
        joint: _noise(source, f"sensors: {joint}", mapping(source, f"sensors: {joint}", own.get(joint)), everywhere)
        for joint in joints
    }, tolerances


def _sensor_columns(robot: Path | None) -> tuple[str, ...]:
    """`imu_<name>` and `ft_<name>` of the robot file's sensors; none where it cannot be read (others say so)."""
    if robot is None:
        return ()
    try:
        document = yaml.safe_load(robot.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        return ()
    found = []
    for key, prefix in (("imu", "imu_"), ("force_torque", "ft_")):
        entries = document.get(key) if isinstance(document, Mapping) else None
        found += [f"{prefix}{name}" for name in entries] if isinstance(entries, Mapping) else []
    return tuple(found)


def _noise(source: str, where: str, entries: Mapping[str, Any], before: JointSensors) -> JointSensors:
    changed = {}
    for key, entry in entries.items():
        if key not in _JOINT_FIELDS:
            hint = near(key, _JOINT_FIELDS)
            raise RigError(f"{source}: {where}: unknown key {key!r}{hint}; possible: {', '.join(_JOINT_FIELDS)}")
        attribute, channel = _JOINT_FIELDS[key]
        changed[attribute] = _value(source, f"{where}: {key}", entry, channel)
    return replace(before, **changed)


def _value(source: str, where: str, entry: object, channel: str) -> float:
    """A number >= 0 in SI."""
    try:
        number = quantity(channel, entry)
    except ValueError as error:
        raise RigError(f"{source}: {where}: {error}") from None
    if number < 0.0:
        raise RigError(f"{source}: {where}: expected a value >= 0, got {entry!r}")
    return number


def _tolerance(source: str, column: str, entry: object, known: Sequence[str]) -> Tolerance:
    where = f"sensors: {column}"
    if column not in known:
        listed = f"sensors of the robot file: {', '.join(known) or 'none'}" if known else "a sensor needs `robot: FILE`"
        raise RigError(f"{source}: {where}: the rig's robot has no such sensor{near(column, known)}; {listed}")
    entries = mapping(source, where, entry)
    for key in entries:
        if key not in _SENSOR_KEYS:
            hint = near(key, _SENSOR_KEYS)
            raise RigError(f"{source}: {where}: unknown key {key!r}{hint}; possible: {', '.join(_SENSOR_KEYS)}")
    found = _part(source, column, entries.get("part"))
    changed: dict[str, Any] = {}
    for key in ("gain", "alignment"):
        if key in entries:
            changed[key] = _value(source, f"{where}: {key}", entries[key], "ratio" if key == "gain" else "position")
    if "bias" in entries:
        pair, biases = _BIASES[column.partition("_")[0]], entries["bias"]
        if not isinstance(biases, list) or len(biases) != 2:
            names = " and ".join(name.replace("_", " ") for name, _ in pair)
            raise RigError(f"{source}: {where}: bias: expected a list of two values, {names}, got {biases!r}")
        for (attribute, channel), each in zip(pair, biases, strict=True):
            changed[attribute] = _value(source, f"{where}: bias", each, channel)
    return replace(found, **changed)


def _part(source: str, column: str, name: object) -> Tolerance:
    if name is None:
        return typical(column)
    parts: Mapping[str, Tolerance] = FORCE_TORQUE_PARTS if column.startswith("ft_") else IMU_PARTS
    key = str(name).strip().lower().replace("-", "_").replace(" ", "_")
    if key not in parts:
        raise RigError(
            f"{source}: sensors: {column}: part: unknown part {name!r}{near(key, parts)}; known: {', '.join(parts)}"
        )
    return parts[key]


def sensors_entry(noise: Mapping[str, JointSensors], tolerances: Mapping[str, Tolerance]) -> dict[str, Any]:
    """The key's value in SI; `parse_sensors` gives the same back. Empty where nothing is declared."""
    by_joint = {
        joint: {key: asdict(each)[attribute] for key, (attribute, _) in _JOINT_FIELDS.items()}
        for joint, each in noise.items()
    }
    said = {joint: {k: v for k, v in each.items() if v is not None} for joint, each in by_joint.items()}
    same = all(each == next(iter(said.values())) for each in said.values())
    out: dict[str, Any] = dict(next(iter(said.values()), {})) if same else {j: e for j, e in said.items() if e}
    for column, tolerance in tolerances.items():
        if isinstance(tolerance, ForceTorqueTolerance):
            biases = [tolerance.force_bias, tolerance.torque_bias]
        else:
            biases = [tolerance.accel_bias, tolerance.gyro_bias]
        out[column] = {"bias": biases, "gain": tolerance.gain, "alignment": tolerance.alignment}
    return out
