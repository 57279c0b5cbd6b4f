"""Names and fields of other packages that exported programs use, as `released_names.json` has them.

The file is written from the installed packages: python -m tests.exchange.released_names PACKAGE. A test compares it
with a package that is installed.
"""

import ast
import importlib
import inspect
import json
import re
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

FILE = Path(__file__).with_suffix(".json")


def released() -> dict:
    """Package to {"version", "source", "names": {dotted name: parameters or fields}}."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def installed(dotted: str) -> list[str]:
    """Parameters of a function or of a class of event terms, fields of a configuration, or members of an enum."""
    module, name = dotted.rsplit(".", 1)
    found = getattr(importlib.import_module(module), name)
    if inspect.isclass(found) and hasattr(found, "__dataclass_fields__"):
        return sorted(found.__dataclass_fields__)
    if inspect.isclass(found) and hasattr(found, "__members__"):
        return sorted(found.__members__)
    call = found.__call__ if inspect.isclass(found) else found
    return sorted(name for name in inspect.signature(call).parameters if name not in ("self", "env", "env_ids"))


def is_installed(package: str) -> bool:
    try:
        return version(package) == released()[package]["version"]
    except PackageNotFoundError:
        return False


def wrong_names(text: str, package: str) -> list[str]:
    """What a program uses and the package lacks: names, keywords, and parameters of event terms."""
    names, tree = released()[package]["names"], ast.parse(text)
    known = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and str(node.module).partition(".")[0] == package:
            known |= {each.name: f"{node.module}.{each.name}" for each in node.names}

    def dotted(node: ast.AST) -> str | None:
        if isinstance(node, ast.Name):
            return known.get(node.id)
        if isinstance(node, ast.Attribute) and (owner := dotted(node.value)) is not None:
            return f"{owner}.{node.attr}"
        return None

    wrong = []
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        if (name := dotted(call.func)) is None:
            continue
        fields = {each.arg: each.value for each in call.keywords}
        wrong += [name] if name not in names else [f"{name}({each})" for each in fields if each not in names[name]]
        if "func" in fields and (term := dotted(fields["func"])) is not None:
            keys = [key.value for key in fields["params"].keys]
            wrong += [term] if term not in names else [f"{term}({key})" for key in keys if key not in names[term]]
    return wrong


if __name__ == "__main__":
    document = released()
    for package in sys.argv[1:]:
        entry = document[package]
        entry["version"] = version(package)
        entry["names"] = {name: installed(name) for name in entry["names"]}
    text = json.dumps(document, indent=1)
    text = re.sub(r"\[[^\]]*\]", lambda found: json.dumps(json.loads(found[0])), text)
    FILE.write_text(text + "\n", encoding="utf-8")
