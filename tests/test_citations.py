"""Equations and sections that docstrings refer to are of a paper or a book that the docstring or its file names."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = re.compile(r"\b(?:[Ee]qs?\.|[Ee]quations?|[Ss]ection|[Cc]hapter|Table) ?\(?(?:[0-9]|[IVX]+\b)")
PAPER = re.compile(r"[A-Z]\w+,? .*?\(?(?:18|19|20)\d\d\b", re.S)
"""An author's name and a year after it."""
LETTER = re.compile(r"\b(?:[Pp]aper )?[ABC], (?:eq|sec|tab|fig)")
"""A paper as "A", which only file names may call it."""
YEAR = re.compile(r"(?:18|19|20)\d\d\b")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)


def names_paper(text: str) -> bool:
    return bool(YEAR.search(text) and PAPER.search(text))


def unresolved(source: str) -> list[str]:
    """Names of what has a docstring with a reference that no paper goes with."""
    if not (LETTER.search(source) or REFERENCE.search(source)):
        return []
    tree = ast.parse(source)
    documents = [(node, ast.get_docstring(node) or "") for node in ast.walk(tree) if isinstance(node, DOCUMENTED)]
    of_file = names_paper(ast.get_docstring(tree) or "")
    return [
        getattr(node, "name", "module")
        for node, text in documents
        if LETTER.search(text) or (REFERENCE.search(text) and not (of_file or names_paper(text)))
    ]


@pytest.mark.parametrize("folder", ["drake_tc", "diagrams", "models"])
def test_every_reference_has_its_paper(folder):
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for name in unresolved(path.read_text("utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('"""min J (eq. 4)."""', ["module"]),
        ('"""Robust control (Del Prete and Mansard, 2015)."""\ndef f():\n    """R (eq. 4)."""', []),
        ('def f():\n    """R (B, eq. 11)."""', ["f"]),
        ('def f():\n    """R (Faraji et al., 2015, eq. 4)."""', []),
    ],
)
def test_references_are_found(source, found):
    assert unresolved(source) == found
