"""Frozen dataclasses from YAML: an unknown key, a missing key and a bad value are errors that name file and field."""

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from drake_tc.errors import DrakeTcError, ParamsError
from drake_tc.robot.fields import different
from drake_tc.yaml_file import read_yaml

Record = TypeVar("Record")


def read_mapping(path: Path) -> dict[str, Any]:
    """A YAML file's top-level mapping.

    Raises:
        ParamsError: no such file, not YAML, or no mapping.
    """
    document = read_yaml(path)
    if not isinstance(document, dict):
        raise ParamsError(f"{path}: wanted a mapping; got {type(document).__name__}")
    return document


def from_mapping(kind: type[Record], document: object, where: str) -> Record:
    """`kind`, a dataclass, from plain data; nested dataclasses, tuples of them and mappings to them included.

    Args:
        kind: The dataclass.
        document: What the YAML says.
        where: For messages: file and field.

    Raises:
        ParamsError: an unknown or missing key, or a value that cannot be read.
    """
    if not isinstance(document, Mapping):
        raise ParamsError(f"{where}: wanted a mapping with {', '.join(f.name for f in fields(kind))}; got {document!r}")  # type: ignore[arg-type]
    known = {field.name: field for field in fields(kind)}  # type: ignore[arg-type]
    for key in document:
        if key not in known:
            raise ParamsError(f"{where}: unknown field {key!r}; possible: {', '.join(known)}")
    for name, field in known.items():
        if name not in document and field.default is MISSING and field.default_factory is MISSING:
            raise ParamsError(f"{where}: missing field {name!r}; possible: {', '.join(known)}")
    hints = get_type_hints(kind)
    values = {name: _value(hints[name], value, f"{where}.{name}") for name, value in document.items()}
    try:
        return kind(**values)
    except DrakeTcError as error:
        raise ParamsError(f"{where}: {error}") from error


def _value(hint: Any, value: object, where: str) -> Any:
    """`value` as the type `hint` says."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return None if value is None and NoneType in arguments else _value(_arm(arguments, value), value, where)
    if is_dataclass(hint):
        return from_mapping(hint, value, where)  # type: ignore[arg-type]
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise ParamsError(f"{where}: wanted a list; got {value!r}")
        if len(arguments) == 2 and arguments[1] is not Ellipsis and len(value) != 2:
            raise ParamsError(f"{where}: wanted two values; got {value!r}")
        return tuple(_value(arguments[0], item, f"{where}[{i}]") for i, item in enumerate(value))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            raise ParamsError(f"{where}: wanted a mapping; got {value!r}")
        return {
            key: _value(arguments[1], item, f"{where}.{key}")
            for key, item in zip(different(where, value), value.values(), strict=True)
        }
    return _scalar(hint, value, where)


def _arm(arguments: tuple[Any, ...], value: object) -> Any:
    """The part of a union that fits: its tuple for a list, else the first that is not None."""
    possible = [argument for argument in arguments if argument is not NoneType]
    lists = [argument for argument in possible if get_origin(argument) is tuple]
    return lists[0] if lists and isinstance(value, (list, tuple)) else possible[0]


def _scalar(hint: Any, value: object, where: str) -> Any:
    if hint is Any:
        return value
    wanted = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}.get(hint, "text")
    if hint is float and isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            return float(value)
        except ValueError:
            raise ParamsError(f"{where}: wanted {wanted}; got {value!r}") from None
    right = isinstance(value, hint) if isinstance(hint, type) else isinstance(value, str)
    if not right or (isinstance(value, bool) and hint is not bool):
        raise ParamsError(f"{where}: wanted {wanted}; got {value!r}")
    return value
