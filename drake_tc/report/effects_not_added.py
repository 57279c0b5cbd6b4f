"""The tables of effects that are not part of the model after, as rows of text."""

from collections.abc import Sequence
from dataclasses import dataclass

from drake_tc.diagnosis.result.joint_result import RejectedEffect
from drake_tc.diagnosis.withdrawal import DidNotHold
from drake_tc.report.numbers import percent
from drake_tc.report.sentences.rejection import why_rejected
from drake_tc.report.words import REASONS, title_of


@dataclass(frozen=True)
class RejectedRow:
    """One effect that was not added."""

    title: str
    id: str
    heldout: str
    why: str


def rejected_rows(rejected: Sequence[RejectedEffect]) -> tuple[Sequence[RejectedRow], Sequence[RejectedRow]]:
    """(tried and not added, could not be looked for in these logs)."""
    tried: list[RejectedRow] = []
    barred: list[RejectedRow] = []
    for r in rejected:
        row = RejectedRow(title_of(r.key), r.id, percent(r.heldout_gain), why_rejected(r))
        (barred if r.obstacle else tried).append(row)
    return tried, barred


@dataclass(frozen=True)
class DidNotHoldRow:
    """One effect that was chosen and did not hold."""

    title: str
    id: str
    reason: str
    why: str


def did_not_hold_rows(effects: Sequence[DidNotHold]) -> Sequence[DidNotHoldRow]:
    """One row an effect, with the reason in a few words and in a sentence."""
    return [DidNotHoldRow(e.title, e.id, *REASONS[e.reason]) for e in effects]
