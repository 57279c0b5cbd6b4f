"""Actuator models as YAML: one line an effect, read strictly."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from drake_tc.actuation.model import ActuatorModel, EffectValue
from drake_tc.actuation.model_document import ModelDocument
from drake_tc.config.files import write_whole
from drake_tc.config.quoted import quoted
from drake_tc.config.validation import validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.errors import ParamsError

TORQUE_AS_EFFORT = "torques_in_unit_of_effort"
"""Entry of the provenance: joints whose torques are in the unit of the effort, because nothing fixed their scale."""
HINT = "`drake-tc schema actuator --page` explains every key"


@dataclass(frozen=True)
class ModelFile:
    """What a model file holds.

    Attributes:
        models: Joint name to model, in the file's order.
        provenance: Where the numbers come from: record, fit error ...; free-form.
        shared: What no joint owns: `{effect, where, <parameter>: number, ci95}` of a link or sensor each; free-form.
        links: By link, inertial parameters that were fitted together with the joints.
    """

    models: Mapping[str, ActuatorModel]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    shared: tuple[Mapping[str, Any], ...] = ()
    links: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def torque_as_effort(self) -> tuple[str, ...]:
        """Joints of the file whose torques are in the unit of the effort and not in N m."""
        named = self.provenance.get(TORQUE_AS_EFFORT)
        return tuple(joint for joint in self.models if isinstance(named, list) and joint in named)


def load_model_file(path: Path | str) -> ModelFile:
    """Read a model file.

    Raises:
        ParamsError: the file cannot be read, a key is unknown, missing or given twice, or a value is not possible; the
            message names file, joint and field.
    """
    document = read_yaml(Path(path), "model file")
    read = validated(ModelDocument, document, str(path), hint=HINT)
    odd = next((joint for joint in read.joints if not joint.isprintable() or not joint.strip()), None)
    if odd is not None:
        raise ParamsError(f"{path}: joints: expected names of printable characters; got {quoted(odd)}")
    models = {joint: entry.model(joint) for joint, entry in read.joints.items()}
    return ModelFile(models, read.provenance or {}, tuple(read.shared or ()), read.links or {})


def load_models(path: Path | str) -> dict[str, ActuatorModel]:
    """Joint name to model: `load_model_file` without the provenance.

    Raises:
        ParamsError: see `load_model_file`.

    Example:
        >>> models = load_models(MODELS / "hrp2_like" / "hrp2_like_leg_actuators.yaml")
        >>> models["r_knee"].drive.kind
        'position_servo'
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

    Example:
        >>> models = load_models(MODELS / "hrp2_like" / "hrp2_like_leg_actuators.yaml")
        >>> save_models(models, FOLDER / "copy.yaml", provenance={"source": "a copy"})
        >>> load_models(FOLDER / "copy.yaml") == models
        True
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
        if model.joint_type != "revolute":
            lines.append(f"    joint_type: {model.joint_type}")
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
    write_whole(path, "\n".join(lines) + "\n")
