"""What a diagnosis said of one rig, held against that rig's truth."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drake_tc.blind.spec import BlindError


@dataclass(frozen=True)
class Outcome:
    """One rig's truth and verdict.

    Attributes:
        name, group, kind, strength: As in `RigSpec`.
        truth: Effect ids that the rig lacks; empty for nulls and outside causes.
        named: Effect ids that the report names, in its order.
        ties: Groups of effect ids that the report calls indistinguishable.
        structured: Whether the report says that unexplained structure is left.
        ratio: Held-out error after, over the oracle's; NaN without a report.
        answered: Whether there was a report.
        seconds: That the diagnosis took; NaN without a report.
    """

    name: str
    group: str
    kind: str
    strength: str
    truth: frozenset[str]
    named: tuple[str, ...]
    ties: tuple[frozenset[str], ...]
    structured: bool
    ratio: float
    answered: bool
    seconds: float

    def stands_for(self, said: str, true: str) -> bool:
        """Whether `said` is `true`, or the report itself says that the two cannot be told apart."""
        return said == true or any(said in tie and true in tie for tie in self.ties)

    @property
    def first_right(self) -> bool:
        """Whether the first effect named is one that is missing."""
        return bool(self.named) and any(self.stands_for(self.named[0], true) for true in self.truth)

    @property
    def all_found(self) -> bool:
        """Whether every missing effect is named, each by a name of its own."""
        return self._assigned(sorted(self.truth), list(self.named))

    @property
    def exact(self) -> bool:
        """Whether the missing effects are named, and no other."""
        return self.answered and self.all_found and len(self.named) == len(self.truth)

    def _assigned(self, wanted: list[str], said: list[str]) -> bool:
        if not wanted:
            return True
        matches = [i for i, name in enumerate(said) if self.stands_for(name, wanted[0])]
        return any(self._assigned(wanted[1:], said[:i] + said[i + 1 :]) for i in matches)


def read_outcome(truth_path: Path, report_path: Path) -> Outcome:
    """Read a rig's `truth.json` and its `report.json`.

    A missing report is no answer; neither is one that says why the rig was refused.

    Raises:
        BlindError: A file that is no JSON, or lacks a key of its contract.
    """
    truth = _read(truth_path)
    report = _read(report_path) if report_path.exists() else None
    if report is not None and report.get("error"):
        report = None  # the rig was refused: no answer
    try:
        said = _verdict(report, float(truth["oracle"]["heldout"])) if report is not None else _SILENT
        return Outcome(
            name=truth["name"],
            group=truth["group"],
            kind=truth["kind"],
            strength=truth["strength"],
            truth=frozenset(truth["effects"]),
            answered=report is not None,
            **said,
        )
    except (KeyError, TypeError, IndexError) as error:
        path = truth_path if report is None else f"{truth_path} or {report_path}"
        raise BlindError(f"{path}: key {error} wanted by the contract is missing or of another type") from error


_SILENT: Mapping[str, Any] = {
    "named": (),
    "ties": (),
    "structured": False,
    "ratio": float("nan"),
    "seconds": float("nan"),
}


def _verdict(report: Mapping[str, Any], oracle: float) -> dict[str, Any]:
    joint = next(iter(report["joints"].values()))
    shared = [cause["id"] for cause in report.get("shared", [])]
    unexplained = joint.get("unexplained") or {}
    after = joint["error"]["after"]["heldout"]
    return {
        "named": tuple([effect["id"] for effect in joint["effects"]] + shared),
        "ties": tuple(frozenset(tie) for tie in joint.get("indistinguishable", [])),
        "structured": bool(unexplained.get("structured")) or report["verdict"] == "unexplained_structure",
        "ratio": float("nan") if after is None else float(after) / oracle,
        "seconds": float(report.get("seconds", float("nan"))),
    }


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except (OSError, json.JSONDecodeError) as error:
        raise BlindError(f"{path}: wanted a JSON file; {error}") from error
