"""Ground of the rig file's model: a mapping with known keys, what is said of each key, values with units.

A validator raises `ValueError` with the whole text behind "file: key: "; `rig_document.errors` puts file and key
before it.
"""

from collections.abc import Callable, Mapping
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    JsonValue,
    ValidationError,
    WithJsonSchema,
    WrapValidator,
    model_validator,
)
from pydantic.fields import FieldInfo

from drake_tc.logs.near import near
from drake_tc.logs.units import quantity

HIDDEN = "@"
"""Parts of a location that begin so are names of ours (a branch of a union) and are left out of messages."""


class Keys(BaseModel):
    """A mapping of the rig file: nothing but the keys of the class, every one of the type it has there."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, value: object) -> object:
        if not isinstance(value, Mapping):
            raise ValueError(f"expected a mapping, got {value!r}")
        fields = {field.alias or name: field for name, field in cls.model_fields.items()}
        allowed = [name for name in fields if not name.startswith(HIDDEN)]
        for name in value:
            if name not in fields:
                raise ValueError(f"unknown key {name!r}{near(str(name), allowed)}; allowed: {', '.join(allowed)}")
        cls.check_together(value)
        for name, field in fields.items():
            if field.is_required() and name not in value:
                raise ValueError(f"{name} is missing; expected {expected(field)}")
        return value

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """Checks what concerns several keys, before any value is looked at.

        Raises:
            ValueError: The keys do not go together.
        """


def expected(field: FieldInfo) -> str:
    """What a required key wants, as `key` was told."""
    return _told(field, "expected")


def unit_of(field: FieldInfo) -> str:
    """Unit of a plain number; empty where the key has none."""
    return _told(field, "unit")


def default_of(field: FieldInfo) -> str:
    """What holds when the key is absent."""
    if field.is_required():
        return "required"
    return _told(field, "absent") or f"{field.default:g}"


def _told(field: FieldInfo, what: str) -> str:
    extra = field.json_schema_extra
    return str(extra.get(what, "")) if isinstance(extra, Mapping) else ""


def key(
    meaning: str, *, example: object, unit: str = "", expected: str = "", default: Any = None, absent: str = ""
) -> Any:
    """A key of the rig file.

    Args:
        meaning: What it says; whole sentences.
        example: A value that the file may have.
        unit: SI unit of a plain number.
        expected: What to give, for the message that it is missing.
        default: Value when the key is absent; `...` for a key that is required.
        absent: What holds when the key is absent, where `default` does not say it.
    """
    extra: dict[str, JsonValue] = {"unit": unit, "absent": absent, "expected": expected}
    return Field(default, description=meaning, examples=[example], json_schema_extra=extra)


def saying(what: str) -> WrapValidator:
    """Replaces pydantic's message for a plain value by "expected <what>, got <value>"."""

    def check(value: object, handler: Callable[[object], object]) -> object:
        try:
            return handler(value)
        except ValidationError:
            raise ValueError(f"expected {what}, got {value!r}") from None

    return WrapValidator(check)


def one_of(names: tuple[str, ...]) -> WrapValidator:
    """Replaces pydantic's message for a `Literal` by one with the nearest match."""

    def check(value: object, handler: Callable[[object], object]) -> object:
        try:
            return handler(value)
        except ValidationError:
            raise ValueError(f"expected one of {', '.join(names)}, got {value!r}{near(str(value), names)}") from None

    return WrapValidator(check)


Number = Annotated[float, saying("a number")]
PositiveNumber = Annotated[float, Field(gt=0.0), saying("a positive number")]


def magnitude(channel: str) -> Callable[[object], float]:
    """Reader of a value >= 0: a number in SI, or a text with a unit that `channel` may have."""

    def read(value: object) -> float:
        number = quantity(channel, value)
        if number < 0.0:
            raise ValueError(f"expected a value >= 0, got {value!r}")
        return number

    return read


def magnitude_schema() -> dict[str, Any]:
    """JSON schema of a magnitude."""
    text = {"type": "string", "pattern": r"^\s*[0-9.eE+-]+\s+\S+\s*$"}
    return {"anyOf": [{"type": "number", "minimum": 0}, text]}


def magnitude_in(channel: str) -> Any:
    """Annotations of a magnitude of `channel`."""
    return (BeforeValidator(magnitude(channel)), WithJsonSchema(magnitude_schema()))


Ratio = Annotated[float, *magnitude_in("ratio")]
"""A relative error: a number or a text in percent."""
