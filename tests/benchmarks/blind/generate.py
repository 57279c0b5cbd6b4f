"""Makes a benchmark's files: `python -m tests.benchmarks.blind.generate --scale smoke --out DIR`."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.joint_simulator.physics import Record, simulate
from drake_tc.joint_simulator.spec import RUNS, DivergedError, RigSpec
from tests.benchmarks.blind.calibrate import calibrate, weakened
from tests.benchmarks.blind.catalogue import Scale, catalogue
from tests.benchmarks.blind.files import write_rig

Progress = Callable[[int, int], None]
BATCH = 60


def generate(
    specs: list[RigSpec], out_dir: Path, progress: Progress | None = None, *, step: float = 1e-4, batch: int = BATCH
) -> list[Path]:
    """Calibrate, simulate and write the rigs, `batch` at a time.

    Args:
        specs: From `catalogue`.
        out_dir: Gets `rigs/NAME` and `truth/NAME`.
        progress: Called with (rigs done, rigs in all).
        step: Integration step [s].
        batch: Rigs in one time loop; bounds the memory (about 10 MB a rig).

    Returns:
        The rigs' folders, in order.
    """
    folders: list[Path] = []
    for first in range(0, len(specs), batch):
        part = calibrate(specs[first : first + batch])
        records = _simulate_all(part, step)
        for i in range(len(part)):
            folders.append(write_rig(records[len(RUNS) * i : len(RUNS) * (i + 1)], out_dir))
        if progress is not None:
            progress(len(folders), len(specs))
    return folders


def _simulate_all(specs: list[RigSpec], step: float, attempts: int = 6) -> list[Record]:
    """All runs of the rigs; rigs that run away are weakened and the batch is run again.

    Raises:
        DivergedError: Rigs that still run away after the last attempt.
    """
    try:
        return simulate([spec for spec in specs for _ in RUNS], list(RUNS) * len(specs), step)
    except DivergedError as error:
        if attempts <= 1:
            raise
        calmer = [weakened(spec) if spec.name in error.names else spec for spec in specs]
        return _simulate_all(calmer, step, attempts - 1)


def main(
    out: Annotated[Path, typer.Option(help="Folder that gets rigs/ and truth/.")],
    scale: Annotated[str, typer.Option(help="smoke (about 30 rigs) or full (about 300).")] = "smoke",
    seed: Annotated[int, typer.Option(help="Same seed, same files.")] = 0,
) -> None:
    """Write the blind benchmark's rigs and, apart, their truth."""
    chosen: Scale = "full" if scale == "full" else "smoke"
    specs = catalogue(chosen, seed)
    generate(specs, out, lambda done, total: print(f"{done}/{total} rigs", file=sys.stderr))
    print(out)


if __name__ == "__main__":
    typer.run(main)
