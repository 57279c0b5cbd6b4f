"""Importers: one file a public data set, each writes canonical logs (Parquet) and rig files.

An importer is `convert(src, out)`: `src` is the folder of the set as published, `out` a folder to write to; it returns
the rig files it wrote. Logs lie beside the rig file that reads them.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

Importer = Callable[[Path, Path], tuple[Path, ...]]


def _importer(module: str) -> Importer:
    """`convert` of a module of this folder, which is loaded by the first call: commands need the names alone."""

    def convert(src: Path, out: Path) -> tuple[Path, ...]:
        made: tuple[Path, ...] = import_module(f"{__name__}.{module}").convert(src, out)
        return made

    return convert


IMPORTERS: Mapping[str, Importer] = MappingProxyType(
    {
        "bam": _importer("bam"),
        "dfki": _importer("dfki"),
        "tmotor": _importer("tmotor"),
        "staubli": _importer("staubli"),
        "tiago": _importer("tiago"),
        "uart-backlash": _importer("uart_backlash"),
        "ur10e": _importer("ur10e"),
        "so101": _importer("so101"),
        "go2": _importer("go2"),
    }
)
