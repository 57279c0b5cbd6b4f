"""`drake-tc import`: recordings in another project's format to canonical logs and rig files."""

import json
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.cli.out_files import Force, result_folder
from drake_tc.cli.seed_option import UnusedSeed
from drake_tc.config.files import is_folder
from drake_tc.errors import LogError

FORMATS = ("bam",)
"""Formats that hold more than a table of signals; LeRobot data sets are read as logs, without an import."""


def import_logs(
    format_: Annotated[str, typer.Argument(metavar="FORMAT", help=f"Format: {', '.join(FORMATS)}.")],
    src: Annotated[Path, typer.Argument(help="Folder of the recordings.")],
    out: Annotated[Path, typer.Option("--out", help="Folder to write logs and rig files to.")],
    force: Force = False,
    seed: UnusedSeed = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the paths of the rig files as JSON.")] = False,
) -> None:
    """Convert BAM servo recordings to Parquet logs with canonical columns, and write rig files that read them.

    The command prints the paths of the rig files. It exits with 2 and one line on stderr when SRC cannot be used.
    """
    if format_ not in FORMATS:
        raise LogError(f"import: no format {format_!r}; possible: {', '.join(FORMATS)}")
    from drake_tc.logs.bam_runs import convert

    typer.echo(f"reading {src} ...", err=True)
    inputs = src.rglob("*") if is_folder(src) else ()
    with result_folder(out, "--out", inputs=inputs, force=force, error=LogError) as folder:
        rigs = [out / path.relative_to(folder) for path in convert(src, folder)]
    if as_json:
        typer.echo(json.dumps({"name": "import", "rigs": [str(rig) for rig in rigs]}, indent=1))
        return
    for rig in rigs:
        typer.echo(str(rig))
