"""The navigation of the site. A page that does not exist is left out."""

from collections.abc import Mapping
from typing import Any

from site_pages.repository import ROOT, SHOWN

Section = list[tuple[str, str]]

TOP: list[tuple[str, str | Section]] = [
    ("drake_tc", "index.md"),
    (
        "Start",
        [
            ("Installation", "installation.md"),
            ("Tutorial: from log to controller", "tutorial.md"),
            ("Reading the report", "report.md"),
        ],
    ),
    (
        "How to",
        [
            ("My log format", "your_own_log.md"),
            ("My robot", "your_own_robot.md"),
            ("An arm whose links nobody trusts", "whole_arm.md"),
            ("My effect", "your_own_effect.md"),
            ("My simulator", "your_own_simulator.md"),
            ("My controller", "your_own_controller.md"),
            ("My task and limit", "your_own_task.md"),
            ("My diagram", "your_own_diagram.md"),
            ("Torque control of a leg", "torque_control.md"),
            ("Whole-body control", "whole_body.md"),
        ],
    ),
    ("Benchmarks", "benchmarks.md"),
    ("Papers", "papers.md"),
    ("Where things are", "where_things_are.md"),
]


def navigation(generated: Mapping[str, str]) -> list[Any]:
    """MkDocs' `nav`: the pages written by hand, then a section for each folder of generated ones."""
    nav: list[Any] = []
    for title, entry in TOP:
        if isinstance(entry, str):
            nav.append({title: entry})
        else:
            nav.append({title: [{name: page} for name, page in entry if _exists(page, generated)]})
    for title, folder in FOLDERS:
        pages = _folder(folder, generated)
        if pages:
            nav.append({title: pages})
    nav.append({"Changelog": "changelog.md"})
    return nav


FOLDERS = (
    ("Effects", "effects"),
    ("Input files", "reference"),
    ("Commands", "cli"),
    ("Python", "api"),
    ("Methods", "methods"),
    ("Papers' figures", "papers"),
    ("Gallery", "gallery"),
)
"""Title of a section and its folder of pages."""


def _folder(folder: str, generated: Mapping[str, str]) -> list[Any]:
    inside = [page for page in generated if page.startswith(f"{folder}/")]
    inside += [page for page in SHOWN.values() if page.startswith(f"{folder}/") and page not in generated]
    first = [page for page in inside if page.endswith("/index.md")]
    return [*first, *(page for page in inside if page not in first)]


def _exists(page: str, generated: Mapping[str, str]) -> bool:
    return page in generated or page in SHOWN.values() or (ROOT / "docs" / page).exists()
