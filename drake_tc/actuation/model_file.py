"""Actuator models as YAML: one line an effect, read strictly."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class ModelFile:
    """What a model file holds.

    Attributes:
        models: Joint name to model, in the file's order.
        provenance: Where the numbers come from: record, fit error ...; free-form.
        shared: What no joint owns: `{effect, where, <parameter>: number, ci95}` of a link or sensor each; free-form.
    """

    models: Mapping[str, ActuatorModel]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    shared: tuple[Mapping[str, Any], ...] = ()


def _keys(where: str, entry: object, required: set[str], optional: set[str]) -> dict[str, Any]:
    """`entry` as a mapping whose keys are as wanted."""
    if not isinstance(entry, dict):
        raise ParamsError(f"{where}: wanted a mapping with {', '.join(sorted(required | optional))}; got {entry!r}")
    for key in entry:
        if key not in required | optional:
            raise ParamsError(f"{where}: unknown key {key!r}; possible: {', '.join(sorted(required | optional))}")
    missing = sorted(required - set(entry))
    if missing:
        raise ParamsError(f"{where}: missing key {missing[0]!r}; wanted: {', '.join(sorted(required))}")
    return entry


def _number(where: str, value: object) -> float:
    """A float; text such as 1e-4, which YAML 1.1 does not take for a number, is read as one."""
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            return float(value)
        except ValueError:
            pass
    raise ParamsError(f"{where}: wanted a number; got {value!r}")


def _effect_value(where: str, entry: object) -> EffectValue:
    if not isinstance(entry, dict) or not isinstance(entry.get("effect"), str):
        raise ParamsError(f"{where}: wanted {{effect: <id>, <parameter>: <number>, ...}}; got {entry!r}")
    rest = {key: value for key, value in entry.items() if key != "effect"}
    where = f"{where}.{entry['effect']}"
    intervals = rest.pop("ci95", {})
    at_bound = rest.pop("at_bound", [])
    if not isinstance(intervals, dict):
        raise ParamsError(f"{where}.ci95: wanted a mapping of parameter to [low, high]; got {intervals!r}")
    if not isinstance(at_bound, list) or not all(isinstance(name, str) for name in at_bound):
        raise ParamsError(f"{where}.at_bound: wanted a list of parameter names; got {at_bound!r}")
    ci95 = {}
    for name, interval in intervals.items():
        if not isinstance(interval, list) or len(interval) != 2:
            raise ParamsError(f"{where}.ci95.{name}: wanted [low, high]; got {interval!r}")
        low, high = (_number(f"{where}.ci95.{name}", bound) for bound in interval)
        if not low <= high:
            raise ParamsError(f"{where}.ci95.{name}: wanted low <= high; got {interval!r}")
        ci95[name] = (low, high)
    parameters = {str(name): _number(f"{where}.{name}", value) for name, value in rest.items()}
    value = EffectValue(entry["effect"], parameters, ci95, tuple(at_bound))
    missing = [p.name for p in value.effect.parameters if p.name not in parameters and not math.isinf(p.default)]
    if missing:
        raise ParamsError(f"{where}: missing parameter {missing[0]!r} [{_unit(value, missing[0])}]")
    return value


def _unit(value: EffectValue, name: str) -> str:
    return next(p.unit for p in value.effect.parameters if p.name == name)


def _model(where: str, joint: str, entry: object) -> ActuatorModel:
    fields = _keys(where, entry, {"drive"}, {"effects"})
    drive = _keys(f"{where}.drive", fields["drive"], {"kind", "gain"}, set())
    effects = fields.get("effects") or []
    if not isinstance(effects, list):
        raise ParamsError(f"{where}.effects: wanted a list, one effect a line; got {effects!r}")
    return ActuatorModel(
        joint,
        Drive(drive["kind"], _number(f"{where}.drive.gain", drive["gain"])),
        tuple(_effect_value(f"{where}.effects[{i}]", effect) for i, effect in enumerate(effects)),
    )


def load_model_file(path: Path | str) -> ModelFile:
    """Read a model file.

    Raises:
        ParamsError: the file cannot be read, a key is unknown, missing or given twice, or a value is not possible; the
            message names file, joint and field.
    """
    document = read_yaml(Path(path), "model file")
    top = _keys(f"{path}", document, {"joints"}, {"provenance", "shared", "links"})
    if not isinstance(top["joints"], dict) or not top["joints"]:
        raise ParamsError(f"{path}: joints: wanted a mapping of joint name to model; got {top['joints']!r}")
    models = {}
    for joint, entry in top["joints"].items():
        where = f"{path}: joint {joint!r}"
        try:
            models[str(joint)] = _model(where, str(joint), entry)
        except ParamsError as error:
            text = str(error)
            raise ParamsError(text if text.startswith(where) else f"{where}: {text}") from None
    shared = top.get("shared") or []
    if not isinstance(shared, list) or not all(isinstance(entry, dict) for entry in shared):
        raise ParamsError(f"{path}: shared: wanted a list of {{effect, where, ...}}; got {shared!r}")
    return ModelFile(models, dict(top.get("provenance") or {}), tuple(shared))


def load_models(path: Path | str) -> dict[str, ActuatorModel]:
    """Joint name to model: `load_model_file` without the provenance.

    Raises:
        ParamsError: see `load_model_file`.
    """
    return dict(load_model_file(path).models)


def models_of_joints(path: Path | str, joints: Sequence[str]) -> dict[str, ActuatorModel]:
    """The models of these joints, in this order.

    Raises:
        ParamsError: see `load_model_file`; or the file lacks a joint.
    """
    models = load_models(path)
    for joint in joints:
        if joint not in models:
            raise ParamsError(f"{path}: no model of joint {joint!r}; joints there: {', '.join(models)}")
    return {joint: models[joint] for joint in joints}


def _line(value: EffectValue) -> str:
    """One effect on one line."""
    numbers = {name: number for name, number in value.parameters.items() if math.isfinite(number)}
    entry: dict[str, Any] = {"effect": value.effect.key, **numbers}
    if value.ci95:
        entry["ci95"] = {name: [float(low), float(high)] for name, (low, high) in value.ci95.items()}
    if value.at_bound:
        entry["at_bound"] = list(value.at_bound)
    return yaml.safe_dump(entry, default_flow_style=True, sort_keys=False, width=10**6, allow_unicode=True).strip()


def save_models(
    models: Mapping[str, ActuatorModel],
    path: Path | str,
    *,
    provenance: Mapping[str, Any] | None = None,
    shared: Sequence[Mapping[str, Any]] = (),
    links: Mapping[str, Mapping[str, float]] | None = None,
) -> None:
    """Write a model file that `load_models` reads back to the same models, one effect a line.

    Args:
        models: Joint name to model.
        path: File to write.
        provenance: Where the numbers come from, of plain YAML types.
        shared: What no joint owns, of plain YAML types.
        links: By link, inertial parameters that were fitted.
    """
    lines = []
    if provenance:
        text = yaml.safe_dump(
            {"provenance": dict(provenance)}, default_flow_style=False, sort_keys=False, allow_unicode=True
        )
        lines.append(text.rstrip())
    lines.append("joints:")
    for joint, model in models.items():
        lines.append(f"  {yaml.safe_dump(joint).splitlines()[0]}:")
        lines.append(f"    drive: {{kind: {model.drive.kind}, gain: {float(model.drive.gain)!r}}}")
        lines.append("    effects:" + ("" if model.effects else " []"))
        lines.extend(f"      - {_line(value)}" for value in model.effects)
    if shared:
        lines.append("shared:")
        lines.extend(
            f"  - {yaml.safe_dump(dict(entry), default_flow_style=True, sort_keys=False, width=10**6).strip()}"
            for entry in shared
        )
    if links:
        lines.append("links:")
        lines.extend(
            f"  {yaml.safe_dump(link).splitlines()[0]}: "
            f"{yaml.safe_dump(dict(values), default_flow_style=True, sort_keys=False, width=10**6).strip()}"
            for link, values in links.items()
        )
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
