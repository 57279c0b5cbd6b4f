"""How `python -m tests.benchmarks real-logs` shows what close-loop claims of public logs, and whether it holds."""

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from drake_tc.cli.terminal import print_wide
from tests.benchmarks.figures import rows_json

if TYPE_CHECKING:
    from tests.benchmarks.real_log_claims import CaseClaims, JointClaims, RunFigures
    from tests.benchmarks.real_logs import SetClaims


def claims_document(sets: Sequence["SetClaims"]) -> dict[str, Any]:
    """Rows and all cases, for programs."""
    from tests.benchmarks.real_logs import rows_of

    return rows_json("real-logs", rows_of(sets)) | {
        "cases": [case.to_json() for entry in sets for case in entry.cases],
        "not_run": {entry.name: entry.not_readable for entry in sets if entry.not_readable},
    }


def _yes(value: bool) -> str:
    return "yes" if value else "NO"


def print_case(case: "CaseClaims") -> None:
    """One case: its verdict, and the figures of its joints."""
    console = Console(file=sys.stdout, highlight=False)
    console.print(f"[bold]{escape(case.name)}[/bold]: {case.verdict} ({case.seconds:.1f} s)")
    if case.note:
        console.print(f"  note: {escape(case.note)}")
    if case.refusal:
        console.print(f"  {escape(case.refusal)}")
        return
    for cause in case.shared:
        console.print(f"  + {cause['id']} of {cause['where']}  {_parameters(cause)}")
    for joint in case.joints:
        _print_joint(console, joint)
    for label, problems in (("claims hold", case.failures), ("verdict agrees", case.disagreements)):
        console.print(f"  {label}: {_yes(not problems)}")
        for why in problems:
            console.print(f"    - {escape(why)}")


def _print_joint(console: Console, joint: "JointClaims") -> None:
    unit = joint.unit
    headings = (f"before [{unit}]", f"after [{unit}]", "after / floor", f"in band [{unit}]", "band [Hz]")
    rows = [
        (run.name, *(f"{x:.3g}" for x in (run.before, run.after, run.ratio)), *_band(run))
        for run in (joint.train, *joint.heldout)
    ]
    title = f"  {joint.joint}, noise floor {joint.floor:.3g} {unit}"
    print_wide(("  run", *headings), [(f"  {name}", *row) for name, *row in rows], left=("  run",), title=title)
    for effect in joint.effects:
        gain = effect["heldout_gain"]
        shown = "unknown" if gain is None else f"{100 * gain:.0f} %"
        console.print(f"  + {effect['id']}  {_parameters(effect)}  (held-out gain {shown})")
    for effect in joint.did_not_hold:
        console.print(f"  - {effect['id']} did not hold: {escape(str(effect.get('why', '')))}")
    left = joint.unexplained
    depends = ", ".join(left["depends_on"]) or "nothing recorded"
    floors = left.get("floors")
    size = "" if floors is None else f"{floors:.3g} floors, "
    share = left["fraction"]
    shown = "an unknown share" if share is None else f"{100 * share:.0f} %"
    console.print(f"  left: {size}{shown} of it depends on {depends}; structured: {_yes(left['structured']).lower()}")


def _band(run: "RunFigures") -> tuple[str, str]:
    """Error inside the band that the training runs choose, and where that band ends."""
    if run.band_hz == 0.0:
        return "-", "none"
    return f"{run.in_band:.3g}", "all" if math.isinf(run.band_hz) else f"{run.band_hz:.3g}"


def _parameters(effect: Any) -> str:
    shown = []
    for name, entry in effect["parameters"].items():
        value = "unknown" if entry["value"] is None else f"{entry['value']:.4g}"
        shown.append(f"{name} {value} {entry['unit']}" + (" (at its bound)" if entry["at_bound"] else ""))
    return escape(", ".join(shown))


def print_summary(sets: Sequence["SetClaims"]) -> None:
    """The sets that were not run, and one line a case."""
    console = Console(file=sys.stdout, highlight=False)
    for entry in sets:
        if entry.not_readable:
            console.print(f"[bold]{entry.name}[/bold]: not run. {escape(entry.not_readable)}")
    rows = []
    for case in (case for entry in sets for case in entry.cases):
        named = [str(e["id"]) for e in (*case.shared, *(e for joint in case.joints for e in joint.effects))]
        ratios = [run.ratio for joint in case.joints for run in (joint.train, *joint.heldout)]
        refused = case.verdict == "refused"
        rows.append(
            (
                case.name,
                case.verdict,
                "" if not ratios else f"{max(ratios):.3g}",
                "" if refused else _yes(not case.failures),
                "" if refused else _yes(not case.disagreements),
                "" if refused else ", ".join(dict.fromkeys(named)) or "none",
            )
        )
    headings = ("case", "verdict", "largest after / floor", "claims hold", "verdict agrees", "effects")
    print_wide(headings, rows, left=("case", "verdict", "effects"), title="close-loop on public logs")
