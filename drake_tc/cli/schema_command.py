"""`drake-tc schema`: the JSON schema of an input file, or the page that explains it."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from drake_tc.cli.out_files import Force, print_or_write


class Document(StrEnum):
    """Input files that have a schema."""

    rig = "rig"
    robot = "robot"
    actuator = "actuator"
    controller = "controller"


def schema_command(
    document: Annotated[Document, typer.Argument(help="Which input file.")],
    page: Annotated[bool, typer.Option("--page", help="Print the page that explains every key (Markdown).")] = False,
    out: Annotated[Path | None, typer.Option(help="File to write; stdout when left out.")] = None,
    force: Force = False,
) -> None:
    """Print the JSON schema of an input file for editors, or with --page the page that explains every key."""

    def text() -> str:
        return document_page(document) if page else _as_text(document_schema(document))

    print_or_write(text, out, [], force=force)


def _as_text(schema: dict[str, Any]) -> str:
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def document_schema(document: Document) -> dict[str, Any]:
    """The JSON schema of a file."""
    from drake_tc.config.schema import json_schema
    from drake_tc.logs.rig_document.schema import rig_schema

    if document == Document.rig:
        return rig_schema()
    return json_schema(document_model(document), f"drake_tc {document} file")


def document_page(document: Document) -> str:
    """The page of a file (Markdown)."""
    from drake_tc.config.page import page
    from drake_tc.report.rig_page import rig_page

    if document == Document.rig:
        return rig_page()
    return page(document_model(document), f"The {document} file", _INTRODUCTION)


_INTRODUCTION = (
    "All quantities are in SI units, angles in rad. An unknown key, a name that does not exist, or an impossible value "
    "is an error that names file and key."
)


def document_model(document: Document) -> Any:
    """The model of a file; imported here, as most commands need none of them."""
    from drake_tc.actuation.model_document import ModelDocument
    from drake_tc.robot.document import RobotDocument
    from drake_tc.tsid.document import ControllerDocument

    models = {
        Document.robot: RobotDocument,
        Document.actuator: ModelDocument,
        Document.controller: ControllerDocument,
    }
    return models[document]
