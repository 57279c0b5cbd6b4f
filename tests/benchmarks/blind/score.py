"""The blind benchmark's score: shares of right answers against their goals, and who was taken for whom."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from drake_tc.joint_simulator.spec import BlindError
from tests.benchmarks.blind.outcome import Outcome, read_outcome
from tests.benchmarks.figures import BenchmarkRow, rows_json

SAID_NOTHING, SAID_STRUCTURE, SAID_RESIDUAL, SILENT = "(nothing)", "(structure)", "(residual)", "(no report)"
RARELY_ACTING = ("saturation", "elasticity", "backlash")
"""Effects that have a row of their own."""


@dataclass(frozen=True)
class BenchmarkScore:
    """The whole score.

    Attributes:
        rows: The figures.
        confusion: Rigs by true kind (rows) and by what was named first (columns).
        outcomes: Rig by rig.
    """

    rows: tuple[BenchmarkRow, ...]
    confusion: pd.DataFrame
    outcomes: tuple[Outcome, ...]

    def to_json(self) -> dict[str, object]:
        """`{"name": "diagnosis", "rows": [...]}`, the contract of `bench`."""
        return rows_json("diagnosis", self.rows)


def score_reports(truth_dir: Path, report_dir: Path) -> BenchmarkScore:
    """Score `report_dir/NAME/report.json` against `truth_dir/NAME/truth.json` for every NAME with a truth.

    A rig without a report counts as answered wrongly, whatever its group.

    Raises:
        BlindError: No truth at all, or a file that cannot be used.
    """
    paths = sorted(truth_dir.glob("*/truth.json"))
    if not paths:
        raise BlindError(f"{truth_dir}: expected folders with truth.json, found none")
    outcomes = [read_outcome(path, report_dir / path.parent.name / "report.json") for path in paths]
    return score_outcomes(outcomes)


def score_outcomes(outcomes: Sequence[Outcome]) -> BenchmarkScore:
    """All figures of the benchmark from the rigs' outcomes.

    A tie counts as right when the report itself lists truth and name as indistinguishable. Single effects count
    where they act in the training runs: the others are to be called untested, a row of their own. A false alarm is an
    effect named on a rig that lacks nothing, or a verdict that is not right for it. An outside cause is flagged by a
    verdict that is right for its kind. The error ratio is taken over rigs whose effects the library has, and nulls.
    """
    inside = [o for o in outcomes if o.group != "outside"]
    rows = [
        *_single_rows([o for o in _group(outcomes, "single") if o.acts]),
        _share("both effects of a pair", _group(outcomes, "pair"), lambda o: o.all_found, at_least=0.90),
        _share("false alarms on nulls", _group(outcomes, "null"), lambda o: o.false_alarm, at_most=0.02),
        *_flag_rows(outcomes),
        *_rarely_acting_rows(_group(outcomes, "single")),
        _values("held-out error over oracle, middle", [o for o in inside if o.strength == "middle"], 1.15),
        _values("held-out error over oracle, nulls", _group(outcomes, "null"), 1.15),
        _values("held-out error over oracle, all", inside, 1.15),
        _share("rigs without a report", list(outcomes), lambda o: not o.answered, at_most=0.0),
        _summary("time for a rig", "s", [o.seconds for o in outcomes]),
    ]
    return BenchmarkScore(tuple(row for row in rows if row.n), confusion_matrix(outcomes), tuple(outcomes))


def _single_rows(singles: Sequence[Outcome]) -> list[BenchmarkRow]:
    rows = [
        _share("right effect first", singles, lambda o: o.first_right, at_least=0.95),
        _share("exact", singles, lambda o: o.exact, at_least=0.92),
    ]
    for strength in ("weak", "middle", "strong"):
        part = [o for o in singles if o.strength == strength]
        rows.append(_share(f"right effect first, {strength}", part, lambda o: o.first_right))
        rows.append(_share(f"exact, {strength}", part, lambda o: o.exact))
    return rows


def _flag_rows(outcomes: Sequence[Outcome]) -> list[BenchmarkRow]:
    outside = _group(outcomes, "outside")
    library = [o for o in outcomes if o.truth and o.acts]
    return [
        _share("outside causes flagged", outside, lambda o: o.flagged_rightly, at_least=0.95),
        _share("outside causes flagged by either verdict", outside, lambda o: o.flagged),
        _share("other rigs flagged", library, lambda o: o.flagged, at_most=0.04),
    ]


def _rarely_acting_rows(singles: Sequence[Outcome]) -> list[BenchmarkRow]:
    """Effects that act only where a motion or a load reaches them: found where they do, called untested elsewhere."""
    rows = []
    for effect in RARELY_ACTING:
        acting = [o for o in singles if o.kind == effect and o.acts]
        rows.append(_share(f"{effect} found where it acts in training", acting, lambda o: o.all_found, at_least=7 / 9))
    silent = [o for o in singles if not o.acts]
    rows.append(_share("called untested where it does not act", silent, lambda o: o.said_untested, at_least=1.0))
    return rows


def confusion_matrix(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """Counts: true kind (a pair as `a+b`, a null as `null: kind`) by the first effect named.

    Where nothing is named, the column is `(structure)`, `(residual)`, `(nothing)` or `(no report)`.
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
    if not outcome.flagged:
        return SAID_NOTHING
    return SAID_STRUCTURE if outcome.structured else SAID_RESIDUAL


def _group(outcomes: Sequence[Outcome], group: str) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.group == group]


def _share(
    name: str,
    outcomes: Sequence[Outcome],
    test: Callable[[Outcome], bool],
    *,
    at_least: float | None = None,
    at_most: float | None = None,
) -> BenchmarkRow:
    """The share of the outcomes that pass `test`, with its goal."""
    hits = [test(outcome) for outcome in outcomes]
    if at_most is not None:
        return BenchmarkRow.share(name, hits, "max", at_most)
    return BenchmarkRow.share(name, hits, "min", at_least)


def _values(name: str, outcomes: Sequence[Outcome], highest: float) -> BenchmarkRow:
    """Median and 99th percentile of the error ratios; the goal is on the median."""
    row = _summary(name, "-", [outcome.ratio for outcome in outcomes])
    return replace(row, expected=highest, how="max")


def _summary(name: str, unit: str, values: Sequence[float]) -> BenchmarkRow:
    return BenchmarkRow.of_values(name, unit, [value for value in values if np.isfinite(value)])
