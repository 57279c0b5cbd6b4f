"""Actuator models as YAML: one line an effect, read strictly.

What an actuator model file may say: one line an effect. `drake_tc.actuation.model_file` reads and writes it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, TypeAlias, get_args

import numpy as np
import yaml
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.actuation.remainder import Remainder
from drake_tc.config.files import write_whole
from drake_tc.config.joint_units import JointType
from drake_tc.config.keys import (
    AnyNumber,
    Keys,
    Name,
    Number,
    PositiveNumber,
    UnboundedNumber,
    key,
    one_of,
    unknown_key,
)
from drake_tc.config.quoted import quoted
from drake_tc.config.records import validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.effects.base import DriveKind
from drake_tc.effects.context import Parameter
from drake_tc.effects.library import all_effects, effect
from drake_tc.errors import ParamsError


def _pair(value: object) -> object:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(f"expected [low, high], got {quoted(value)}")
    return tuple(value)


def _ordered(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] <= value[1]:
        raise ValueError(f"expected [low, high] with low <= high, got {list(value)}")
    return value


Interval: TypeAlias = Annotated[
    tuple[UnboundedNumber, UnboundedNumber], BeforeValidator(_pair), AfterValidator(_ordered)
]


class DriveKeys(Keys):
    """What turns the drive's effort into torque."""

    kind: Annotated[DriveKind, one_of(get_args(DriveKind))] = key(
        "What the drive is commanded with: a position, a current, a voltage or a torque.",
        example="position_servo",
        default=...,
        expected=f"one of {', '.join(get_args(DriveKind))}",
    )
    gain: PositiveNumber = key(
        "Effort for 1 N·m.",
        unit="rad, A, V or N·m for 1 N·m",
        example=1.6e-4,
        default=...,
        expected="a positive number",
    )


def _branches(schema: dict[str, Any]) -> None:
    """The JSON schema as one alternative for each effect of the library."""
    common = {name: entry for name, entry in schema["properties"].items() if name != "effect"}
    branches = []
    for one in all_effects():
        numbers = {parameter.name: _number_schema(parameter) for parameter in one.parameters}
        required = ["effect", *(p.name for p in one.parameters if _is_required(p))]
        properties = {"effect": {"enum": sorted({one.id, one.key}), "description": one.title}, **numbers, **common}
        branches.append(
            {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
        )
    for name in ("properties", "required", "additionalProperties"):
        schema.pop(name, None)
    schema["anyOf"] = branches


def _number_schema(parameter: Parameter) -> dict[str, Any]:
    bounds = {"minimum": parameter.lower, "maximum": parameter.upper}
    unit = f"[{parameter.unit}]"
    text = f"{parameter.description} {unit}" if parameter.description else unit
    return {"type": "number", "description": text} | {k: v for k, v in bounds.items() if abs(v) < float("inf")}


def _is_required(parameter: Parameter) -> bool:
    return abs(parameter.default) != float("inf")


class EffectKeys(Keys):
    """One effect: its id, and one key for each of its parameters.

    `drake-tc schema actuator` lists the parameters of every effect with their units and bounds; RIG.md has the effects
    in a table.
    """

    model_config = ConfigDict(extra="allow", json_schema_extra=_branches)
    __pydantic_extra__: dict[str, UnboundedNumber] = Field(init=False)

    effect: Name = key(
        "Id of the effect, or `id.form` where it has several forms.",
        example="viscous",
        default=...,
        expected="the id of an effect",
    )
    ci95: dict[str, Interval] | None = key(
        "By parameter, the 95 % confidence interval of an identified value.",
        example={"viscous": [30.0, 32.0]},
        absent="not known",
    )
    at_bound: list[Name] | None = key(
        "Parameters whose identified value rests on a bound.", example=["viscous"], absent="none"
    )

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """The effect is known; its parameters are there and no others."""
        name = value.get("effect")
        if not isinstance(name, str):
            raise ValueError(f"expected {{effect: <id>, <parameter>: <number>, ...}}, got {quoted(value)}")
        try:
            parameters = effect(name).parameters
        except ParamsError as error:
            raise ValueError(f"effect: {error}") from None
        for each in value:
            if each not in cls.model_fields and each not in (names := [p.name for p in parameters]):
                raise ValueError(unknown_key(each, (*names, *cls.model_fields)))
        for parameter in parameters:
            if parameter.name not in value and _is_required(parameter):
                raise ValueError(f"{parameter.name} is missing; expected a number [{parameter.unit}]")

    def check(self) -> None:
        """The values are within their bounds."""
        self.value()

    def value(self) -> EffectValue:
        """The effect with its numbers.

        Raises:
            ParamsError: A number that is out of its parameter's bounds.
        """
        return EffectValue(self.effect, self.__pydantic_extra__ or {}, self.ci95 or {}, tuple(self.at_bound or ()))


class RemainderKeys(Keys):
    """Torque that no effect explains, a smooth function of position, velocity, direction and load torque.

    `drake_tc.actuation.remainder` has its equation. Controllers and simulated actuators do not use it.
    """

    share: AnyNumber = key(
        "Share of the squared error of held-out runs that it explains.", example=0.12, default=float("nan")
    )
    share_ci95: Interval | None = key("95 % interval of the share.", example=[0.08, 0.15], absent="not known")
    center: list[Number] = key(
        "Mean that is subtracted from each signal.", example=[0.0] * 4, default=..., expected="4 numbers"
    )
    scale: list[PositiveNumber] = key(
        "Divisor of each signal after that.", example=[1.0] * 4, default=..., expected="4 positive numbers"
    )
    points: list[list[Number]] = key(
        "Scaled signals of the fitted data, near which the function holds.",
        example=[[0.0] * 4],
        default=...,
        expected="a list of rows of 4 numbers",
    )
    radius: Number = key(
        "Distance from these points up to which it holds, in scaled signals.",
        example=1.0,
        default=...,
        expected="a number >= 0",
    )
    slow: PositiveNumber = key(
        "Speed v_s of the direction tanh(v/v_s).",
        unit="rad/s",
        example=0.05,
        default=...,
        expected="a positive number",
    )
    largest: Number = key("Bound of the torque.", unit="N·m", example=0.8, default=..., expected="a number >= 0")
    weights: list[Number] = key(
        "Weights of the features.", unit="N·m", example=[0.1, -0.2], default=..., expected="a list of numbers"
    )

    def value(self) -> Remainder:
        """The function."""
        center, scale, points, weights = map(np.array, (self.center, self.scale, self.points, self.weights))
        known = self.share_ci95 or (math.nan, math.nan)
        return Remainder(center, scale, points, self.radius, self.slow, self.largest, weights, self.share, known)


class JointKeys(Keys):
    """One joint's actuator."""

    drive: DriveKeys = key(
        "The drive.",
        example={"kind": "current", "gain": 0.08},
        default=...,
        expected="{kind:, gain:}",
    )
    joint_type: Annotated[JointType, one_of(get_args(JointType))] | None = key(
        "Whether the joint turns (`revolute`) or slides (`prismatic`). The quantities of a prismatic joint are in "
        "m, N and kg in place of rad, N·m and kg m².",
        example="prismatic",
        absent="`revolute`",
    )
    effects: list[EffectKeys] | None = key(
        "Effects between the command and the link, one a line. Drive effects act in this order.",
        example=[{"effect": "viscous", "viscous": 31.0}],
        absent="none",
    )
    remainder: RemainderKeys | None = key(
        "Torque that no effect explains, of a joint whose verdict is `unexplained_structure`.",
        example={
            "share": 0.12, "center": [0.0] * 4, "scale": [1.0] * 4, "points": [[0.0] * 4], "radius": 1.0, "slow": 0.05,
            "largest": 0.8, "weights": [0.1, -0.2],
        },
        absent="none",
    )  # fmt: skip

    def model(self, joint: str) -> ActuatorModel:
        """The joint's model."""
        effects = tuple(each.value() for each in self.effects or ())
        return ActuatorModel(joint, Drive(self.drive.kind, self.drive.gain), effects, self.joint_type or "revolute")


class ModelDocument(Keys):
    """What an actuator model file may say."""

    SCHEMA: ClassVar[str] = "actuator"

    joints: Annotated[dict[str, JointKeys], Field(min_length=1)] = key(
        "By joint, its drive and its effects.",
        example={"knee": {"drive": {"kind": "current", "gain": 0.08}, "effects": []}},
        default=...,
        expected="a mapping of joint to model",
    )
    provenance: dict[str, Any] | None = key(
        "Where the numbers come from: record, error of the fit; free-form.", example={"record": "run_3"}, absent="none"
    )
    shared: list[dict[str, Any]] | None = key(
        "Causes that no joint owns, of a link or a sensor each; free-form.",
        example=[{"effect": "link_mass", "where": "shin", "mass": 0.2}],
        absent="none",
    )
    links: dict[str, dict[str, Any]] | None = key(
        "By link, inertial parameters that were fitted.", example={"shin": {"m": 2.1, "mx": 0.02}}, absent="none"
    )


OF_LINKS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "link_mass": ("mass",),
        "link_com": ("com_x", "com_y", "com_z"),
        "payload": ("mass", "com_x", "com_y", "com_z"),
    }
)
"""Shared causes that change a link, and their numbers in SI units."""
TORQUE_AS_EFFORT = "torques_in_unit_of_effort"
"""Entry of the provenance: joints whose torques are in the unit of the effort, because nothing fixed their scale."""


@dataclass(frozen=True)
class ModelFile:
    """What a model file holds.

    Attributes:
        models: Joint name to model, in the file's order.
        provenance: Where the numbers come from: record, fit error ...; free-form.
        shared: What no joint owns: `{effect, where, <parameter>: number, ci95}` of a link or sensor each; free-form.
        links: By link, inertial parameters that were fitted together with the joints.
        remainders: By joint, torque that no effect explains; no controller uses it by itself.
    """

    models: Mapping[str, ActuatorModel]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    shared: Sequence[Mapping[str, Any]] = ()
    links: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    remainders: Mapping[str, Remainder] = field(default_factory=dict)

    @property
    def torque_as_effort(self) -> tuple[str, ...]:
        """Joints of the file whose torques are in the unit of the effort and not in N m."""
        named = self.provenance.get(TORQUE_AS_EFFORT)
        return tuple(joint for joint in self.models if isinstance(named, list) and joint in named)

    def save(self, path: Path | str) -> None:
        """Write the file, one effect a line; `load_model_file` reads the same back.

        Args:
            path: File to write.
        """
        lines = []
        if self.provenance:
            text = yaml.safe_dump(
                {"provenance": dict(self.provenance)}, default_flow_style=False, sort_keys=False, allow_unicode=True
            )
            lines.append(text.rstrip())
        lines.append("joints:")
        for joint, model in self.models.items():
            lines.append(f"  {yaml.safe_dump(joint).splitlines()[0]}:")
            lines.append(f"    drive: {{kind: {model.drive.kind}, gain: {float(model.drive.gain)!r}}}")
            if model.joint_type != "revolute":
                lines.append(f"    joint_type: {model.joint_type}")
            lines.append("    effects:" + ("" if model.effects else " []"))
            lines.extend(f"      - {_line(value)}" for value in model.effects)
            if joint in self.remainders:
                lines.append(f"    remainder: {_flow(_remainder_entry(self.remainders[joint]))}")
        if self.shared:
            lines.append("shared:")
            lines.extend(f"  - {_flow(entry)}" for entry in self.shared)
        if self.links:
            lines.append("links:")
            lines.extend(
                f"  {yaml.safe_dump(link).splitlines()[0]}: {_flow(values)}" for link, values in self.links.items()
            )
        write_whole(path, "\n".join(lines) + "\n")


def load_model_file(path: Path | str) -> ModelFile:
    """Read a model file.

    Raises:
        ParamsError: the file cannot be read, a key is unknown, missing or given twice, or a value is not possible; the
            message names file, joint and field.
    """
    document = read_yaml(Path(path), "model file")
    read = validated(ModelDocument, document, str(path))
    odd = next((joint for joint in read.joints if not joint.isprintable() or not joint.strip()), None)
    if odd is not None:
        raise ParamsError(f"{path}: joints: expected names of printable characters; got {quoted(odd)}")
    models = {joint: entry.model(joint) for joint, entry in read.joints.items()}
    for cause in read.shared or ():
        _check_link(cause, path)
    remainders = {}
    for joint, entry in read.joints.items():
        if entry.remainder is not None:
            try:
                remainders[joint] = entry.remainder.value()
            except ParamsError as error:
                raise ParamsError(f"{path}: joints.{joint}.{error}") from None
    return ModelFile(models, read.provenance or {}, tuple(read.shared or ()), read.links or {}, remainders)


def _check_link(cause: Mapping[str, Any], path: Path | str) -> None:
    """Refuse a change of a link without its numbers.

    Raises:
        ParamsError: names the cause, its link, and the keys that are there in place of the numbers.
    """
    wanted = OF_LINKS.get(str(cause.get("effect")), ())
    missing = [
        name for name in wanted if isinstance(cause.get(name), bool) or not isinstance(cause.get(name), int | float)
    ]
    if missing:
        there = [f"{name}: {quoted(value)}" for name, value in cause.items() if name not in ("effect", "where", "ci95")]
        raise ParamsError(
            f"{path}: shared: {cause['effect']} of {quoted(cause.get('where'))}: expected the numbers"
            f" {', '.join(wanted)}, got {', '.join(there) or 'none'}; missing: {', '.join(missing)}"
        )


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


def _flow(entry: Mapping[str, Any]) -> str:
    return yaml.safe_dump(dict(entry), default_flow_style=True, sort_keys=False, width=10**6).strip()


def _remainder_entry(found: Remainder) -> dict[str, Any]:
    arrays = {name: getattr(found, name).tolist() for name in ("center", "scale", "points")}
    known: dict[str, Any] = {"share": float(found.share), "share_ci95": [float(end) for end in found.share_ci95]}
    if not math.isfinite(found.share):
        known = {}
    return {
        **known,
        **arrays,
        "radius": found.radius,
        "slow": found.slow,
        "largest": found.largest,
        "weights": found.weights.tolist(),
    }


def save_models(
    models: Mapping[str, ActuatorModel], path: Path | str, *, provenance: Mapping[str, Any] | None = None
) -> None:
    """Write a model file that `load_models` reads back to the same models, one effect a line.

    Args:
        models: Joint name to model.
        path: File to write.
        provenance: Where the numbers come from, of plain YAML types.

    Example:
        >>> models = load_models(MODELS / "hrp2_like" / "hrp2_like_leg_actuators.yaml")
        >>> save_models(models, FOLDER / "copy.yaml", provenance={"source": "a copy"})
        >>> load_models(FOLDER / "copy.yaml") == models
        True
    """
    ModelFile(models, provenance or {}).save(path)
