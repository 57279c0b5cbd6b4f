"""API reference: what a user types, then the public modules package by package, from their docstrings."""

import ast
from collections.abc import Iterator
from pathlib import Path

import drake_tc
from drake_tc.config.page import table
from site_pages.repository import ROOT

PACKAGES = {
    "effects": "Physical effects: one equation each, used for fitting, simulation, compensation and plots.",
    "actuation": "Actuator models and their Drake systems.",
    "logs": "Logs, rig files and repairs.",
    "identification": "Regressions with intervals.",
    "diagnosis": "The diagnosis behind `drake-tc close-loop`.",
    "estimation": "Torques, wrenches and the base's state from sensors.",
    "control": "Inverse dynamics and torque control.",
    "tsid": "Robust task-space inverse dynamics.",
    "filtering": "Savitzky-Golay filters.",
    "sensing": "Simulated sensors.",
    "sensor_validation": "Sensors checked against each other.",
    "robot": "Robot files.",
    "loops": "The stages wired to loops.",
    "analysis": "Loops as sampled systems.",
    "experiments": "What logs can show, and the next experiment.",
    "exchange": "Models of other simulators.",
}
"""Package to what it is."""
SHALLOW = ("diagnosis", "logs")
"""Packages whose inner packages are left out: they are steps of a larger whole."""
FRONT = "drake_tc"


def pages() -> dict[str, str]:
    """Page to its text."""
    texts = {"api/index.md": _front()}
    for package, meaning in PACKAGES.items():
        names = list(_modules(package))
        texts[f"api/{package}.md"] = (
            f"# `drake_tc.{package}`\n\n{meaning}\n\n" + "\n\n".join(map(_module, names)) + "\n"
        )
    return texts


def _front() -> str:
    """Names of `drake_tc` itself, each with a link to its place and the first line of its docstring."""
    homes = _homes()
    head = (
        "# `drake_tc`\n\nWhat a user types. `from drake_tc import close_loop` imports a name when it is first used.\n"
    )
    shown = [name for name in drake_tc.__all__ if homes[name].split(".")[1] in PACKAGES]
    rows = [(f"[`{name}`][{homes[name]}.{name}]", _first_line(getattr(drake_tc, name))) for name in shown]
    return f"{head}\n{table(('name', 'what it is'), rows)}\n"


def _first_line(value: object) -> str:
    own = getattr(value, "__doc__", None) if callable(value) else None
    return (own or "All effects of the library.").strip().splitlines()[0]


def _homes() -> dict[str, str]:
    """Public name to its module."""
    tree = ast.parse(Path(drake_tc.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(FRONT):
            found.update({name.name: node.module for name in node.names})
    return found


def _modules(package: str) -> Iterator[str]:
    folder = ROOT / FRONT / package
    for path in sorted(folder.glob("*.py") if package in SHALLOW else folder.rglob("*.py")):
        if path.stem != "__init__":
            yield ".".join((FRONT, package, *path.relative_to(folder).with_suffix("").parts))


def _module(name: str) -> str:
    """A module's own summary and its public members."""
    return f"::: {name}\n    options: {{heading_level: 2, show_root_full_path: true, members_order: source}}"
