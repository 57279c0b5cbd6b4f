"""`drake-tc inspect`: what a log holds, and a rig file to start from."""

import json
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drake_tc.cli.next_command import command_line, say_next
from drake_tc.cli.out_files import Force, result_file
from drake_tc.cli.seed_option import UnusedSeed
from drake_tc.cli.wide_table import print_wide
from drake_tc.config.files import utf8_name
from drake_tc.config.quoted import json_value
from drake_tc.errors import LogError

if TYPE_CHECKING:
    from drake_tc.logs.inspection.inspect import Inspection


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
    from drake_tc.logs.inspection.inspect import inspect_log, trial

    found = inspect_log(log)
    problem = trial(found)
    if rig is not None and found.rig:
        with result_file(rig, "--rig", inputs=[log], force=force, error=LogError) as path:
            path.write_text(_rig_text(found), encoding="utf-8")
    if as_json:
        print(json.dumps(json_value(_document(found, problem, rig if found.rig else None)), indent=1))
    else:
        _print(found)
        for note in found.notes:
            print(note)
        if problem:
            print(f"close-loop would refuse it: {problem}", file=sys.stderr)
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
        return f"{command_line('inspect', log, '--rig', 'rig.yaml')} writes a rig file to start from"
    return f"correct the guesses in the rig file, then {command_line('check', '--rig', rig, '--log', log)}"


def _print(found: "Inspection") -> None:
    timed = "no time" if math.isnan(found.rate) else f"{found.duration:.4g} s at {found.rate:.4g} Hz"
    print(f"{found.path}: {found.rows} rows, {timed}{f', {found.gaps} gaps' if found.gaps else ''}")
    if found.topics:
        kinds = [
            (t.name, t.kind, str(t.messages), _number(t.rate), "read" if t.read else "not read") for t in found.topics
        ]
        print_wide(("topic", "type", "messages", "rate [Hz]", ""), kinds, left=("topic", "type", ""))
        print()
    headings = ("column", "taken for", "unit", "from", "to", "step", "missing", "why")
    rows = [
        (
            column.name,
            column.canonical or "-",
            column.unit or "-",
            _number(column.low),
            _number(column.high),
            _number(column.step) if column.step else "-",
            f"{100.0 * column.missing:.0f} %" if column.missing else "-",
            column.why,
        )
        for column in found.columns
    ]
    print_wide(headings, rows, left=("column", "taken for", "unit", "why"))


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
