"""The navigation of the site. A page that does not exist is left out."""

from collections.abc import Mapping, Sequence
from typing import Any

from site_pages.repository import ROOT, SHOWN

Entry = tuple[str, "str | list[Entry]"]

TREE: list[Entry] = [
    (
        "Start",
        [
            ("drake_tc", "index.md"),
            ("Installation", "installation.md"),
            ("Tutorial: from log to controller", "tutorial.md"),
            ("Which command for which question", "which_command.md"),
            ("Reading the report", "report.md"),
            ("Further parts of the report", "report_parts.md"),
            ("Gallery", "gallery.md"),
            ("Block graphs", "block_graphs.md"),
            ("Similar tools", "similar_tools.md"),
            ("Where things are", "where_things_are.md"),
            ("Contributing", "contributing.md"),
            ("Changelog", "changelog.md"),
        ],
    ),
    (
        "How to",
        [
            (
                "Logs and robots",
                [
                    ("My log format", "your_own_log.md"),
                    ("Log files", "log_files.md"),
                    ("My robot", "your_own_robot.md"),
                    ("An arm with uncertain links", "whole_arm.md"),
                    ("Gain and friction without a diagnosis", "identify.md"),
                    ("The same joint later", "same_joint_later.md"),
                    ("Watch a joint in use", "joint_monitor.md"),
                    ("My effect", "your_own_effect.md"),
                    ("Attributes of an effect", "effect_attributes.md"),
                ],
            ),
            (
                "Simulators",
                [
                    ("My simulator", "your_own_simulator.md"),
                    ("Targets of the export", "simulator_notes.md"),
                    ("My file as the declared model", "declared_model.md"),
                    ("How much to randomise", "randomisation.md"),
                ],
            ),
            (
                "Control",
                [
                    ("My diagram", "your_own_diagram.md"),
                    ("My diagram in the commands", "diagram_commands.md"),
                    ("My humanoid", "your_own_humanoid.md"),
                    ("Random contexts and scalar types", "random_contexts.md"),
                    ("My controller", "your_own_controller.md"),
                    ("My task and limit", "your_own_task.md"),
                    ("My driver: on the robot", "your_own_driver.md"),
                    ("Torque control in C", "in_c.md"),
                    ("Torque control of a leg", "torque_control.md"),
                    ("Whole-body control", "whole_body.md"),
                ],
            ),
        ],
    ),
    (
        "Effects",
        [
            ("Overview", "effects/index.md"),
            ("Friction", "effects/friction.md"),
            ("Drive", "effects/drive.md"),
            ("Gear", "effects/gear.md"),
            ("Load", "effects/load.md"),
            ("Sensor", "effects/sensor.md"),
        ],
    ),
    ("Notebooks", [("The loop on one page", "one_page.md"), ("", "notebooks/")]),
    ("Input files", "reference/"),
    ("Commands", "cli/"),
    ("Python", "api/"),
    ("Methods", "methods/"),
    (
        "Figures",
        [("Real logs", "real_logs.md"), ("Benchmarks", "benchmarks.md"), ("Papers", "papers.md"), ("", "papers/")],
    ),
]
"""Title and page, folder of generated pages, or list of these; a folder without a title takes no level of its own."""


def navigation(generated: Mapping[str, str]) -> list[Any]:
    """MkDocs' `nav`: the tree, with the pages that exist."""
    return _entries(TREE, generated)


def _entries(entries: Sequence[Entry], generated: Mapping[str, str]) -> list[Any]:
    nav: list[Any] = []
    for title, inside in entries:
        if isinstance(inside, list):
            nav.append({title: _entries(inside, generated)})
        elif inside.endswith("/"):
            pages = _folder(inside.rstrip("/"), generated)
            nav += [{title: pages}] if title else pages
        elif _exists(inside, generated):
            nav.append({title: inside})
    return nav


def _folder(folder: str, generated: Mapping[str, str]) -> list[Any]:
    inside = [page for page in generated if page.startswith(f"{folder}/")]
    inside += [page for page in SHOWN.values() if page.startswith(f"{folder}/") and page not in generated]
    first = [page for page in inside if page.endswith("/index.md")]
    return [*first, *(page for page in inside if page not in first)]


def _exists(page: str, generated: Mapping[str, str]) -> bool:
    return page in generated or page in SHOWN.values() or (ROOT / "docs" / page).exists()
