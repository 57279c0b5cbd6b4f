"""`drake-tc check`: what logs can and cannot show, before anything is fitted."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from drake_tc.cli.next_command import command_line, say_next
from drake_tc.cli.out_files import Force, result_folder
from drake_tc.cli.progress import progress_bar
from drake_tc.cli.seed_option import UnusedSeed
from drake_tc.cli.wide_table import print_wide
from drake_tc.errors import LogError

if TYPE_CHECKING:
    from drake_tc.experiments.check.obstacles import Reasons
    from drake_tc.experiments.check.run import CheckResult

FILES = ("check.html", "check.json")
WORDS = {"seen": "seen", "weakly": "weakly", "not_seen": "not seen", "not_separable": "not separable"}


def check_command(
    rig: Annotated[
        Path, typer.Option(help="Rig file (YAML): joints, drives, columns, and what your model already contains.")
    ],
    log: Annotated[list[Path], typer.Option(help="A run; repeat for more.")],
    out: Annotated[Path | None, typer.Option(help="Folder for check.html and check.json.")] = None,
    seed: UnusedSeed = 0,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the check as JSON.")] = False,
) -> None:
    """Print what logs contain, which missing effects they can show and how large these must be, and why not others.

    It takes seconds, since nothing is searched for. `close-loop` on the same runs searches for the effects themselves.
    """
    from drake_tc.experiments.check.run import check_rig
    from drake_tc.experiments.check.to_json import check_json

    with progress_bar("check", quiet=as_json) as progress:
        if out is None:
            result = check_rig(rig, log, progress)
        else:
            with result_folder(out, "--out", names=FILES, inputs=[rig, *log], force=force, error=LogError) as folder:
                result = check_rig(rig, log, progress)
                write_check(result, folder)
    if as_json:
        print(json.dumps(check_json(result), indent=1))
    else:
        print_check(result)
        if out is not None:
            print(out / FILES[0])
        fit = command_line("close-loop", "--rig", rig, *(word for each in log for word in ("--log", each)))
        say_next(f"{fit} --holdout RUN --out FOLDER, with a run that is not among these")


def write_check(result: "CheckResult", folder: Path) -> None:
    """check.json and check.html in a folder."""
    from drake_tc.experiments.check.page import check_page
    from drake_tc.experiments.check.to_json import check_json

    (folder / "check.json").write_text(json.dumps(check_json(result), indent=1) + "\n", encoding="utf-8")
    (folder / "check.html").write_text(check_page(result), encoding="utf-8")


def print_check(result: "CheckResult") -> None:
    """Findings and the table of effects of every joint; what no joint can show comes once, at the end."""
    from drake_tc.experiments.check.obstacles import shared_and_own

    shared, own = shared_and_own({n: j.effects.effects for n, j in result.joints.items() if j.effects is not None})
    for run in result.runs:
        print(f"{run.name}: {run.seconds:.4g} s at {run.rate:.4g} Hz, {100.0 * run.usable:.0f} % usable")
        for note in run.notes:
            print(f"  {note}")
    for name, joint in result.joints.items():
        print(f"\n{name} ({joint.drive})")
        if joint.effects is None:
            print(f"  {joint.refusal}")
            continue
        for finding in joint.findings:
            mark = {"good": " ", "note": "-", "warning": "!"}[finding.level]
            print(f"  {mark} {finding.text}")
        rows = [
            (
                each.key,
                WORDS[each.status],
                _number(each.smallest),
                each.size.unit,
                each.why,
            )
            for each in joint.effects.effects
            if not each.obstacle
        ]
        headings = ("effect", "these logs", "found from", "unit", "why")
        print_wide(headings, rows, left=("effect", "these logs", "unit", "why"))
        _print_reasons("Cannot be looked for", own[name])
    print()
    _print_reasons("Cannot be looked for in any joint", shared)


def _print_reasons(title: str, reasons: "Reasons") -> None:
    if reasons:
        print(f"{title}:")
    for reason, keys in reasons.items():
        print(f"  {', '.join(keys)}: {reason}")


def _number(value: float) -> str:
    return f"{value:.3g}" if 0.0 < value < float("inf") else "-"
