"""Tables of the keys of an input file, as Markdown, from the file's model.

JSON schemas of input files, for editors that complete and check YAML.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import UnionType
from typing import Any, Union, get_args, get_origin

from drake_tc.config.keys import HIDDEN, Keys, default_of, unit_of


def page(model: type[Keys], title: str, introduction: str) -> str:
    """A page with one table for each mapping of the file."""
    parts = [f"# {title}", introduction, key_table(model)]
    parts += [f"## `{place}`\n\n{_text_of(inner)}\n\n{key_table(inner)}" for place, inner in nested(model)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _text_of(model: type[Keys]) -> str:
    return "\n".join(line.strip() for line in (model.__doc__ or "").strip().splitlines())


def nested(model: type[Keys], before: str = "", seen: frozenset[type[Keys]] = frozenset()) -> Iterator[tuple[str, Any]]:
    """(place, model) of the mappings inside a file's mapping, from the outside inwards, each model once."""
    found = set(seen) | {model}
    for name, field in model.model_fields.items():
        shown = field.alias or name
        if shown.startswith(HIDDEN):
            continue
        for place, inner in _models_in(field.annotation, f"{before}{shown}"):
            if inner not in found:
                found.add(inner)
                yield place, inner
                for deeper, its in nested(inner, f"{place}.", frozenset(found)):
                    found.add(its)
                    yield deeper, its


def _models_in(annotation: Any, place: str) -> Iterator[tuple[str, type[Keys]]]:
    if isinstance(annotation, type) and issubclass(annotation, Keys):
        yield place, annotation
        return
    origin, arguments = get_origin(annotation), get_args(annotation)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        yield from _models_in(arguments[1], f"{place}.<name>")
    elif origin in (list, tuple):
        yield from _models_in(arguments[0], f"{place}[]")
    elif origin in (Union, UnionType):
        for each in arguments:
            yield from _models_in(each, place)
    elif arguments:  # Annotated
        yield from _models_in(arguments[0], place)


def key_table(model: type[Keys]) -> str:
    """One row for each key of a mapping: meaning, unit, default, example."""
    rows = []
    for name, field in model.model_fields.items():
        shown = field.alias or name
        if not shown.startswith(HIDDEN):
            example = f"`{shown}: {flow_yaml(field.examples[0])}`" if field.examples else "–"
            rows.append((f"`{shown}`", field.description or "", unit_of(field), default_of(field), example))
    return table(("key", "meaning", "unit", "default", "example"), rows)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def flow_yaml(value: Any) -> str:
    """A value in YAML's flow style, on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {flow_yaml(each)}" for name, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(flow_yaml, value)) + "]"
    return "null" if value is None else value if isinstance(value, str) else json.dumps(value)


DIALECT = "https://json-schema.org/draft/2020-12/schema"
_OURS = ("unit", "absent", "expected", "title", "default")


def json_schema(model: type[Keys], title: str) -> dict[str, Any]:
    """The schema of a file (draft 2020-12); each key's description has its unit and its default."""
    schema: dict[str, Any] = _explained(model.model_json_schema())
    return {"$schema": DIALECT, "title": title, **schema}


def _explained(value: Any) -> Any:
    """The schema with unit and default in the descriptions, and without what only this library reads."""
    if isinstance(value, list):
        return [_explained(each) for each in value]
    if not isinstance(value, Mapping):
        return value
    if "absent" not in value:
        kept = {name: each for name, each in value.items() if name != "title" or not isinstance(each, str)}
        return {"anyOf" if name == "oneOf" else name: _explained(each) for name, each in kept.items()}
    default = value["absent"] or ("" if value.get("default") is None else f"{value['default']:g}")
    told = (("Unit", value["unit"]), ("Default", default))
    description = " ".join([value["description"], *(f"{name}: {text}." for name, text in told if text)])
    rest = {name: _explained(each) for name, each in value.items() if name not in _OURS}
    return {**rest, "description": description}
