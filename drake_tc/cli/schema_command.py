"""`drake-tc schema`: the JSON schema of an input file, or the page that explains it."""

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.cli.out_files import Force, print_or_write


class Document(StrEnum):
    """Input files that have a schema."""

    rig = "rig"


def schema_command(
    document: Annotated[Document, typer.Argument(help="Which input file.")],
    page: Annotated[bool, typer.Option("--page", help="Print the page that explains every key (Markdown).")] = False,
    out: Annotated[Path | None, typer.Option(help="File to write; stdout when left out.")] = None,
    force: Force = False,
) -> None:
    """Print the JSON schema of the rig file for editors, or with --page the page that explains every key."""
    from drake_tc.logs.rig_document.schema import rig_schema
    from drake_tc.report.rig_page import rig_page

    schema = lambda: json.dumps(rig_schema(), indent=2, ensure_ascii=False) + "\n"  # noqa: E731
    print_or_write(rig_page if page else schema, out, [], force=force)
