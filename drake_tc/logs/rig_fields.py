"""Parsers of the rig file's keys: each takes what YAML gave and returns typed values or says what is wrong."""

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import fields
from typing import Any, Literal, TypeAlias, cast, get_args

from drake_tc.errors import RigError
from drake_tc.logs.loads import Load, Pendulum, RobotLoad, RobotMethod
from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES, allowed_units, parse_unit

DriveKind: TypeAlias = Literal["position_servo", "current", "voltage"]
Declared: TypeAlias = Mapping[str, float | None]

EFFECT_IDS = (
    *("viscous", "coulomb", "rotor_inertia", "stribeck", "quadratic_viscous", "load_dependent_friction"),
    *("asymmetric_friction", "presliding_hysteresis", "position_dependent_friction", "thermal_friction"),
    *("torque_ripple", "cable_spring", "backlash", "elasticity", "deadzone", "saturation", "servo_integrator"),
    *("velocity_sign_switch", "delay", "current_lag", "payload", "torque_sensor_bias", "torque_sensor_gain"),
    *("torque_sensor_drift", "encoder_offset", "encoder_eccentricity", "encoder_ripple"),
    *("directional_efficiency", "position_dependent_load", "supply_sag", "winding_temperature", "servo_gain"),
    "static_friction",
    *("load_stribeck", "drive_compression", "winding_heat", "load_tilt"),
    *("link_mass", "link_com", "ft_bias", "ft_gain", "imu_bias"),
)


def near(wanted: str, known: Collection[str]) -> str:
    """'; did you mean ...?' when something in `known` is spelt like `wanted`."""
    match = difflib.get_close_matches(wanted, list(known), n=1, cutoff=0.6)
    return f"; did you mean {match[0]!r}?" if match else ""


def mapping(source: str, key: str, value: object) -> dict[str, Any]:
    """`value` as a mapping with text keys; None counts as empty."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise RigError(f"{source}: {key}: wanted a mapping, got {value!r}")
    return {str(name): entry for name, entry in value.items()}


def parse_joints(source: str, document: Mapping[str, Any]) -> tuple[str, ...]:
    """`joint: NAME` or `joints: [..]`, exactly one of them, names distinct."""
    if ("joint" in document) == ("joints" in document):
        raise RigError(f"{source}: wanted one of the keys 'joint' (a name) or 'joints' (a list of names)")
    value = document.get("joint", document.get("joints"))
    names = value if isinstance(value, list) else [value]
    if "joint" in document and isinstance(value, list):
        raise RigError(f"{source}: joint: wanted one name, got {value!r}; a list goes under 'joints'")
    if not names or any(not isinstance(name, str) or not name.strip() for name in names):
        raise RigError(f"{source}: joints: wanted names (text), got {value!r}")
    if len(set(names)) != len(names):
        raise RigError(f"{source}: joints: a name stands twice in {names!r}")
    return tuple(names)


def parse_drive(source: str, value: object, joints: tuple[str, ...]) -> Mapping[str, DriveKind]:
    """One drive for all joints, or a mapping by joint."""
    kinds = get_args(DriveKind)
    by_joint = {str(k): v for k, v in value.items()} if isinstance(value, Mapping) else dict.fromkeys(joints, value)
    for joint in joints:
        if joint not in by_joint:
            raise RigError(f"{source}: drive: no entry for joint {joint!r}; entries here: {sorted(by_joint)}")
    for joint, kind in by_joint.items():
        if joint not in joints:
            raise RigError(f"{source}: drive: {joint!r} is not a joint of this rig; joints: {list(joints)}")
        if kind not in kinds:
            hint = near(str(kind), kinds)
            raise RigError(f"{source}: drive: wanted one of {', '.join(kinds)}, got {kind!r}{hint}")
    return {joint: cast(DriveKind, by_joint[joint]) for joint in joints}


def _canonical_key(source: str, key: str, name: str, joints: tuple[str, ...]) -> str:
    """A full canonical name: `time`, `<joint>/<suffix>`, a sensor's, or a bare suffix of the only joint."""
    if name in ("time", "enabled"):
        return name
    if name in JOINT_SUFFIXES and len(joints) == 1:
        return f"{joints[0]}/{name}"
    owner, _, suffix = name.rpartition("/")
    if owner in joints and suffix in (*JOINT_SUFFIXES, "enabled"):
        return name
    if owner.startswith(("imu_", "ft_")) and suffix in SENSOR_SUFFIXES:
        return name
    known = ["time", *(f"{joint}/{s}" for joint in joints for s in JOINT_SUFFIXES)]
    raise RigError(
        f"{source}: {key}: {name!r} is not a canonical column{near(name, known)}; possible: time, "
        f"{'|'.join(joints)}/{{{', '.join(JOINT_SUFFIXES)}}}"
    )


def parse_columns(source: str, value: object, joints: tuple[str, ...]) -> Mapping[str, str]:
    """Canonical name to the name in the file."""
    columns: dict[str, str] = {}
    for name, file_name in mapping(source, "columns", value).items():
        if not isinstance(file_name, (str, int)) or isinstance(file_name, bool):
            raise RigError(f"{source}: columns: {name}: wanted a column's name in the file, got {file_name!r}")
        columns[_canonical_key(source, "columns", name, joints)] = str(file_name)
    return columns


def parse_units(source: str, value: object, joints: tuple[str, ...]) -> Mapping[str, str | float]:
    """Canonical name, or bare suffix for all joints, to a unit or a scale factor."""
    units: dict[str, str | float] = {}
    for name, unit in mapping(source, "units", value).items():
        if not allowed_units(name) or "/" in name:
            _canonical_key(source, "units", name, joints)
        if not isinstance(unit, (str, int, float)) or isinstance(unit, bool):
            raise RigError(f"{source}: units: {name}: wanted a unit or a scale factor, got {unit!r}")
        try:
            parse_unit(name, unit)
        except ValueError as error:
            raise RigError(f"{source}: units: {name}: {error}") from None
        units[name] = unit
    return units


def _pendulum(source: str, value: object) -> Pendulum:
    allowed = [f.name for f in fields(Pendulum)]
    entries = mapping(source, "load: pendulum", value)
    for name, number in entries.items():
        if name not in allowed:
            raise RigError(f"{source}: load: pendulum: unknown key {name!r}{near(name, allowed)}; allowed: {allowed}")
        if not isinstance(number, (int, float)) or isinstance(number, bool):
            raise RigError(f"{source}: load: pendulum: {name}: wanted a number, got {number!r}")
    for name in ("mass", "length"):
        if name not in entries:
            raise RigError(f"{source}: load: pendulum: {name} is missing (mass [kg] and length [m] are needed)")
    try:
        return Pendulum(**{name: float(number) for name, number in entries.items()})
    except ValueError as error:
        raise RigError(f"{source}: load: pendulum: {error}") from None


def _one_load(source: str, value: object) -> Load:
    if value is None or value == "torque":
        return "torque"
    if value == "unknown":
        return "unknown"
    if isinstance(value, Mapping) and set(value) == {"pendulum"}:
        return _pendulum(source, value["pendulum"])
    if isinstance(value, Mapping) and set(value) == {"robot"} and value["robot"] in get_args(RobotMethod):
        return RobotLoad(value["robot"])
    raise RigError(
        f"{source}: load: wanted 'torque' (the torque column), 'unknown', {{pendulum: {{mass:, length:}}}} or "
        f"{{robot: {' | '.join(get_args(RobotMethod))}}}, got {value!r}"
    )


def _is_pendulum(value: Mapping[Any, Any]) -> bool:
    """Whether `{pendulum: ...}` is the load itself, and not a joint that is called "pendulum"."""
    inner = value.get("pendulum")
    return set(value) == {"pendulum"} and isinstance(inner, Mapping) and "mass" in inner


def parse_load(source: str, value: object, joints: tuple[str, ...]) -> Mapping[str, Load]:
    """One load for all joints, or a mapping by joint (joints not named read the torque column)."""
    named = isinstance(value, Mapping) and value and set(map(str, value)) <= set(joints)
    if isinstance(value, Mapping) and named and not _is_pendulum(value):
        return {joint: _one_load(source, value.get(joint)) for joint in joints}
    load = _one_load(source, value)
    return dict.fromkeys(joints, load)


def _effect(source: str, name: str) -> str:
    if name not in EFFECT_IDS:
        raise RigError(
            f"{source}: declared: unknown effect {name!r}{near(name, EFFECT_IDS)}; known: {', '.join(EFFECT_IDS)}"
        )
    return name


def _declared_values(source: str, value: object) -> dict[str, float | None]:
    """`[id, ..]`, `{id: number or null}` or `{id: {parameter: number}}` (kept as `id` and `id.parameter`)."""
    if isinstance(value, str):
        value = [value]
    if isinstance(value, list):
        return {_effect(source, str(name)): None for name in value}
    result: dict[str, float | None] = {}
    for name, number in mapping(source, "declared", value).items():
        _effect(source, name)
        entries = (
            {name: None} | {f"{name}.{p}": v for p, v in number.items()}
            if isinstance(number, Mapping)
            else {name: number}
        )
        for key, entry in entries.items():
            if entry is not None and (
                isinstance(entry, bool) or not isinstance(entry, (int, float)) or not math.isfinite(entry)
            ):
                raise RigError(
                    f"{source}: declared: {key}: wanted a number, or nothing for 'value unknown', got {entry!r}"
                )
            result[key] = None if entry is None else float(entry)
    inertia = result.get("rotor_inertia")
    if inertia is not None and inertia < 0:
        raise RigError(f"{source}: declared: rotor_inertia: wanted a value >= 0 kg m^2, got {inertia!r}")
    return result


def parse_declared(source: str, value: object, joints: tuple[str, ...]) -> Mapping[str, Declared]:
    """What the user already models, by joint; viscous and Coulomb friction are always in it."""
    always: dict[str, float | None] = {"viscous": None, "coulomb": None}
    by_joint = value if isinstance(value, Mapping) and value and set(map(str, value)) <= set(joints) else None
    result = {}
    for joint in joints:
        own = by_joint.get(joint) if by_joint is not None else value
        result[joint] = always | _declared_values(source, own)
    return result


def parse_enabled(source: str, value: object) -> str | None:
    """The name in the file of the column that is 0 while the drive is off."""
    if value is None or (isinstance(value, str) and value):
        return value
    raise RigError(f"{source}: enabled: wanted the name of a column in the log, got {value!r}")


def parse_positive(source: str, key: str, value: object, joints: tuple[str, ...], what: str) -> Mapping[str, float]:
    """A positive number for all joints or by joint, e.g. the known effort limit of the drive (rad, A or V)."""
    by_joint = mapping(source, key, value) if isinstance(value, Mapping) else {}
    if value is not None and not isinstance(value, Mapping):
        by_joint = dict.fromkeys(joints, value)
    for joint, number in by_joint.items():
        if joint not in joints:
            raise RigError(f"{source}: {key}: {joint!r} is not a joint of this rig; joints: {list(joints)}")
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not 0 < number < math.inf:
            raise RigError(f"{source}: {key}: wanted a positive number ({what}), got {number!r}")
    return {joint: float(number) for joint, number in by_joint.items()}
