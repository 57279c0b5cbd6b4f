"""YAML files read strictly: a key that is given twice is an error, as it silently hides a value."""

from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import yaml

from drake_tc.errors import ParamsError

_MERGE = "tag:yaml.org,2002:merge"


class _StrictLoader(yaml.SafeLoader):
    """A loader to which a repeated key is an error."""


def _mapping_without_repeats(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    mapping: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        at = f"line {key_node.start_mark.line + 1}"
        if key_node.tag == _MERGE:
            raise ParamsError(f"{at}: wanted the keys themselves; '<<', which merges another mapping's, is not read")
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, Hashable):
            raise ParamsError(f"{at}: wanted a key that is one word or number; got {key!r}")
        if key in mapping:
            raise ParamsError(f"{at}: key {key!r} is given twice")
        mapping[key] = loader.construct_object(value_node, deep=True)
    return mapping


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_repeats)


def read_yaml(path: Path, kind: str = "YAML file") -> Any:
    """The document in a file.

    Args:
        path: The file.
        kind: What it is wanted to be, for the message.

    Raises:
        ParamsError: the file cannot be read, is no YAML, or gives a key twice.
    """
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_StrictLoader)
    except ParamsError as error:
        raise ParamsError(f"{path}: {error}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ParamsError(f"{path}: wanted a {kind}; {error}") from error
    except yaml.YAMLError as error:
        raise ParamsError(f"{path}: not YAML: {' '.join(str(error).split())}") from error


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with `changes`, mapping by mapping."""
    result = dict(base)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = merged(result[key], value) if both else value
    return result
