"""The house's walls: imports point down, files are small, robots live in diagrams and models."""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "drake_tc"
LONGEST_FILE = 400

FLOOR = {
    "errors": 0,
    "types": 0,
    "yaml_file": 0,
    "json_values": 0,
    "logs": 1,
    "robot": 1,
    "filtering": 1,
    "effects": 2,
    "actuation": 3,
    "sensing": 4,
    "estimation": 5,
    "control": 6,
    "tsid": 6,
    "identification": 7,
    "diagnosis": 8,
    "analysis": 8,
    "report": 9,
    "blind": 9,
    "bench": 10,
    "diagrams": 10,
    "cli": 11,
    "": 12,  # the front door, drake_tc/__init__.py
}
"""A package imports from its own floor's number downwards: never from a higher one."""

ALONE = {"blind": {"errors", "types"}, "logs": {"errors", "types"}, "filtering": {"errors", "types"}}
"""Packages that may import nothing but these: the blind rigs must not share the diagnosis's formulas."""

MAY_SHOW_DIAGRAMS = {"cli", "bench", "diagrams"}

ROBOTS = ("hrp", "coman", "talos", "icub", "romeo", "anymal", "solo12", "hyq", "panda", "ur5", "ur10", "iiwa", "atlas")


def sources() -> list[Path]:
    return sorted(p for folder in ("drake_tc", "diagrams", "models") for p in (ROOT / folder).rglob("*.py"))


def package_of(path: Path) -> str:
    if LIBRARY not in path.parents:
        return path.relative_to(ROOT).parts[0]
    parts = path.relative_to(LIBRARY).with_suffix("").parts
    return "" if parts == ("__init__",) else parts[0]


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """(line, dotted module) of every import in the file, also those inside functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: wanted an absolute import"
            yield node.lineno, node.module or ""
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def own_imports(path: Path) -> Iterator[tuple[int, str]]:
    """(line, package under drake_tc) of the imports of ours."""
    for line, module in imported(path):
        parts = module.split(".")
        if parts[0] == "drake_tc" and len(parts) > 1 and parts[1] != "__version__":
            yield line, parts[1]


@pytest.mark.parametrize("path", sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_point_down(path):
    package = package_of(path)
    if package == "models":
        assert not list(own_imports(path))
        return
    assert package in FLOOR, f"{package}: a new package needs a floor in this test"
    for line, target in own_imports(path):
        where = f"{path.relative_to(ROOT)}:{line} imports {target}"
        assert target in FLOOR, where
        if package in ALONE:
            assert target == package or target in ALONE[package], where
        elif target == "diagrams":
            assert package in MAY_SHOW_DIAGRAMS, where
        else:
            assert target == package or FLOOR[target] <= FLOOR[package], where


def test_packages_of_one_floor_do_not_import_in_a_ring():
    edges = {(package_of(p), target) for p in sources() for _, target in own_imports(p)}
    rings = sorted(f"{a} <-> {b}" for a, b in edges if a < b and (b, a) in edges)
    assert rings == []


def test_imports_of_drake_are_narrow():
    files = sources()
    broad = [f"{p}:{line}" for p in files for line, module in imported(p) if module in ("pydrake.all", "pydrake")]
    assert broad == []


def test_files_are_small():
    files = [*sources(), *(ROOT / "tests").rglob("*.py"), *(ROOT / "notebooks").rglob("*.py")]
    lengths = {}
    for path in files:
        lines = path.read_text(encoding="utf-8").splitlines()
        if path.parent.name == "notebooks":  # their prose stands in comments
            lines = [line for line in lines if not line.startswith("#")]
        lengths[str(path.relative_to(ROOT))] = len(lines)
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST_FILE} == {}


def _names_and_texts(tree: ast.Module) -> Iterator[str]:
    """Identifiers and string constants, docstrings left out (they may name a source)."""
    documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documents:
            yield node.value


DATA_SETS = ("icub-walking-base", "real-icub")
"""A public data set and the benchmark on it, which carry a robot's name."""


def test_the_library_names_no_robot():
    found = []
    for path in sorted(LIBRARY.rglob("*.py")):
        for text in _names_and_texts(ast.parse(path.read_text(encoding="utf-8"))):
            for name in DATA_SETS:
                text = text.replace(name, "")
            words = text.lower().replace("-", "")
            found += [f"{path.relative_to(ROOT)}: {robot} in {text!r}" for robot in ROBOTS if robot in words]
    assert found == [], "robots belong in diagrams/ and models/"


def test_every_package_is_installed():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    here = {".".join(p.parent.relative_to(ROOT).parts) for p in LIBRARY.rglob("__init__.py")}
    for folder in ("diagrams", "models"):
        inits = (ROOT / folder).rglob("__init__.py")
        here |= {".".join(("drake_tc", *p.parent.relative_to(ROOT).parts)) for p in inits}
    assert set(settings["tool"]["setuptools"]["packages"]) == here


def test_no_library_file_prints_or_asserts():
    """stdout belongs to the commands; checks of input are errors that teach."""
    wrong = []
    for path in sorted(LIBRARY.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            prints = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            if isinstance(node, ast.Assert) or (prints and package_of(path) not in ("cli", "bench", "blind")):
                wrong.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert wrong == []
