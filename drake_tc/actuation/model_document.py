"""What an actuator model file may say: one line an effect. `drake_tc.actuation.model_file` reads and writes it."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias, get_args

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.config.joint_units import JointType
from drake_tc.config.keys import Keys, Name, PositiveNumber, UnboundedNumber, key, one_of, unknown_key
from drake_tc.config.quoted import quoted
from drake_tc.effects.base import DriveKind
from drake_tc.effects.library import all_effects, effect
from drake_tc.effects.parameter import Parameter
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

    def model(self, joint: str) -> ActuatorModel:
        """The joint's model."""
        effects = tuple(each.value() for each in self.effects or ())
        return ActuatorModel(joint, Drive(self.drive.kind, self.drive.gain), effects, self.joint_type or "revolute")


class ModelDocument(Keys):
    """What an actuator model file may say."""

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
