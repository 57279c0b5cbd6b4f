"""Frozen dataclasses from input files: the dataclass is the model of its mapping in the file.

Its fields are the keys, their types and `Literal`s the checks, the lines under "Attributes:" in its docstring the
explanations. What concerns several values, or a value's range, the dataclass checks itself when it is made.

From pydantic's report to one line: file, key, what was expected, what came, the nearest match.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag, ValidationError, create_model

from drake_tc.config.keys import HIDDEN, Flag, Keys, Number, UnboundedNumber, key, one_of, saying
from drake_tc.config.quoted import did_you_mean, located, quoted
from drake_tc.errors import DrakeTcError, ParamsError

_EXPECTED: Mapping[str, str] = {
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "list_type": "a list",
    "string_type": "text",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "greater_than": "a number above {gt:g}",
    "literal_error": "{expected}",
    "missing": "a value",
    "too_short": "at least {min_length} entry",
}
"""What pydantic's types of error say was expected; other types keep pydantic's own sentence."""
_BEGINS_WITH_KEY = re.compile(r"\w+(\.\w+|\[\d+\])*: (expected|it belongs|unknown) ")
"""A text that continues the place."""

Document = TypeVar("Document", bound=Keys)


def validated(
    model: type[Document],
    document: object,
    source: str = "",
    error: type[DrakeTcError] = ParamsError,
    within: str = "",
) -> Document:
    """The checked document.

    Args:
        model: What the document may say.
        document: Plain data.
        source: Where it comes from, for the message.
        error: What to raise.
        within: Place of the document in its file.

    Raises:
        DrakeTcError: of the kind `error`; the first thing that is wrong in the document, in one line. Where a key is
            unknown or missing, it says where the keys are explained.
    """
    try:
        return model.model_validate(document)
    except ValidationError as found:
        first: Any = found.errors(include_url=False)[0]
        text = _text(first)
        if (hint := model.how_explained()) and (text.startswith("unknown key") or " is missing; " in text):
            text = f"{text} ({hint})"
        place = _place((within, *first["loc"]) if within else first["loc"])
        raise error(message(source, place, text)) from None


def message(source: str, place: str, text: str) -> str:
    """The line of an error; a text that begins with a key continues the place."""
    if place and _BEGINS_WITH_KEY.match(text):
        place, text = f"{place}.{text}", ""
    return ": ".join(part for part in (source, place, text) if part)


def _place(location: tuple[str | int, ...]) -> str:
    parts = list(location)
    if parts and parts[-1] == "[key]":  # the message names the key itself
        parts = parts[:-2]
    return located(part for part in parts if not (isinstance(part, str) and part.startswith(HIDDEN)))


def _text(error: Mapping[str, Any]) -> str:
    context = error.get("ctx", {})
    if error["type"] == "value_error":
        return str(context["error"])
    if error["type"] in _EXPECTED:
        return f"expected {_EXPECTED[error['type']].format(**context)}, got {quoted(error['input'])}"
    return f"{error['msg']}, got {quoted(error['input'])}"


Record = TypeVar("Record")

_KINDS: dict[type[Keys], type[Any]] = {}
"""Model to its dataclass."""
_MODELS: dict[tuple[type[Any], tuple[str, ...]], type[Keys]] = {}
"""Dataclass, and its fields that are not keys, to its model."""


def read_record(
    kind: type[Record],
    document: object,
    source: str,
    more: Mapping[str, Any] | None = None,
    within: str = "",
) -> Record:
    """A dataclass from plain data; nested dataclasses, lists of them and mappings to them included.

    Args:
        kind: The dataclass.
        document: What the file says.
        source: Where it comes from, for the message.
        more: Fields that are not the file's, which may then not give them.
        within: Place of the document in its file.

    Raises:
        ParamsError: an unknown or missing key, or a value that is not possible.
    """
    read = validated(record_keys(kind, *sorted(more or ())), document, source, within=within)
    try:
        return kind(**{name: getattr(read, name) for name in read.model_fields_set}, **(more or {}))
    except DrakeTcError as found:
        raise ParamsError(message(source, within, str(found))) from None


@dataclass(frozen=True)
class Range:
    """Possible values of a number, or of each number of a tuple, as in `Annotated[float, Range(...)]`.

    Attributes:
        words: What is expected, for the message.
        lower: Smallest value.
        upper: Largest value.
        above: Whether the value must exceed `lower`.
        whole: Whether only whole numbers are possible.
        infinite: Whether infinity is possible.
        size: Number of values of a tuple; None: any.
    """

    words: str
    lower: float = -math.inf
    upper: float = math.inf
    above: bool = False
    whole: bool = False
    infinite: bool = False
    size: int | None = None

    def holds(self, value: Any) -> bool:
        """Whether a number, or every number of a tuple, is possible; None is always possible."""
        numbers = tuple(value) if isinstance(value, Iterable) else () if value is None else (value,)
        if not all(isinstance(x, Real) for x in numbers):
            return False
        fits = value is None or self.size is None or len(numbers) == self.size
        fits = fits and not (self.whole and any(isinstance(x, bool) or not isinstance(x, Integral) for x in numbers))
        least = all(self.lower < x if self.above else self.lower <= x for x in numbers)
        return fits and least and all((self.infinite or math.isfinite(x)) and x <= self.upper for x in numbers)


Finite = Annotated[float, Range("a finite number")]
Positive = Annotated[float, Range("a positive number", 0.0, above=True)]
Unbounded = Annotated[float, Range("a positive number", 0.0, above=True, infinite=True)]
FromZero = Annotated[float, Range("a number >= 0", 0.0)]
Three = Annotated[tuple[float, ...], Range("three finite numbers", size=3)]
ThreeFromZero = Annotated[tuple[float, ...], Range("three finite numbers, none negative", 0.0, size=3)]
ThreePositive = Annotated[tuple[float, ...], Range("three positive numbers", 0.0, above=True, size=3)]
Six = Annotated[tuple[float, ...], Range("six finite numbers", size=6)]


class Checked:
    """Base of a frozen dataclass that checks its choices against their `Literal`, its numbers against their `Range`.

    Raises:
        ParamsError: A value is not possible; the message names the field and its unit.
    """

    def __post_init__(self) -> None:
        kind: type[Any] = type(self)
        for name, possible in _checks(kind).items():
            value = getattr(self, name)
            if isinstance(possible, Range):
                if not possible.holds(value):
                    unit = re.search(r" \[(?!-\])[^\]]+\]", _meanings(kind).get(name, ""))
                    raise ParamsError(f"{name}: expected {possible.words}{unit[0] if unit else ''}, got {value!r}")
            elif value not in possible:
                names = [str(each) for each in possible]
                hint = did_you_mean(value, names) if isinstance(value, str) else ""
                raise ParamsError(f"{name}: expected one of {', '.join(names)}, got {quoted(value)}{hint}")


def _checks(kind: type[Any]) -> dict[str, tuple[str | None, ...] | Range]:
    """Field to what it may be: names, or a range."""
    found: dict[str, tuple[str | None, ...] | Range] = {}
    hints = get_type_hints(kind, include_extras=True)
    for name, hint in ((field.name, hints[field.name]) for field in fields(kind)):
        for part in get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,):
            if get_origin(part) is Literal:
                found[name] = get_args(part) if part is hint else (*get_args(part), None)
            elif get_origin(part) is Annotated and isinstance(get_args(part)[1], Range):
                found[name] = get_args(part)[1]
    return found


def _meanings(kind: type[Any]) -> dict[str, str]:
    """Field to its text in the docstrings of a dataclass and its bases."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        found |= attributes_of(base) if is_dataclass(base) else {}
    return found


def record_keys(kind: type[Any], *without: str) -> type[Keys]:
    """The model of a dataclass's mapping; fields called `without` are not keys."""
    if (kind, without) not in _MODELS:
        _MODELS[kind, without] = _keys_of(kind, without)
    return _MODELS[kind, without]


def _keys_of(kind: type[Any], without: tuple[str, ...]) -> type[Keys]:
    hints = get_type_hints(kind, include_extras=True)
    meanings = _meanings(kind)
    keys: Any = {
        field.name: (_annotation(hints[field.name], field), _key(field, meanings.get(field.name, "")))
        for field in sorted(fields(kind), key=_has_default)
        if field.name not in without and field.init
    }
    text = (kind.__doc__ or "").split("Attributes:")[0].split("Raises:")[0].strip()
    made: type[Keys] = create_model(kind.__name__, __base__=Keys, __doc__=text, **keys)
    made.SCHEMA = getattr(kind, "SCHEMA", "")
    _KINDS[made] = kind
    return made


def _has_default(field: Field[Any]) -> bool:
    return field.default is not MISSING or field.default_factory is not MISSING


_NAMES = re.compile(r"^(\w+(?:, \w+)*): (.*)$")


def attributes_of(kind: type[Any]) -> dict[str, str]:
    """Field to the text that "Attributes:" in a class's docstring has of it."""
    _, _, listed = (kind.__doc__ or "").partition("Attributes:\n")
    lines = listed.splitlines()
    depth = len(lines[0]) - len(lines[0].lstrip()) if lines else 0
    found: dict[str, str] = {}
    names: list[str] = []
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if not line.strip() or indent < depth:
            break
        match = _NAMES.match(line.strip()) if indent == depth else None
        if match:
            names = match[1].split(", ")
            found |= dict.fromkeys(names, match[2])
        else:
            found |= {name: f"{found[name]} {line.strip()}" for name in names}
    return found


def _key(field: Field[Any], meaning: str) -> Any:
    if not _has_default(field):
        return key(meaning, default=...)
    default = field.default if field.default_factory is MISSING else None
    nested = field.default_factory is not MISSING and field.default_factory not in (dict, list)
    text = "the defaults of its keys" if nested else _shown(default)
    return key(meaning, default=None, absent=text or "``")


def _shown(value: object) -> str:
    if value is None or value == ():
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(list(value) if isinstance(value, tuple) else value)


def _annotation(hint: Any, field: Field[Any]) -> Any:
    """What pydantic reads for the type of a field; infinity is a value only where it is the default."""
    return _type(hint, UnboundedNumber if _is_infinite(field) else Number)


def _is_infinite(field: Field[Any]) -> bool:
    return isinstance(field.default, float) and math.isinf(field.default)


_WORDS: Mapping[Any, Any] = {
    int: Annotated[int, saying("a whole number")],
    bool: Flag,
    str: Annotated[str, saying("text")],
}


def _type(hint: Any, number: Any) -> Any:
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is float:
        return number
    if hint == Unbounded:
        return UnboundedNumber
    if hint in _WORDS:
        return _WORDS[hint]
    if origin is Annotated:
        return _type(arguments[0], number)
    if origin is Literal:
        return Annotated[hint, one_of(tuple(map(str, arguments)))]
    if origin in (Union, UnionType):
        return _union(arguments, number)
    if isinstance(hint, type) and is_dataclass(hint):
        return Annotated[record_keys(hint), AfterValidator(_made)]
    if origin is tuple:
        return _tuple(arguments, number)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return dict[str, _type(arguments[1], number)]  # type: ignore[misc]
    return hint


def _made(read: Keys) -> Any:
    try:
        return _KINDS[type(read)](**{name: getattr(read, name) for name in read.model_fields_set})
    except DrakeTcError as error:
        raise ValueError(str(error)) from None


def _tuple(arguments: tuple[Any, ...], number: Any) -> Any:
    size = None if arguments[-1] is Ellipsis else len(arguments)
    inner = tuple(_type(each, number) if each is not Ellipsis else each for each in arguments)
    return Annotated[tuple[inner], BeforeValidator(_list_of(size))]  # type: ignore[valid-type]


def _list_of(size: int | None) -> Callable[[object], object]:
    def read(value: object) -> object:
        if not isinstance(value, list | tuple) or (size is not None and len(value) != size):
            raise ValueError(f"expected a list{'' if size is None else f' of {size} values'}, got {quoted(value)}")
        return tuple(value)

    return read


def _union(arguments: tuple[Any, ...], number: Any) -> Any:
    """The parts of a union by the shape of the value: a list, a mapping, or one value."""
    by_shape: dict[str, Any] = {}
    for part in arguments:
        if part is not NoneType:
            by_shape.setdefault(_shape_of(part), _type(part, number))
    parts = list(by_shape.items())
    if len(parts) == 1:
        joined = parts[0][1]
    else:
        tagged = [Annotated[part, Tag(shape)] for shape, part in parts]
        known = tuple(by_shape)
        joined = Annotated[Union[tuple(tagged)], Discriminator(_shape_in(known))]  # noqa: UP007
    return joined | None if NoneType in arguments else joined


def _shape_of(hint: Any) -> str:
    origin = get_origin(hint)
    if origin is tuple:
        return "@list"
    mapping = isinstance(origin, type) and issubclass(origin, Mapping)
    return "@mapping" if mapping or (isinstance(hint, type) and is_dataclass(hint)) else "@one"


def _shape_in(known: tuple[str, ...]) -> Callable[[object], str]:
    def shape(value: object) -> str:
        found = "@list" if isinstance(value, list | tuple) else "@mapping" if isinstance(value, Mapping) else "@one"
        return found if found in known else known[0]

    return shape
