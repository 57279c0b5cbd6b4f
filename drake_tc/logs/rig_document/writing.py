"""A rig as a YAML document and as a rig file, which `drake_tc.logs.rig` reads back."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from drake_tc.config.files import write_whole
from drake_tc.logs.loads import Load, Pendulum, RobotLoad, UnknownLoad
from drake_tc.logs.rig import Rig
from drake_tc.logs.rig_document.declared import EFFECT_IDS
from drake_tc.logs.rig_document.sensors import sensors_entry


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
