"""The option `--declared`, and what files of other simulators declare."""

import sys
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

Declared: TypeAlias = Annotated[
    Path | None,
    typer.Option(help="File of your present model: URDF, MJCF, or a parameter file of BAM (JSON)."),
]


def tell_declared(command: str, rig: Path, declared: Path | None) -> None:
    """What files of other simulators declare, on stderr."""
    from drake_tc.logs.rig import load_rig

    for line in load_rig(rig, declared).declared_by_files:
        print(f"{command}: {line}", file=sys.stderr)
