"""Prints a score for a person: the figures against their goals, the kinds, and who was taken for whom.

`python -m tests.benchmarks.blind.scoreboard --truth DIR --reports DIR [--json]`
"""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from tests.benchmarks.blind.score import BenchmarkScore, score_reports
from tests.benchmarks.blind.score_kinds import describe_wrong, kind_table
from tests.benchmarks.figures import figure_table


def print_score(score: BenchmarkScore, console: Console | None = None) -> None:
    """Print the figures, the confusions, and the rigs that were answered wrongly, to `console` (default: stdout)."""
    console = console or Console()
    console.print(figure_table(score.rows, "Blind benchmark of the diagnosis"))
    console.print(_kinds(score))
    console.print(_confusions(score))
    for outcome in score.outcomes:
        if not outcome.right:
            console.print(describe_wrong(outcome), soft_wrap=True)


def _kinds(score: BenchmarkScore) -> Table:
    """One line for each group, kind and strength: rigs answered rightly of how many."""
    table = Table(title="Right answers by group and kind")
    for heading in ("group", "kind", "strength", "right", "rigs", "acting in training"):
        table.add_column(heading, justify="left" if heading in ("group", "kind", "strength") else "right")
    for row in kind_table(score.outcomes).to_dict("records"):
        texts = [str(row[name]) for name in ("group", "kind", "strength", "right", "rigs")]
        table.add_row(*texts, str(row["acting"]) if row["group"] == "single" else "")
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
