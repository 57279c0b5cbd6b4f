"""The house's walls: imports point down, robots live in diagrams and models."""

import ast
import gc
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "drake_tc"

FLOOR = {
    "errors": 0,
    "types": 0,
    "array_stage": 1,
    "front_door": 0,
    "extensions": 0,
    "system_libraries": 0,
    "config": 1,
    "simulator_files": 1,
    "logs": 1,
    "filtering": 1,
    "kernels": 1,
    "joint_simulator": 1,
    "effects": 2,
    "actuation": 3,
    "robot": 3,
    "sensing": 4,
    "estimation": 5,
    "control": 6,
    "tsid": 6,
    "sensor_validation": 6,
    "identification": 7,
    "diagnosis": 8,
    "watch": 9,
    "loops": 9,
    "analysis": 10,
    "exchange": 11,
    "hardware": 11,
    "report": 11,
    "registry": 12,
    "experiments": 12,
    "diagrams": 12,
    "cli": 13,
    "": 14,  # the front door, drake_tc/__init__.py
}
"""A package imports from its own floor's number downwards: never from a higher one."""

ALONE = {
    "config": {"errors", "types"},
    "simulator_files": {"config", "errors"},
    "logs": {"config", "errors", "types", "extensions", "simulator_files"},
    "filtering": {"errors", "types", "array_stage", "kernels"},
    "kernels": {"errors", "types"},
    "array_stage": {"types", "kernels"},
    "joint_simulator": {"errors", "types"},
}
"""Packages that may import nothing but these."""

BLIND = "tests.benchmarks.blind"
"""The blind rigs, which must not share the diagnosis's formulas: they import the joint simulator and no other."""

MAY_SHOW_DIAGRAMS = {"diagrams"}
"""Everything else finds diagrams through `drake_tc.registry`."""

ROBOTS = ("hrp", "coman", "talos", "icub", "romeo", "anymal", "solo12", "hyq", "panda", "ur5", "ur10", "iiwa", "atlas")


def sources() -> list[Path]:
    return sorted(p for folder in ("drake_tc", "diagrams", "models") for p in (ROOT / folder).rglob("*.py"))


def every_source() -> list[Path]:
    return [
        *sources(),
        *(path for folder in ("tests", "notebooks", "docs") for path in sorted((ROOT / folder).rglob("*.py"))),
    ]


@pytest.fixture(scope="module", autouse=True)
def no_collection() -> Iterator[None]:
    """Syntax trees of the whole repository are millions of objects, which the garbage collector would visit often."""
    gc.disable()
    yield
    nodes_of.cache_clear()
    gc.enable()


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


LOOKED_AT = {ast.Import, ast.ImportFrom, ast.Attribute, ast.Name, ast.FunctionDef, ast.ClassDef, ast.Call, ast.Assert}


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """The nodes that tests here look at; loaded names are left out."""
    found = (node for node in ast.walk(parsed(path)) if type(node) in LOOKED_AT)
    return tuple(node for node in found if not (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)))


def package_of(path: Path) -> str:
    if LIBRARY not in path.parents:
        return path.relative_to(ROOT).parts[0]
    parts = path.relative_to(LIBRARY).with_suffix("").parts
    return "" if parts == ("__init__",) else parts[0]


@cache
def imported(path: Path) -> tuple[tuple[int, str], ...]:
    """(line, dotted module) of every import in the file, also those inside functions."""
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[tuple[int, str]]:
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level:
            assert path.is_relative_to(ROOT / "tests"), f"{path}:{node.lineno}: expected an absolute import"
        elif isinstance(node, ast.ImportFrom):
            yield node.lineno, node.module or ""
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def own_imports(path: Path) -> Iterator[tuple[int, str]]:
    """(line, package under drake_tc) of the imports of ours."""
    for line, module in imported(path):
        parts = module.split(".")
        if parts[0] == "drake_tc" and len(parts) > 1 and parts[1] != "__version__":
            yield line, parts[1]


def test_imports_point_down():
    assert [where for path in sources() for where in upward_imports(path)] == []


def upward_imports(path: Path) -> Iterator[str]:
    """The imports that the floors do not allow."""
    package = package_of(path)
    assert package == "models" or package in FLOOR, f"{package}: a new package needs a floor in this test"
    for line, target in own_imports(path):
        if package in ALONE:
            right = target == package or target in ALONE[package]
        elif target == "diagrams":
            right = package in MAY_SHOW_DIAGRAMS
        else:
            right = package != "models" and (target == package or FLOOR.get(target, 99) <= FLOOR[package])
        if not right:
            yield f"{path.relative_to(ROOT)}:{line} imports {target}"


def test_diagrams_are_short_and_the_papers_apart():
    """What a user reads and copies: no more than 4000 lines of code, scenarios and pages, near a hundred a diagram."""
    own = [p for p in (ROOT / "diagrams").rglob("*") if p.suffix in (".py", ".yaml", ".md") and "papers" not in p.parts]
    lines = {p.name: len(p.read_text("utf-8").splitlines()) for p in own}
    assert 0 < sum(lines.values()) < 4000
    assert {name: count for name, count in lines.items() if name.endswith(".py") and count > 150} == {}


def test_the_blind_rigs_share_no_formula_with_the_diagnosis():
    own = (f"{BLIND}.", "drake_tc.joint_simulator", "drake_tc.errors", "drake_tc.types", "tests.benchmarks.figures")
    files = [p for p in (ROOT / BLIND.replace(".", "/")).rglob("*.py") if not p.name.startswith(("test_", "conftest"))]
    assert files
    for path in files:
        for line, module in imported(path):
            ours = module.startswith(("drake_tc.", "tests.")) and module != BLIND
            assert not ours or module.startswith(own), f"{path.relative_to(ROOT)}:{line} imports {module}"


def test_packages_of_one_floor_do_not_import_in_a_ring():
    edges = {(package_of(p), target) for p in sources() for _, target in own_imports(p)}
    rings = sorted(f"{a} <-> {b}" for a, b in edges if a < b and (b, a) in edges)
    assert rings == []


def test_nothing_installed_imports_the_tests():
    found = [
        f"{p.relative_to(ROOT)}:{line}"
        for p in sources()
        for line, name in imported(p)
        if name.split(".")[0] == "tests"
    ]
    assert found == []


def test_imports_of_drake_are_narrow():
    files = sources()
    broad = [f"{p}:{line}" for p in files for line, module in imported(p) if module in ("pydrake.all", "pydrake")]
    assert broad == []


NAMED_TUPLE = {"_fields", "_replace", "_asdict", "_make"}
"""Public in spite of their underscore."""


def _is_private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("_") and name not in NAMED_TUPLE


PUBLIC = {"_exit"}
"""Attributes that begin with an underscore and are documented all the same (`os._exit`)."""


def test_nothing_private_of_others_is_used():
    """Neither a module or name of Drake that begins with an underscore, nor such an attribute that is not ours."""
    nodes = [(path, node) for path in every_source() for node in nodes_of(path)]
    ours = {node.name for _, node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    ours |= {node.id for _, node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    ours |= {node.attr for _, node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)}
    found = [
        f"{path}:{node.lineno} {ast.unparse(node)}"
        for path, node in nodes
        if isinstance(node, ast.Attribute) and _is_private(node.attr) and node.attr not in ours | PUBLIC
    ]
    for path in every_source():
        for line, module in imported(path):
            parts = module.split(".")
            if parts[0] != "drake_tc" and any(map(_is_private, parts)):
                found.append(f"{path}:{line} {module}")
    assert found == []


DISTRIBUTIONS = {"proxsuite": "proxsuite"}
"""Modules whose distribution the metadata do not tell (proxsuite's lies in a folder that a .pth file adds)."""


def modules_of_distributions() -> dict[str, set[str]]:
    """Top-level module to the distributions that install it, by their lists of files.

    `importlib.metadata.packages_distributions` says the same and takes seconds.
    """
    found: dict[str, set[str]] = {}
    for distribution in distributions():
        name = distribution.metadata["Name"]
        for line in (distribution.read_text("RECORD") or "").splitlines():
            module = line.split(",")[0].split("/")[0].removesuffix(".py").split(".")[0]
            found.setdefault(module, set()).add(name)
    return found


def distribution_name(requirement: str) -> str:
    """The normalized name in a requirement such as `PyYAML>=6; python_version < "4"`."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def test_what_is_imported_is_declared():
    """The library needs its own dependencies or, for what it imports on demand, an extra; tests may use any extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    on_demand = [name for extra in ("solvers", "cluster", "robots", "bags", "mujoco", "onnx") for name in extras[extra]]
    library = {distribution_name(name) for name in (*project["dependencies"], *on_demand)}
    everything = library | {distribution_name(name) for extra in extras.values() for name in extra}
    installed = modules_of_distributions() | {module: {name} for module, name in DISTRIBUTIONS.items()}
    ours = {"drake_tc", "tests", *(path.stem for folder in ("tests", "docs") for path in (ROOT / folder).iterdir())}
    ours |= {path.stem for path in (ROOT / "tests").rglob("*.py")}
    missing, in_library = {}, set(sources())
    for path in every_source():
        declared = library if path in in_library else everything
        for line, dotted in imported(path):
            module = dotted.split(".")[0]
            if module in ours or module in sys.stdlib_module_names:
                continue
            named = {distribution_name(name) for name in installed.get(module, {f"unknown-{module}"})}
            if not named & declared:
                missing[module] = f"{path.relative_to(ROOT)}:{line}"
    assert missing == {}


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


def test_the_library_names_no_robot():
    found = []
    for path in sorted(LIBRARY.rglob("*.py")):
        written = path.read_text(encoding="utf-8").lower().replace("-", "")
        if not any(robot in written for robot in ROBOTS):
            continue
        for text in _names_and_texts(parsed(path)):
            words = text.lower().replace("-", "")
            found += [f"{path.relative_to(ROOT)}: {robot} in {text!r}" for robot in ROBOTS if robot in words]
    assert found == [], "robots belong in diagrams/ and models/"


NOT_INSTALLED = "drake_tc.diagrams.papers"
"""The published tables stay in the repository."""


def test_every_package_is_installed():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    here = {".".join(p.parent.relative_to(ROOT).parts) for p in LIBRARY.rglob("__init__.py")}
    for folder in ("diagrams", "models"):
        inits = (ROOT / folder).rglob("__init__.py")
        here |= {".".join(("drake_tc", *p.parent.relative_to(ROOT).parts)) for p in inits}
    here = {name for name in here if not f"{name}.".startswith(f"{NOT_INSTALLED}.")}
    assert set(settings["tool"]["setuptools"]["packages"]) == here


def test_no_library_file_prints_or_asserts():
    """stdout belongs to the commands; checks of input are errors that teach."""
    wrong = []
    for path in sorted(LIBRARY.rglob("*.py")):
        for node in nodes_of(path):
            prints = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            if isinstance(node, ast.Assert) or (prints and package_of(path) != "cli"):
                wrong.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert wrong == []


LONGEST_LABEL = 6
"""Words of a name or a label, such as the title of a cause; more are the beginning of a sentence."""


def _texts_outside_errors(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """(line, text) of each string or f-string, without docstrings and what a `raise` says, or calls to say it."""
    documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    raised = [part for node in ast.walk(tree) if isinstance(node, ast.Raise) for part in ast.walk(node)]
    called = {part.func.id for part in raised if isinstance(part, ast.Call) and isinstance(part.func, ast.Name)}
    of_errors = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name in called]
    left_out = documents | {id(part) for part in raised}
    left_out |= {id(part) for function in of_errors for part in ast.walk(function)}
    for node in ast.walk(tree):
        if id(node) in left_out:
            continue
        if isinstance(node, ast.JoinedStr):
            parts = [part.value if isinstance(part, ast.Constant) else "0" for part in node.values]
            yield node.lineno, "".join(map(str, parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


def test_the_diagnosis_yields_values_and_the_report_makes_sentences():
    found = []
    for path in sorted((LIBRARY / "diagnosis").rglob("*.py")):
        for line, text in _texts_outside_errors(parsed(path)):
            if len(text.split()) > LONGEST_LABEL:
                found.append(f"{path.relative_to(ROOT)}:{line}: {text}")
    assert found == [], "sentences belong in drake_tc/report"


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('"""One two three four five six seven."""', []),
        ("x = f'{a} two three {b} five six seven'", ["0 two three 0 five six seven"]),
        ("raise ValueError('one two three four five ' + advice())\ndef advice():\n    return 'a b c d e f g'", []),
        ("def note():\n    return 'a b c d e f g'", ["a b c d e f g"]),
    ],
)
def test_texts_are_found_outside_of_docstrings_and_errors(source, found):
    assert [text for _, text in _texts_outside_errors(ast.parse(source)) if len(text.split()) > LONGEST_LABEL] == found
