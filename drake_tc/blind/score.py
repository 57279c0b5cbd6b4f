"""The blind benchmark's score: shares of right answers against their goals, and who was taken for whom."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.blind.outcome import Outcome, read_outcome
from drake_tc.blind.spec import BlindError

NOTHING, STRUCTURE, SILENT = "(nothing)", "(structure)", "(no report)"


@dataclass(frozen=True)
class ScoreRow:
    """One figure of the score.

    Attributes:
        name: What is measured.
        unit: `share`, `ratio` or `s`.
        median, p99: Of the n values; both the share itself where the unit is `share`.
        n: Rigs that count.
        goal: Text of the goal, empty where there is none.
        met: Whether the goal is met; True where there is none, False where nothing was measured.
    """

    name: str
    unit: str
    median: float
    p99: float
    n: int
    goal: str = ""
    met: bool = True

    def to_json(self) -> dict[str, object]:
        """The row as `bench --json` prints it; a figure without values is null."""
        finite = bool(np.isfinite(self.median))
        median, p99 = (self.median, self.p99) if finite else (None, None)
        return {
            "name": self.name,
            "unit": self.unit,
            "median": median,
            "p99": p99,
            "n": self.n,
            "goal": self.goal,
            "met": self.met,
        }


@dataclass(frozen=True)
class BenchmarkScore:
    """The whole score.

    Attributes:
        rows: The figures.
        confusion: Rigs by true kind (rows) and by what was named first (columns).
        outcomes: Rig by rig.
    """

    rows: tuple[ScoreRow, ...]
    confusion: pd.DataFrame
    outcomes: tuple[Outcome, ...]

    def to_json(self) -> dict[str, object]:
        """`{"name": "diagnosis", "rows": [...]}`, the contract of `bench`."""
        return {"name": "diagnosis", "rows": [row.to_json() for row in self.rows]}


def score_reports(truth_dir: Path, report_dir: Path) -> BenchmarkScore:
    """Score `report_dir/NAME/report.json` against `truth_dir/NAME/truth.json` for every NAME with a truth.

    A rig without a report counts as answered wrongly, whatever its group.

    Raises:
        BlindError: No truth at all, or a file that cannot be used.
    """
    paths = sorted(truth_dir.glob("*/truth.json"))
    if not paths:
        raise BlindError(f"{truth_dir}: wanted folders with truth.json, found none")
    outcomes = [read_outcome(path, report_dir / path.parent.name / "report.json") for path in paths]
    return score_outcomes(outcomes)


def score_outcomes(outcomes: Sequence[Outcome]) -> BenchmarkScore:
    """All figures of the benchmark from the rigs' outcomes.

    A tie counts as right when the report itself lists truth and name as indistinguishable. A false alarm is any
    effect named on a null. The error ratio is taken over rigs whose true effects the library has, nulls included.
    """
    rows: list[ScoreRow] = []
    for strength in ("weak", "middle", "strong"):
        singles = [o for o in outcomes if o.group == "single" and o.strength == strength]
        goals = (0.95, 0.90) if strength == "middle" else (None, None)
        rows.append(_share(f"right effect first, {strength}", singles, lambda o: o.first_right, at_least=goals[0]))
        rows.append(_share(f"exact, {strength}", singles, lambda o: o.exact, at_least=goals[1]))
    pairs, nulls = _group(outcomes, "pair"), _group(outcomes, "null")
    outside, inside = _group(outcomes, "outside"), [o for o in outcomes if o.group != "outside"]
    rows.append(_share("both effects of a pair", pairs, lambda o: o.all_found, at_least=0.85))
    rows.append(_share("false alarms on nulls", nulls, lambda o: bool(o.named) or not o.answered, at_most=0.03))
    rows.append(_share("outside causes flagged structured", outside, lambda o: o.structured, at_least=0.90))
    rows.append(_share("other rigs flagged structured", inside, lambda o: o.structured, at_most=0.05))
    rows.append(_values("held-out error over oracle, middle", [o for o in inside if o.strength == "middle"], 1.15))
    rows.append(_values("held-out error over oracle, nulls", nulls, 1.15))
    rows.append(_values("held-out error over oracle, all", inside, 1.15))
    rows.append(_share("rigs without a report", list(outcomes), lambda o: not o.answered, at_most=0.0))
    rows.append(_summary("time for a rig", "s", [o.seconds for o in outcomes]))
    return BenchmarkScore(tuple(row for row in rows if row.n), confusion_matrix(outcomes), tuple(outcomes))


def confusion_matrix(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """Counts: true kind (a pair as `a+b`, a null as `null: kind`) by the first effect named.

    Where nothing is named, the column is `(structure)`, `(nothing)` or `(no report)`.
    """
    pairs = pd.DataFrame(
        {"truth": [_label(outcome) for outcome in outcomes], "named": [_said(outcome) for outcome in outcomes]}
    )
    return pd.crosstab(pairs["truth"], pairs["named"])


def _label(outcome: Outcome) -> str:
    return outcome.kind if outcome.group in ("single", "pair") else f"{outcome.group}: {outcome.kind}"


def _said(outcome: Outcome) -> str:
    if outcome.named:
        return outcome.named[0]
    if not outcome.answered:
        return SILENT
    return STRUCTURE if outcome.structured else NOTHING


def _group(outcomes: Sequence[Outcome], group: str) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.group == group]


def _share(
    name: str,
    outcomes: Sequence[Outcome],
    test: Callable[[Outcome], bool],
    *,
    at_least: float | None = None,
    at_most: float | None = None,
) -> ScoreRow:
    """The share of the outcomes that pass `test`, with its goal."""
    if not outcomes:
        return ScoreRow(name, "share", float("nan"), float("nan"), 0, met=False)
    share = float(np.mean([test(outcome) for outcome in outcomes]))
    goal = f">= {at_least:.2f}" if at_least is not None else f"<= {at_most:.2f}" if at_most is not None else ""
    met = (at_least is None or share >= at_least) and (at_most is None or share <= at_most)
    return ScoreRow(name, "share", share, share, len(outcomes), goal, met)


def _values(name: str, outcomes: Sequence[Outcome], highest: float) -> ScoreRow:
    """Median and 99th percentile of the error ratios; the goal is on the median."""
    row = _summary(name, "ratio", [outcome.ratio for outcome in outcomes])
    met = bool(row.n) and row.median <= highest
    return ScoreRow(name, row.unit, row.median, row.p99, row.n, f"median <= {highest:.2f}", met)


def _summary(name: str, unit: str, values: Sequence[float]) -> ScoreRow:
    finite = np.array([value for value in values if np.isfinite(value)])
    if not finite.size:
        return ScoreRow(name, unit, float("nan"), float("nan"), 0, met=False)
    return ScoreRow(name, unit, float(np.median(finite)), float(np.percentile(finite, 99)), int(finite.size))
