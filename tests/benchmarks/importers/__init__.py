"""Importers of single public data sets: one file a set, each writes canonical logs (Parquet) and rig files.

An importer is `convert(src, out)`: `src` is the folder of the set as published, `out` a folder to write to; it returns
the rig files it wrote. Logs lie beside the rig file that reads them.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from drake_tc.logs.files import bam_runs
from tests.benchmarks.importers import dfki, go2, so101, staubli, tiago, tmotor, uart_backlash, ur10e

IMPORTERS: Mapping[str, Callable[[Path, Path], tuple[Path, ...]]] = {
    "bam": bam_runs.convert,
    "dfki": dfki.convert,
    "tmotor": tmotor.convert,
    "staubli": staubli.convert,
    "tiago": tiago.convert,
    "uart-backlash": uart_backlash.convert,
    "ur10e": ur10e.convert,
    "so101": so101.convert,
    "go2": go2.convert,
}
