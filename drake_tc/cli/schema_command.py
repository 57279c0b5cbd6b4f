"""`drake-tc schema`: the JSON schema of an input file, or the page that explains it."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from drake_tc.cli.options import Force, UnusedSeed
from drake_tc.cli.out_files import print_or_write


class Document(StrEnum):
    """Input files that have a schema."""

    rig = "rig"
    robot = "robot"
    actuator = "actuator"
    controller = "controller"
    scenario = "scenario"
    whole_body_scenario = "whole-body-scenario"
    series_elastic_scenario = "series-elastic-scenario"


def schema_command(
    document: Annotated[
        Document, typer.Argument(metavar="DOCUMENT", help=f"Input file: {', '.join(Document)}.", show_choices=False)
    ],
    page: Annotated[bool, typer.Option("--page", help="Print the page that explains every key (Markdown).")] = False,
    out: Annotated[Path | None, typer.Option(help="File to write; stdout when left out.")] = None,
    force: Force = False,
    seed: UnusedSeed = 0,
) -> None:
    """Print the JSON schema of an input file for editors, or with --page the page that explains every key."""

    def text() -> str:
        return document_page(document) if page else _as_text(document_schema(document))

    print_or_write(text, out, [], force=force)


def _as_text(schema: dict[str, Any]) -> str:
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def document_schema(document: Document) -> dict[str, Any]:
    """The JSON schema of a file."""
    from drake_tc.config.page import json_schema
    from drake_tc.logs.rig_document.document import rig_schema

    if document == Document.rig:
        return rig_schema()
    schema = json_schema(document_model(document), f"drake_tc {document.replace('-', ' ')} file")
    return by_name(schema) if document in SCENARIOS else schema


def by_name(schema: dict[str, Any]) -> dict[str, Any]:
    """The schema of a file of scenarios by name, of which each may extend another one."""
    of_all = {name: schema[name] for name in ("$schema", "$defs", "title")}
    extends = {"type": "string", "description": "Scenario of this file whose values hold where this one says nothing."}
    each = {name: value for name, value in schema.items() if name not in (*of_all, "required")}
    each["properties"] = {"extends": extends, **each["properties"]}
    return {**of_all, "type": "object", "additionalProperties": {"anyOf": [each, {"type": "null"}]}}


def document_page(document: Document) -> str:
    """The page of a file (Markdown)."""
    from drake_tc.config.page import page
    from drake_tc.report.pages import rig_page

    if document == Document.rig:
        return rig_page()
    title, introduction = f"The {document.replace('-', ' ')} file", _INTRODUCTION
    if document in SCENARIOS:
        introduction += " " + _BY_NAME
    return page(document_model(document), title, introduction)


_INTRODUCTION = (
    "All quantities are in SI units, angles in rad. An unknown key, a name that does not exist, or an impossible value "
    "is an error that names file and key."
)

_BY_NAME = (
    "The file maps names to scenarios. `extends: NAME` takes the values of another scenario of the file, and changes "
    "those that are given, key by key. The keys of one scenario:"
)
SCENARIOS = (Document.scenario, Document.whole_body_scenario, Document.series_elastic_scenario)


def document_model(document: Document) -> Any:
    """The model of a file; imported here, as most commands need none of them."""
    from drake_tc.actuation.model_file import ModelDocument
    from drake_tc.config.records import record_keys
    from drake_tc.loops.series_elastic.scenario import SeaScenario
    from drake_tc.loops.torque.scenario import Scenario
    from drake_tc.loops.whole_body.scenario import TsidScenario
    from drake_tc.robot.document import RobotDocument
    from drake_tc.tsid.configuration import ControllerDocument

    models = {
        Document.robot: RobotDocument,
        Document.actuator: ModelDocument,
        Document.controller: ControllerDocument,
        Document.scenario: record_keys(Scenario, "source"),
        Document.whole_body_scenario: record_keys(TsidScenario, "source"),
        Document.series_elastic_scenario: record_keys(SeaScenario, "source"),
    }
    return models[document]
