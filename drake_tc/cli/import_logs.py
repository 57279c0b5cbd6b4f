"""`drake-tc import`: public data sets to canonical logs and rig files."""

from pathlib import Path
from typing import Annotated

import typer

from drake_tc.errors import DrakeTcError
from drake_tc.logs.importers import IMPORTERS


def import_logs(
    dataset: Annotated[str, typer.Argument(help=f"Which data set: {', '.join(IMPORTERS)}.")],
    src: Annotated[Path, typer.Argument(help="Folder of the data set as published.")],
    out: Annotated[Path, typer.Option("--out", help="Folder to write logs and rig files to.")],
) -> None:
    """Convert a public data set: writes Parquet logs in canonical columns and the rig files that read them.

    Prints the rig files, one a line; exits with 2 and one line on stderr when SRC cannot be used.
    """
    if dataset not in IMPORTERS:
        typer.echo(f"drake-tc import: no data set {dataset!r}; possible: {', '.join(IMPORTERS)}", err=True)
        raise typer.Exit(2)
    typer.echo(f"reading {src} ...", err=True)
    try:
        rigs = IMPORTERS[dataset](src, out)
    except DrakeTcError as error:
        typer.echo(f"drake-tc import: {error}", err=True)
        raise typer.Exit(2) from None
    except OSError as error:
        typer.echo(f"drake-tc import: cannot write to {out}: {error}", err=True)
        raise typer.Exit(2) from None
    for rig in rigs:
        typer.echo(str(rig))
