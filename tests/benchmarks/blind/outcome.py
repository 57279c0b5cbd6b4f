"""What a diagnosis said of one rig, held against that rig's truth."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drake_tc.joint_simulator.spec import BlindError
from tests.benchmarks.blind.verdicts import NOTHING, OUTSIDE, RESIDUAL, RIGHT_VERDICTS, STRUCTURE

UNTESTED = frozenset({"untested", "not_recorded", "not_excited"})
"""Each `reason` by which a report says that the logs do not test an effect."""


@dataclass(frozen=True)
class Outcome:
    """One rig's truth and verdict.

    Attributes:
        name, group, kind, strength: As in `RigSpec`.
        truth: Effect ids that the rig lacks; empty for nulls and outside causes.
        named: Effect ids that the report names, in its order.
        indistinguishable: Groups of effect ids that the report calls indistinguishable.
        verdict: Of the report; empty without one.
        ratio: Held-out error after, over the oracle's; NaN without a report.
        answered: Whether there was a report.
        seconds: That the diagnosis took; NaN without a report.
        right_verdicts: Verdicts that are right for the rig.
        acts: Whether the missing effects act in the training runs.
        did_not_hold: Effect ids that the report says did not hold.
        untested: Effect ids of which the report says that the logs do not test them.
        floors: What is left on the held-out runs, in noise floors; NaN where the report does not say.
        refusal: Why the rig was refused; empty where it was not.
    """

    name: str
    group: str
    kind: str
    strength: str
    truth: frozenset[str]
    named: tuple[str, ...]
    indistinguishable: tuple[frozenset[str], ...]
    verdict: str
    ratio: float
    answered: bool
    seconds: float
    right_verdicts: frozenset[str] = frozenset()
    acts: bool = True
    did_not_hold: tuple[str, ...] = ()
    untested: frozenset[str] = frozenset()
    floors: float = float("nan")
    refusal: str = ""

    @property
    def structured(self) -> bool:
        """Whether the verdict is that unexplained structure is left."""
        return self.verdict == STRUCTURE

    @property
    def flagged(self) -> bool:
        """Whether the verdict is that something is left that the model does not explain, of either kind."""
        return self.verdict in (STRUCTURE, RESIDUAL)

    @property
    def flagged_rightly(self) -> bool:
        """Whether it is flagged by a verdict that is right for this rig."""
        return self.flagged and self.verdict in self.right_verdicts

    @property
    def false_alarm(self) -> bool:
        """Whether a rig that lacks nothing is said to lack something, or is not answered.

        Any effect named is an alarm, and so is a verdict of structure or residual that is not right for the rig.
        """
        return bool(self.named) or not self.answered or (self.flagged and not self.flagged_rightly)

    @property
    def right(self) -> bool:
        """Whether the answer is right as a whole, by the rule of the rig's group."""
        if self.group == "outside":
            return self.flagged_rightly
        if self.group == "null":
            return not self.false_alarm
        return self.exact if self.acts else self.said_untested

    @property
    def said_untested(self) -> bool:
        """Whether the report says of every missing effect that the logs do not test it, or names it all the same.

        As elsewhere, an effect that it cannot tell from the missing one stands for it.
        """
        return self.answered and all(
            effect in self.untested or any(self.stands_for(name, effect) for name in self.named)
            for effect in self.truth
        )

    def stands_for(self, said: str, true: str) -> bool:
        """Whether `said` is `true`, or the report itself says that the two cannot be told apart."""
        return said == true or any(said in tie and true in tie for tie in self.indistinguishable)

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

    def _assigned(self, expected: list[str], said: list[str]) -> bool:
        if not expected:
            return True
        matches = [i for i, name in enumerate(said) if self.stands_for(name, expected[0])]
        return any(self._assigned(expected[1:], said[:i] + said[i + 1 :]) for i in matches)


def read_outcome(truth_path: Path, report_path: Path) -> Outcome:
    """Read a rig's `truth.json` and its `report.json`.

    A missing report is no answer; neither is one without joints, or one that says why the rig was refused.

    Raises:
        BlindError: A file that is no JSON, or lacks a key of its contract.
    """
    truth = _read(truth_path)
    report = _read(report_path) if report_path.exists() else None
    refusal = ""
    if report is not None and (report.get("error") or report.get("joints") == {}):
        refusal, report = str(report.get("error") or "the report has no joint"), None
    try:
        said = _verdict(report, float(truth["oracle"]["heldout"])) if report is not None else _SILENT
        return Outcome(
            name=truth["name"],
            group=truth["group"],
            kind=truth["kind"],
            strength=truth["strength"],
            truth=frozenset(truth["effects"]),
            answered=report is not None,
            right_verdicts=_right_verdicts(truth),
            acts=bool(truth.get("acts_in_training", True)) or truth["group"] != "single",
            refusal=refusal,
            **said,
        )
    except (KeyError, TypeError, IndexError) as error:
        path = truth_path if report is None else f"{truth_path} or {report_path}"
        raise BlindError(f"{path}: key {error} of the contract is missing or has another type") from error


def _right_verdicts(truth: Mapping[str, Any]) -> frozenset[str]:
    """Those of the truth; for a truth that was written without them, those of its group."""
    if "right_verdicts" in truth:
        return frozenset(truth["right_verdicts"])
    if truth["group"] == "outside":
        return frozenset(RIGHT_VERDICTS[truth["kind"]] if truth["kind"] in OUTSIDE else (STRUCTURE, RESIDUAL))
    return frozenset((NOTHING,) if truth["group"] == "null" else ("effects_found",))


_SILENT: Mapping[str, Any] = {
    "named": (),
    "indistinguishable": (),
    "verdict": "",
    "ratio": float("nan"),
    "seconds": float("nan"),
}


def _verdict(report: Mapping[str, Any], oracle: float) -> dict[str, Any]:
    joint = next(iter(report["joints"].values()))
    shared = [cause["id"] for cause in report.get("shared", [])]
    unexplained = joint.get("unexplained") or {}
    after, floors = joint["error"]["after"]["heldout"], unexplained.get("floors")
    verdict = str(report["verdict"])
    if unexplained.get("structured") and verdict != RESIDUAL:
        verdict = STRUCTURE  # reports whose verdict did not yet say so
    return {
        "named": tuple([effect["id"] for effect in joint["effects"]] + shared),
        "indistinguishable": tuple(frozenset(tie) for tie in joint.get("indistinguishable", [])),
        "verdict": verdict,
        "ratio": float("nan") if after is None else float(after) / oracle,
        "seconds": float(report.get("seconds", float("nan"))),
        "did_not_hold": tuple(entry["id"] for entry in joint.get("did_not_hold", [])),
        "untested": _untested(joint),
        "floors": float("nan") if floors is None else float(floors),
    }


def _untested(joint: Mapping[str, Any]) -> frozenset[str]:
    """Effects of which the report says that the logs do not test them: `untested`, or the `reason` of an entry.

    Reasons are words of their own; what the report says in sentences is not read.
    """
    said = [entry if isinstance(entry, str) else entry["id"] for entry in joint.get("untested", [])]
    entries = [*joint.get("rejected", []), *joint.get("did_not_hold", [])]
    return frozenset([*said, *(e["id"] for e in entries if e.get("reason") in UNTESTED)])


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except (OSError, json.JSONDecodeError) as error:
        raise BlindError(f"{path}: expected a JSON file; {error}") from error
