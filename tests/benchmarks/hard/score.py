"""Counts of a draw: what was named falsely, what was found where the information is there, intervals that hold."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from tests.benchmarks.hard.oracle import ENOUGH

Document = Mapping[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What the report of one rig says against the truth.

    Attributes:
        named: Ids that the report lists as effects.
        false: Named ids that are neither a cause, nor an equally right answer, nor tolerated.
        asked: Causes that the logs hold the information for.
        found: Those of them that are named, or an equally right answer.
        told: Those of them that are found, or that the report lists as indistinguishable from a named effect.
        covered: Pairs (group, interval holds the truth), group is `declared` or `effects`.
        refused: Message of a rig that was refused, or empty.
    """

    name: str
    drive: str
    load: str
    null: bool
    named: tuple[str, ...]
    false: tuple[str, ...]
    asked: tuple[str, ...]
    found: tuple[str, ...]
    told: tuple[str, ...]
    covered: tuple[tuple[str, bool], ...]
    refused: str
    verdict: str
    seconds: float

    @property
    def exact(self) -> bool:
        """All causes that can be found, and nothing else."""
        return not self.refused and not self.false and len(self.found) == len(self.asked)


def outcome(truth: Document, report: Document) -> Outcome:
    """Compare one report with the truth. A report with `error` is that of a refused rig."""
    joint = next(iter(report.get("joints", {}).values()), {})
    effects = {effect["id"]: effect for effect in joint.get("effects", [])}
    named = sorted(effects)
    right = {cause["id"]: {cause["id"], *cause["allowed"]} for cause in truth["causes"]}
    fine = set(truth.get("tolerated", [])).union(*right.values())
    beside = {i for pair in joint.get("indistinguishable", []) if set(pair) & set(named) for i in pair}
    asked = [cause["id"] for cause in truth["causes"] if cause["oracle_log_odds"] >= ENOUGH]
    return Outcome(
        name=truth["name"],
        drive=truth["drive"],
        load=truth["load"],
        null=truth["null"],
        named=tuple(named),
        false=tuple(sorted(set(named) - fine)),
        asked=tuple(asked),
        found=tuple(cause for cause in asked if right[cause] & set(named)),
        told=tuple(cause for cause in asked if right[cause] & (set(named) | beside)),
        covered=tuple(_coverage(truth, joint, effects)),
        refused=str(report.get("error", "")),
        verdict=str(report.get("verdict", "")),
        seconds=float(report.get("seconds", 0.0)),
    )


def _coverage(truth: Document, joint: Document, effects: Mapping[str, Document]) -> Iterable[tuple[str, bool]]:
    """Intervals whose truth is known. Those of declared parameters are under `final_parameters`."""
    known = truth["declared_parameters"]
    final = joint.get("final_parameters", {})
    for effect, name, truth_name in DECLARED:
        interval = final.get(effect, {}).get(name, {}).get("ci95")
        if truth_name in known and interval is not None:
            yield "declared", _holds(interval, known[truth_name])
    for cause in truth["causes"]:
        parameters = effects.get(cause["id"], {}).get("parameters", {})
        for name, value in cause["parameters"].items():
            interval = parameters.get(name, {}).get("ci95")
            if interval is not None:
                yield "effects", _holds(interval, value)


DECLARED = (("drive", "gain", "drive_gain"), ("viscous", "viscous", "viscous"), ("coulomb", "coulomb", "coulomb"))
"""Effect and parameter in the report, and the name in the truth."""


def _holds(interval: Any, value: float) -> bool:
    return bool(interval[0] <= value <= interval[1])


def outcomes(folder: Path, names: Iterable[str] | None = None) -> list[Outcome]:
    """Of all rigs in `folder` that have a report."""
    found = []
    for path in sorted((folder / "truth").glob("*/truth.json")):
        report = folder / "reports" / path.parent.name / "report.json"
        if report.exists() and (names is None or path.parent.name in set(names)):
            found.append(outcome(_read(path), _read(report)))
    return found


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Row:
    """A share: `hits` of `of`, in a group of rigs."""

    group: str
    name: str
    hits: int
    of: int

    @property
    def share(self) -> float | None:
        """hits / of; None where there is nothing to count."""
        return self.hits / self.of if self.of else None


def rows(results: list[Outcome]) -> list[Row]:
    """All counts: in total, by drive, by load."""
    groups: list[tuple[str, Callable[[Outcome], bool]]] = [("all", lambda _: True)]
    groups += [(f"drive {drive}", lambda r, d=drive: r.drive == d) for drive in sorted({r.drive for r in results})]
    groups += [(f"load {load}", lambda r, x=load: r.load == x) for load in sorted({r.load for r in results})]
    return [row for name, picks in groups for row in _rows(name, [r for r in results if picks(r)])]


SOUND = "no_missing_effect"


def _rows(group: str, results: list[Outcome]) -> list[Row]:
    read = [r for r in results if not r.refused]
    nulls, others = [r for r in read if r.null], [r for r in read if not r.null]
    intervals = {kind: [ok for r in read for k, ok in r.covered if k == kind] for kind in ("declared", "effects")}
    alone = [r for r in others if not r.found]
    return [
        Row(group, "nulls with a false name", sum(bool(r.false) for r in nulls), len(nulls)),
        Row(group, "causes found", sum(len(r.found) for r in others), sum(len(r.asked) for r in others)),
        Row(
            group,
            "causes found or listed as indistinguishable",
            sum(len(r.told) for r in others),
            sum(len(r.asked) for r in others),
        ),
        Row(group, "nulls of which nothing is said to be missing", sum(r.verdict == SOUND for r in nulls), len(nulls)),
        Row(group, "rigs with causes and a false name", sum(bool(r.false) for r in others), len(others)),
        Row(group, "rigs with causes and nothing found", len(alone), len(others)),
        Row(group, "exact sets", sum(r.exact for r in read), len(read)),
        Row(group, "exact sets, rigs with causes", sum(r.exact for r in others), len(others)),
        Row(group, "refused", len(results) - len(read), len(results)),
        *(Row(group, f"intervals that hold, {kind}", sum(ok), len(ok)) for kind, ok in intervals.items()),
    ]


def by_cause(results: list[Outcome]) -> list[Row]:
    """Found and false names, by id."""
    ids = sorted({i for r in results for i in (*r.asked, *r.false)})
    found = [Row(i, "found", sum(i in r.found for r in results), sum(i in r.asked for r in results)) for i in ids]
    false = [Row(i, "false", sum(i in r.false for r in results), len(results)) for i in ids]
    return [row for pair in zip(found, false, strict=True) for row in pair]


def table(results: list[Outcome]) -> Table:
    """The counts for people: one line a count, one column a group."""
    counts = rows(results)
    groups = list(dict.fromkeys(row.group for row in counts))
    shown = Table("count", *groups)
    for name in dict.fromkeys(row.name for row in counts):
        shown.add_row(name, *(f"{row.hits}/{row.of}" for row in counts if row.name == name))
    return shown


def cause_table(results: list[Outcome]) -> Table:
    """Found and false names by id."""
    shown = Table("id", "found", "false names")
    for row, false in zip(*[iter(by_cause(results))] * 2, strict=True):
        shown.add_row(row.group, f"{row.hits}/{row.of}", str(false.hits))
    return shown


def rig_table(results: list[Outcome]) -> Table:
    """One line a rig."""
    shown = Table("rig", "drive", "load", "asked", "named", "false", "verdict", "s")
    for r in results:
        line = (r.name, r.drive, r.load, " ".join(r.asked), " ".join(r.named), " ".join(r.false))
        shown.add_row(*line, r.refused or r.verdict, f"{r.seconds:.0f}")
    return shown
