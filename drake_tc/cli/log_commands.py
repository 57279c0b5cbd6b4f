"""The commands on logs alone: `drake-tc inspect`, `import` and `check`.

`drake-tc inspect`: what a log holds, and a rig file to start from.

`drake-tc import`: recordings in another project's format to canonical logs and rig files.

`drake-tc check`: what logs can and cannot show, before anything is fitted.
"""

import json
import math
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drake_tc.cli.options import Declared, Force, UnusedSeed
from drake_tc.cli.out_files import result_file, result_folder
from drake_tc.cli.terminal import command_line, print_wide, progress_bar, say_next, tell_declared
from drake_tc.config.files import is_folder, utf8_name
from drake_tc.config.quoted import json_value
from drake_tc.errors import LogError

if TYPE_CHECKING:
    from drake_tc.experiments.check.effects import Reasons
    from drake_tc.experiments.check.run import CheckResult
    from drake_tc.logs.inspection import Inspection


def inspect_command(
    log: Annotated[Path, typer.Argument(help="A log: CSV, Parquet, NPZ, MAT, JSON, LeRobot, MCAP or a ROS bag.")],
    rig: Annotated[Path | None, typer.Option(help="Write a rig file to start from here.")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as JSON.")] = False,
    seed: UnusedSeed = 0,
) -> None:
    """List a log's topics, columns, rates and gaps, and guess quantities and units with the reasons.

    With --rig it writes a rig file with these guesses for `close-loop`. Check them, because a name can mislead.
    """
    from drake_tc.logs.inspection import inspect_log, trial

    found = inspect_log(log)
    problem = trial(found)
    if rig is not None and found.rig:
        with result_file(rig, "--rig", inputs=[log], force=force) as path:
            path.write_text(_rig_text(found), encoding="utf-8")
    if as_json:
        print(json.dumps(json_value(_document(found, problem, rig if found.rig else None)), indent=1))
    else:
        _print(found)
        for note in found.notes:
            print(note)
        if problem:
            print(f"close-loop cannot use this log: {problem}", file=sys.stderr)
    if rig is not None and not found.rig:
        raise LogError(f"{log}: no rig file was written: {found.notes[-1]}")
    if not as_json:
        if rig is not None:
            print(rig)
        if found.rig:
            say_next(_after(log, rig))


def _after(log: Path, rig: Path | None) -> str:
    """What follows: writing a rig file, or checking what the logs can show with the one that was written."""
    if rig is None:
        return f"{command_line('inspect', log, '--rig', 'rig.yaml')} writes a first rig file"
    return f"correct the guesses in the rig file, then {command_line('check', '--rig', rig, '--log', log)}"


def _print(found: "Inspection") -> None:
    timed = "no time" if math.isnan(found.rate) else f"{found.duration:.4g} s at {found.rate:.4g} Hz"
    print(f"{found.path}: {found.rows} rows, {timed}{_gaps(found.gaps)}")
    if found.topics:
        kinds = [
            (t.name, t.kind, str(t.messages), _number(t.rate), "read" if t.read else "not read") for t in found.topics
        ]
        print_wide(("topic", "type", "messages", "rate [Hz]", ""), kinds, left=("topic", "type", ""))
        print()
    headings = ("column", "read as", "unit", "from", "to", "step", "missing", "why")
    rows = [
        (
            column.name,
            column.canonical or "-",
            column.unit or "-",
            _number(column.low),
            _number(column.high),
            _number(column.step) if column.step else "-",
            _share(column.missing),
            column.why,
        )
        for column in found.columns
    ]
    print_wide(headings, rows, left=("column", "read as", "unit", "why"))


def _gaps(count: int) -> str:
    return f", {count} gap{'s' if count > 1 else ''}" if count else ""


def _share(missing: float) -> str:
    """Share of the rows without a number; a single row of many is not rounded to none."""
    shown = f"{100.0 * missing:.0f} %"
    return "-" if not missing else "< 1 %" if shown == "0 %" else shown


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.4g}"


def _rig_text(found: "Inspection") -> str:
    import yaml

    name = utf8_name(found.path)
    head = f"# Suggested by drake-tc inspect from {name!r}: guesses from names and ranges; check them.\n"
    head += f"# {found.comment}\n" if found.comment else ""
    return head + yaml.safe_dump(dict(found.rig), sort_keys=False, allow_unicode=True)


def _document(found: "Inspection", problem: str, rig: Path | None) -> dict[str, Any]:
    keys = ("name", "canonical", "unit", "why", "low", "high", "step", "missing")
    return {
        "name": "inspect",
        "log": str(found.path),
        "rows": found.rows,
        "rate": found.rate,
        "duration": found.duration,
        "gaps": found.gaps,
        "topics": [asdict(topic) for topic in found.topics],
        "columns": [{key: getattr(column, key) for key in keys} for column in found.columns],
        "rig": dict(found.rig),
        "rig_file": None if rig is None else str(rig),
        "notes": list(found.notes),
        "problem": problem or None,
    }


FORMATS = ("bam",)
"""Formats that hold more than a table of signals; LeRobot data sets are read as logs, without an import."""


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Options of `drake-tc import`."""

    format_: Annotated[str, typer.Argument(metavar="FORMAT", help=f"Format: {', '.join(FORMATS)}.")]
    src: Annotated[Path, typer.Argument(help="Folder of the recordings.")]
    out: Annotated[Path, typer.Option("--out", help="Folder to write logs and rig files to.")]
    force: Force = False
    seed: UnusedSeed = 0
    as_json: Annotated[bool, typer.Option("--json", help="Print the paths of the rig files as JSON.")] = False


def import_logs(options: ImportOptions) -> None:
    """Convert BAM servo recordings to Parquet logs with canonical columns, and write rig files that read them.

    The command prints the paths of the rig files. It exits with 2 and one line on stderr when SRC cannot be used.
    """
    src, out = options.src, options.out
    if options.format_ not in FORMATS:
        raise LogError(f"import: no format {options.format_!r}; possible: {', '.join(FORMATS)}")
    from drake_tc.logs.files.bam_runs import convert

    typer.echo(f"reading {src} ...", err=True)
    inputs = src.rglob("*") if is_folder(src) else ()
    with result_folder(out, "--out", inputs=inputs, force=options.force) as folder:
        rigs = [out / path.relative_to(folder) for path in convert(src, folder)]
    if options.as_json:
        typer.echo(json.dumps({"name": "import", "rigs": [str(rig) for rig in rigs]}, indent=1))
        return
    for rig in rigs:
        typer.echo(str(rig))


FILES = ("check.html", "check.json")
WORDS = {"seen": "seen", "weakly": "weakly", "not_seen": "not seen", "not_separable": "not separable"}


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Options of `drake-tc check`."""

    rig: Annotated[
        Path, typer.Option(help="Rig file (YAML): joints, drives, columns, and what your model already contains.")
    ]
    log: Annotated[list[Path], typer.Option(help="A run; repeat for more.")]
    declared: Declared = None
    out: Annotated[Path | None, typer.Option(help="Folder for check.html and check.json.")] = None
    seed: UnusedSeed = 0
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the check as JSON.")] = False


def check_command(options: CheckOptions) -> None:
    """Print what logs contain, which missing effects they can show and how large these must be, and why not others.

    It fits these runs as `close-loop` does, and judges every effect by that fit. `close-loop` on the same runs decides
    with runs that are held out.
    """
    from drake_tc.experiments.check.run import check_json, check_rig

    rig, log, declared, out = options.rig, options.log, options.declared, options.out
    tell_declared("check", rig, declared)
    with progress_bar("check", quiet=options.as_json) as progress:
        if out is None:
            result = check_rig(rig, log, progress, declared)
        else:
            with result_folder(out, "--out", names=FILES, inputs=[rig, *log, declared], force=options.force) as folder:
                result = check_rig(rig, log, progress, declared)
                write_check(result, folder)
    if options.as_json:
        print(json.dumps(check_json(result), indent=1))
    else:
        print_check(result)
        if out is not None:
            print(out / FILES[0])
        words = [*(word for each in log for word in ("--log", each)), *(["--declared", declared] if declared else [])]
        fit = command_line("close-loop", "--rig", rig, *words)
        say_next(f"{fit} --holdout RUN --out FOLDER, with a run that is not among these")


def write_check(result: "CheckResult", folder: Path) -> None:
    """check.json and check.html in a folder."""
    from drake_tc.experiments.check.run import check_json, check_page

    (folder / "check.json").write_text(json.dumps(check_json(result), indent=1) + "\n", encoding="utf-8")
    (folder / "check.html").write_text(check_page(result), encoding="utf-8")


def print_check(result: "CheckResult") -> None:
    """Findings and the table of effects of every joint; what no joint can show comes once, at the end."""
    from drake_tc.experiments.check.effects import shared_and_own

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
                _positive(each.smallest),
                each.size.unit,
                each.why,
            )
            for each in joint.effects.effects
            if not each.obstacle
        ]
        headings = ("effect", "these logs", "smallest size", "unit", "why")
        print_wide(headings, rows, left=("effect", "these logs", "unit", "why"))
        _print_reasons("Cannot be looked for", own[name])
    print()
    _print_reasons("Cannot be looked for in any joint", shared)


def _print_reasons(title: str, reasons: "Reasons") -> None:
    if reasons:
        print(f"{title}:")
    for reason, keys in reasons.items():
        print(f"  {', '.join(keys)}: {reason}")


def _positive(value: float) -> str:
    return f"{value:.3g}" if 0.0 < value < float("inf") else "-"
