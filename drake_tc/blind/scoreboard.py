"""Prints a score for a person: the figures against their goals, then who was taken for whom.

`python -m drake_tc.blind.scoreboard --truth DIR --reports DIR [--json]`
"""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from drake_tc.blind.score import BenchmarkScore, score_reports


def print_score(score: BenchmarkScore, console: Console | None = None) -> None:
    """Print the figures, the confusions, and the rigs that were answered wrongly, to `console` (default: stdout)."""
    console = console or Console()
    console.print(_figures(score))
    console.print(_confusions(score))
    wrong = [o for o in score.outcomes if not (o.structured if o.group == "outside" else o.exact)]
    for outcome in wrong:
        named = ", ".join(outcome.named) or ("structure" if outcome.structured else "nothing")
        console.print(f"{outcome.name}: {outcome.group} {outcome.kind} {outcome.strength}: named {named}")


def _figures(score: BenchmarkScore) -> Table:
    table = Table(title="Blind benchmark of the diagnosis")
    for heading in ("figure", "median", "99 %", "n", "goal", "met"):
        table.add_column(heading, justify="left" if heading in ("figure", "goal") else "right")
    for row in score.rows:
        met = "" if not row.goal else "yes" if row.met else "NO"
        unit = "" if row.unit in ("share", "ratio") else f" {row.unit}"
        table.add_row(row.name, f"{row.median:.3f}{unit}", f"{row.p99:.3f}{unit}", str(row.n), row.goal, met)
    return table


def _confusions(score: BenchmarkScore) -> Table:
    """One line a true kind: what was named first, and how often."""
    table = Table("truth", "named first (rigs)", title="Who was taken for whom")
    for kind, counts in score.confusion.iterrows():
        said = counts[counts > 0].sort_values(ascending=False)
        table.add_row(str(kind), ", ".join(f"{name} {count}" for name, count in said.items()))
    return table


def main(
    truth: Annotated[Path, typer.Option(help="Folder with NAME/truth.json.")],
    reports: Annotated[Path, typer.Option(help="Folder with NAME/report.json.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Score the reports against the truth."""
    score = score_reports(truth, reports)
    if as_json:
        print(json.dumps(score.to_json()))
    else:
        print_score(score)


if __name__ == "__main__":
    typer.run(main)
