"""Ground of the models of input files: a mapping with known keys, what is said of each key, values of each kind.

A file's model is a class with one attribute a key; it is the one source of the file's checks, its page and its JSON
schema. A validator raises `ValueError` with the text behind "file: key: "; `config.validation` puts these before it.

Values with units in input files: a number in SI, or a text such as `0.1 deg`.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, ClassVar

from pydantic import (
    AfterValidator,
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

from drake_tc.config.quoted import did_you_mean, located, quoted
from drake_tc.errors import DrakeTcError

RATIO: Mapping[str, float] = {"": 1.0, "%": 0.01}
"""Units of a relative quantity."""


SMALLEST, LARGEST = 1e-20, 1e12
"""Range of the sizes of physical values in SI; their powers and quotients are then finite numbers."""


def check_sizes(document: object, place: tuple[str | int, ...] = ()) -> None:
    """Refuse numbers of plain data that are no physical values: finite, not zero, and outside `SMALLEST` to `LARGEST`.

    Args:
        document: Mappings, lists and values, at any depth.
        place: Of the document in its file, for the message.

    Raises:
        ValueError: Names the place of the first such number.
    """
    if isinstance(document, Mapping):
        for key, value in document.items():
            check_sizes(value, (*place, key))
    elif isinstance(document, list):
        for index, value in enumerate(document):
            check_sizes(value, (*place, index))
    elif isinstance(document, (int, float)) and not isinstance(document, bool) and not _has_size(document):
        raise ValueError(f"{located(place)}: {_expected_size(document)}")


def _has_size(value: float) -> bool:
    return value == 0 or not abs(value) < math.inf or SMALLEST <= abs(value) <= LARGEST


def _expected_size(value: object) -> str:
    return f"expected 0 or a number of size {SMALLEST:g} to {LARGEST:g}, got {quoted(value)}"


def quantity(units: Mapping[str, float], value: object) -> float:
    """A value in SI, from a number (SI) or a text such as "0.1 deg".

    Args:
        units: Those that the text may have, with their factors to SI; `RATIO` for a relative quantity.
        value: Number or text.

    Raises:
        ValueError: Neither, and the message lists the possible units; or a text of a size that nothing has.
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    number, _, unit = value.strip().partition(" ") if isinstance(value, str) else ("", "", "")
    try:
        size = float(number)
    except ValueError:
        size = math.nan
    if not math.isfinite(size) or unit.strip() not in units:
        listed = ", ".join(unit for unit in units if unit)
        raise ValueError(
            f"expected a number or a text such as '0.1 {listed.split(',')[0]}', got {quoted(value)}; units: {listed}"
        )
    if not _has_size(size * units[unit.strip()]):
        raise ValueError(_expected_size(value))
    return size * units[unit.strip()]


HIDDEN = "@"
"""Parts of a location that begin so are names of ours (a branch of a union) and are left out of messages."""


class Keys(BaseModel):
    """A mapping of an input file: nothing but the keys of the class, every one of the type it has there."""

    SCHEMA: ClassVar[str] = ""
    """What `drake-tc schema` calls the file, where the mapping is a whole file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @classmethod
    def how_explained(cls) -> str:
        """Where the keys of the file are explained."""
        return f"`drake-tc schema {cls.SCHEMA} --page` explains every key" if cls.SCHEMA else ""

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, value: object) -> object:
        fields = {field.alias or name: field for name, field in cls.model_fields.items()}
        allowed = [name for name in fields if not name.startswith(HIDDEN)]
        if not isinstance(value, Mapping):
            raise ValueError(f"expected a mapping with {', '.join(allowed)}, got {quoted(value)}")
        cls.check_together(value)
        for name in value:
            if name not in fields and not cls.allows_more():
                raise ValueError(unknown_key(name, allowed))
        for name, field in fields.items():
            if field.is_required() and name not in value:
                shape = expected(field)
                raise ValueError(f"{name} is missing{f'; expected {shape}' if shape else ''}")
        return value

    @classmethod
    def allows_more(cls) -> bool:
        """Whether `check_together` decides which other keys there may be."""
        return cls.model_config.get("extra") == "allow"

    @classmethod
    def check_together(cls, value: Mapping[str, object]) -> None:
        """Checks what concerns several keys, before any value is looked at.

        Raises:
            ValueError: The keys do not go together.
        """

    @model_validator(mode="after")
    def _check_values(self) -> "Keys":
        try:
            self.check()
        except DrakeTcError as error:
            raise ValueError(str(error)) from None
        return self

    def check(self) -> None:
        """Checks what concerns several values.

        Raises:
            ValueError: The values do not go together.
            DrakeTcError: What is made of them says so.
        """

    def given(self) -> dict[str, Any]:
        """The values that the file gives, null left out."""
        values = ((name, getattr(self, name)) for name in type(self).model_fields if name in self.model_fields_set)
        return {name: value for name, value in values if value is not None}


def unknown_key(name: object, allowed: Iterable[str]) -> str:
    """The message for a key that there is not."""
    names = list(allowed)
    return f"unknown key {quoted(name)}{did_you_mean(str(name), names)}; allowed: {', '.join(names) or 'none'}"


def expected(field: FieldInfo) -> str:
    """Description of the value that a required key takes, as declared with `key`."""
    return _told(field, "expected")


def unit_of(field: FieldInfo) -> str:
    """Unit of a plain number; empty where the key has none."""
    return _told(field, "unit")


def default_of(field: FieldInfo) -> str:
    """What holds when the key is absent."""
    if field.is_required():
        return "required"
    told = _told(field, "absent")
    return told if told or field.default is None else f"{field.default:g}"


def _told(field: FieldInfo, what: str) -> str:
    extra = field.json_schema_extra
    return str(extra.get(what, "")) if isinstance(extra, Mapping) else ""


def key(
    meaning: str,
    *,
    example: object = None,
    unit: str = "",
    expected: str = "",
    default: Any = None,
    absent: str = "",
    name: str | None = None,
) -> Any:
    """A key of an input file.

    Args:
        meaning: What it says; whole sentences.
        example: A value that the file may have; None for a key whose type says it.
        unit: SI unit of a plain number.
        expected: What to give, for the message that it is missing.
        default: Value when the key is absent; `...` for a key that is required.
        absent: What holds when the key is absent, where `default` does not say it.
        name: As it stands in the file, where Python has another use for the word.
    """
    extra: dict[str, JsonValue] = {"unit": unit, "absent": absent, "expected": expected}
    examples = None if example is None else [example]
    return Field(default, description=meaning, examples=examples, json_schema_extra=extra, alias=name)


def saying(what: str) -> WrapValidator:
    """Replaces pydantic's message for a plain value by "expected <what>, got <value>"."""

    def check(value: object, handler: Callable[[object], object]) -> object:
        try:
            return handler(value)
        except ValidationError:
            raise ValueError(f"expected {what}, got {quoted(value)}") from None

    return WrapValidator(check)


def one_of(names: tuple[str, ...]) -> WrapValidator:
    """Replaces pydantic's message for a `Literal` by one with the nearest match."""

    def check(value: object, handler: Callable[[object], object]) -> object:
        try:
            return handler(value)
        except ValidationError:
            hint = did_you_mean(str(value), names) if isinstance(value, str) else ""
            raise ValueError(f"expected one of {', '.join(names)}, got {quoted(value)}{hint}") from None

    return WrapValidator(check)


Number = Annotated[float, saying("a finite number")]
PositiveNumber = Annotated[float, Field(gt=0.0), saying("a positive number")]
NumberFromZero = Annotated[float, Field(ge=0.0), saying("a number >= 0")]
UnboundedNumber = Annotated[float, Field(allow_inf_nan=True), AfterValidator(lambda x: _not_nan(x)), saying("a number")]
AnyNumber = Annotated[float, Field(allow_inf_nan=True), saying("a number")]
PositiveUnboundedNumber = Annotated[float, Field(gt=0.0, allow_inf_nan=True), saying("a positive number")]
WholeNumber = Annotated[int, Field(ge=1), BeforeValidator(lambda x: _whole(x)), saying("a whole number >= 1")]
Name = Annotated[str, Field(pattern=r"\S"), saying("a name (text)")]
FileName = Annotated[str, Field(min_length=1), saying("the name of a file")]
Flag = Annotated[bool, saying("true or false")]


def _not_nan(value: float) -> float:
    if value != value:
        raise ValueError("not a number")
    return value


def _whole(value: object) -> object:
    """2.0 is a whole number."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _tuple_of(size: int) -> Callable[[object], object]:
    def read(value: object) -> object:
        if not isinstance(value, list | tuple) or len(value) != size:
            raise ValueError(f"expected a list of {size} numbers, got {quoted(value)}")
        return tuple(value)

    return read


Triple = Annotated[tuple[Number, Number, Number], BeforeValidator(_tuple_of(3))]
FourNumbers = Annotated[tuple[Number, Number, Number, Number], BeforeValidator(_tuple_of(4))]


def _different(names: list[str]) -> list[str]:
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise ValueError(f"{quoted(twice[0])} is listed twice")
    return names


Names = Annotated[list[Name], Field(min_length=1), AfterValidator(_different)]
"""Different names, one at least."""


def magnitude(units: Mapping[str, float]) -> Callable[[object], float]:
    """Reader of a value >= 0: a number in SI, or a text with one of the units."""

    def read(value: object) -> float:
        number = quantity(units, value)
        if number < 0.0:
            raise ValueError(f"expected a value >= 0, got {quoted(value)}")
        return number

    return read


def magnitude_schema() -> dict[str, Any]:
    """JSON schema of a magnitude."""
    text = {"type": "string", "pattern": r"^\s*[0-9.eE+-]+\s+\S+\s*$"}
    return {"anyOf": [{"type": "number", "minimum": 0}, text]}


def magnitude_in(units: Mapping[str, float]) -> Any:
    """Annotations of a magnitude with one of the units."""
    return (BeforeValidator(magnitude(units)), WithJsonSchema(magnitude_schema()))


Ratio = Annotated[float, *magnitude_in(RATIO)]
"""A relative error: a number or a text in percent."""
