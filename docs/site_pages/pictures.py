"""When the stored pictures of the gallery were made (`record_pictures.py`), and what of their drawing changed since."""

import ast
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[2]
LIST = ROOT / "docs" / "pictures.yaml"
RECORD = ROOT / "docs" / "pictures.json"


def overview() -> str:
    """One paragraph for each group of pictures that are made together."""
    record = json.loads(RECORD.read_text("utf-8"))
    return "\n\n".join(_paragraph(said, record[name]) for name, said in listed().items())


def listed() -> dict[str, dict[str, Any]]:
    """Name of a group to what pictures.yaml says of it."""
    found: dict[str, dict[str, Any]] = yaml.safe_load(LIST.read_text("utf-8"))
    return found


def changed(said: Mapping[str, Any], stored: Mapping[str, Any]) -> list[str]:
    """Files that draw a group and are not as they were when it was made; added and removed ones too.

    Args:
        said: What pictures.yaml says of the group.
        stored: What pictures.json says of it.
    """
    now = {path: drawing_digest(path, (ROOT / path).read_bytes()) for path in drawing_files(said["drawn_by"])}
    was = stored["drawn_by"]
    return sorted(path for path in {*now, *was} if now.get(path) != was.get(path))


def drawing_files(patterns: Iterable[str]) -> list[str]:
    """Files of the repository that match one of the patterns.

    Args:
        patterns: As in pictures.yaml.
    """
    found = {path for pattern in patterns for path in ROOT.glob(pattern) if path.is_file()}
    return sorted(path.relative_to(ROOT).as_posix() for path in found)


def drawing_digest(path: str, content: bytes) -> str:
    """Digest of what a file draws with: its content, of a Python file without docstrings, comments and empty lines.

    Args:
        path: Its name.
        content: Its bytes.
    """
    kept = _without_docstrings(content.decode("utf-8")).encode() if path.endswith(".py") else content
    return picture_digest(kept)


def picture_digest(content: bytes) -> str:
    """The first twelve digits of SHA-256.

    Args:
        content: Of a file.
    """
    return hashlib.sha256(content).hexdigest()[:12]


def _without_docstrings(source: str) -> str:
    bodies = [body for node in ast.walk(ast.parse(source)) if isinstance(body := getattr(node, "body", None), list)]
    texts = [each for body in bodies for each in body if isinstance(each, ast.Expr) and _is_text(each.value)]
    gone = {line for text in texts for line in range(text.lineno, (text.end_lineno or text.lineno) + 1)}
    lines = [line for number, line in enumerate(source.splitlines(), 1) if number not in gone]
    return "\n".join(line for line in lines if line.strip() and not line.lstrip().startswith("#"))


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _paragraph(said: Mapping[str, Any], stored: Mapping[str, Any]) -> str:
    names = ", ".join(f"`{Path(path).name}`" for path in said["pictures"])
    made = f"**{said['title']}** ({names}): commit `{stored['commit'][:12]}`, {stored['date']}, by {said['made_with']}."
    if not (since := changed(said, stored)):
        return f"{made} The files that draw it have not changed since."
    which = ", ".join(f"`{path}`" for path in since)
    return f"{made} Details may look different today, because these files, which draw it, have changed since: {which}."
