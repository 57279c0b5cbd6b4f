"""`drake-tc rehearse`: would this set-up have found it?"""

import json
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from drake_tc.analysis.executors import processes
from drake_tc.cli.out_files import Force, result_folder
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.wide_table import print_wide
from drake_tc.errors import LogError, ParamsError

if TYPE_CHECKING:
    from drake_tc.experiments.rehearsal.run import Rehearsal


def rehearse_command(
    rig: Annotated[Path, typer.Option(help="Rig file (YAML).")],
    log: Annotated[list[Path], typer.Option(help="A run; repeat. Without --holdout the last one is held out.")],
    with_: Annotated[str, typer.Option("--with", help="EFFECT or EFFECT=SIZE, such as backlash=0.001.")],
    holdout: Annotated[list[Path] | None, typer.Option(help="A run that takes no part in fitting; repeat.")] = None,
    joint: Annotated[str | None, typer.Option(help="Joint; only needed where the rig has several.")] = None,
    repeats: Annotated[int, typer.Option(help="Number of trials at each size.")] = 4,
    jobs: Annotated[int, typer.Option(help="Number of parallel processes.")] = 2,
    seed: Annotated[int, typer.Option(min=0, help="Seed of noise and phases.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder for rehearsal.html and rehearsal.json.")] = Path("rehearsal"),
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print rehearsal.json to stdout.")] = False,
) -> None:
    """Add an effect to your own runs by simulation, diagnose them, and count how often it is found.

    Motions, loads, sensors and noise are those of the logs. The result is the rate of detection over the effect's size,
    and the effects that were named in its place.
    """
    from drake_tc.experiments.rehearsal.output import FILES, rehearsal_json, rehearsal_page
    from drake_tc.experiments.rehearsal.run import parse_effect, rehearse
    from drake_tc.experiments.rehearsal.twin import twin_of
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    if not 1 <= repeats <= 200:
        raise ParamsError(f"--repeats: expected 1 to 200, got {repeats}")
    effect_id, size = parse_effect(with_)
    tested = list(holdout or log[-1:])
    fitted = [path for path in log if path not in tested]
    if not fitted:
        raise LogError(f"expected at least two runs, one --log RUN to fit and one to test, got {len(log)}")
    with (
        result_folder(out, "--out", names=FILES, inputs=[rig, *log, *tested], force=force, error=ParamsError) as folder,
        progress_bar("rehearse", quiet=as_json) as progress,
        processes(jobs) if jobs > 1 else nullcontext() as pool,
    ):
        read = load_rig(rig)
        name = _joint(read.joints, joint)
        progress("reading", 0.0)
        runs = load_runs([*fitted, *tested], read)
        held = [run.name for run in runs[len(fitted) :]]
        twin = twin_of(read, runs, name)
        found = rehearse(twin, effect_id, size, held, repeats=repeats, seed=seed, executor=pool, progress=progress)
        (folder / FILES[0]).write_text(rehearsal_page(found), encoding="utf-8")
        (folder / FILES[1]).write_text(json.dumps(rehearsal_json(found), indent=1) + "\n", encoding="utf-8")
    if as_json:
        print(json.dumps(rehearsal_json(found), indent=1))
    else:
        print_rehearsal(found)
        print(out / FILES[0])


def _joint(joints: tuple[str, ...], asked: str | None) -> str:
    if asked is None and len(joints) == 1:
        return joints[0]
    if asked not in joints:
        raise ParamsError(f"--joint: expected one of {', '.join(joints)}, got {asked or 'none'}")
    return str(asked)


def print_rehearsal(found: "Rehearsal") -> None:
    """The power curve as a table."""
    from drake_tc.experiments.rehearsal.output import summary

    print(summary(found))
    rows = [
        (
            f"{p.size:.3g}",
            f"{p.found} of {p.trials}",
            f"{100.0 * p.interval[0]:.0f} to {100.0 * p.interval[1]:.0f} %",
            str(p.alone),
            ", ".join(f"{name} ({count})" for name, count in p.others.items()),
        )
        for p in found.points
    ]
    headings = (f"{found.size.name} [{found.size.unit}]", "found", "95 % interval", "alone", "named instead")
    print_wide(headings, rows, left=("named instead",))
