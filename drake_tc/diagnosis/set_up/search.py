"""Which things in an arm's set-up are wrong: changes one after the other, each the one that explains most.

Small effects are no evidence against a set-up, and a set-up that is wrong makes effects that are not there. It is
therefore looked at first, and only where the declared model leaves much of an effort (`MUCH`), that of the diagnosis as
well as the fast one of `balance`. A set of changes is
found if, on the training runs and on the held-out runs,

- the error of some joint of which much is left falls to at most half (`HALVED`),
- the mean logarithm of all joints' errors falls by at least that of `TOGETHER`, and
- no joint's error grows by more than `GROWS`, unless it is small after it (`SMALL`).

A payload in one training run says nothing of the held-out runs. It is found if two halves of the training rows, fitted
apart, ask for it. A held-out run may carry one too, which is looked for last (`_loaded_held_run`).

Where the links are far from the robot's file, the fast model leaves more than that of the diagnosis. Some joint's error
must therefore also be at most half (`HALVED`) of what the latter leaves.

Fitted links take up most of one wrong drive gain. Another gain of a single joint is therefore tried also where little
is left; of all joints together it need only lower the error. An effect halves no joint's error by another gain.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.set_up.balance import ArmBalance, Balance, SetUp
from drake_tc.diagnosis.set_up.changes import Change, Tried, gains_of_one_joint, payloads, tried_changes
from drake_tc.types import BoolArray, FloatArray

MUCH = 0.1
"""Share of an effort's RMS, left by the declared model, from which the set-up is looked at."""
HALVED = 0.5
TOGETHER = 0.85
GROWS = 1.25
SMALL = 0.03
"""Share of an effort's RMS that is no evidence against a set-up."""
MOST_CHANGES = 4
MOST_ALTERNATIVES = 3
WORTH = 0.9
"""Factor of the mean error that one change more must reach."""
AS_WELL = 1.1
"""Factor of the mean error within which a simpler change is preferred, and another one is told as an alternative."""
UNLIKELY = 16.0
"""|delta/t|^2, twice the logarithm of a probability, by which the links of a preferred change may be further away."""


@dataclass(frozen=True, eq=False)
class SetUpSearch:
    """What the search found.

    Attributes:
        changes: In the order in which they were found; empty where none was.
        set_up: The assumption with all of them.
        alternatives: Other changes that explain as much as the last one.
        before, after: Fits to the training runs.
    """

    changes: tuple[Change, ...]
    set_up: SetUp
    alternatives: tuple[Tried, ...]
    before: Balance
    after: Balance


def search_set_up(train: ArmBalance, held: ArmBalance, left: FloatArray) -> SetUpSearch | None:
    """The changes that both sides ask for; None where the declared set-up leaves little of every effort and no other
    drive gain of one joint is asked for, or where neither the rig file nor the links of the robot's file say how large
    a joint's torques are.

    Args:
        train: Rows of the training runs.
        held: Those of the held-out runs, which take no part in choosing.
        left: (n,) share of each effort that the declared model of the diagnosis leaves. It has all rows, so that it
            also fits links that are far from those of the robot's file.
    """
    start = train.as_declared
    if (start.free & ~train.tells_gain).any():
        return None
    before = train.fit(start)
    if not min(np.nanmax(before.share), np.nanmax(left)) > MUCH:
        return _one_gain(train, held, before, left) or _loaded_held_run(train, held)
    least = replace(before, share=np.where(np.isnan(before.share), np.nan, np.fmin(before.share, left)))
    none = SetUpSearch((), start, (), least, least)
    steps: list[tuple[Tried, tuple[Tried, ...]]] = []
    at, error = start, before.error
    while len(steps) < MOST_CHANGES:
        best, others = _best(tried_changes(train, at))
        if best.balance.error > error + np.log(WORTH):
            break
        steps.append((best, others))
        at, error = best.change.set_up, best.balance.error
        if np.nanmax(best.balance.share) < SMALL:
            break
    if not steps:
        return none
    after, alternatives = steps[-1][0].balance, steps[-1][1]
    changes = tuple(step.change for step, _ in steps)
    much = before.share > MUCH
    found = is_found(before, after, much) and _confirmed(train, held, at, changes, much)
    if not (found and _is_half_of(left, after)):
        return _loaded_held_run(train, held) or none
    return SetUpSearch(changes, at, alternatives, before, after)


def _confirmed(train: ArmBalance, held: ArmBalance, at: SetUp, changes: Sequence[Change], much: BoolArray) -> bool:
    """Whether rows that took no part in choosing, or halves of those that did, ask for the changes too."""
    in_held = set(held.rows.run.tolist())
    of_training = [bool(change.runs) and not in_held.intersection(change.runs) for change in changes]
    sides = [] if all(of_training) else [held]
    sides += _halves(train) if any(of_training) else []
    return all(is_found(side.fit(train.as_declared), side.fit(at), much) for side in sides)


def _halves(arm: ArmBalance) -> list[ArmBalance]:
    return [replace(arm, rows=arm.rows.part(number, 2)) for number in range(2)]


def _loaded_held_run(train: ArmBalance, held: ArmBalance) -> SetUpSearch | None:
    """A payload of one held-out run, or of all training runs; None where there is none. The links are the same."""
    both = replace(train, rows=train.rows.before(held.rows))
    start = both.as_declared
    before = both.fit(start)
    of_training, of_held = (tuple(dict.fromkeys(side.rows.run.tolist())) for side in (train, held))
    groups = [*((name,) for name in of_held), of_training]
    tried = list(payloads(both, start, groups)) if np.nanmax(before.share) > MUCH else []
    if not tried:
        return None
    best = min(tried, key=lambda t: t.balance.error)
    much, at = before.share > MUCH, best.change.set_up
    sides = (both, *_halves(both))
    if not all(is_found(side.fit(start), side.fit(at), much) for side in sides):
        return None
    return SetUpSearch((best.change,), at, (), before, best.balance)


def _one_gain(train: ArmBalance, held: ArmBalance, before: Balance, left: FloatArray) -> SetUpSearch | None:
    """Another drive gain of one joint, where both sides ask for it; `before` is the fit as declared."""
    tried = gains_of_one_joint(train, train.as_declared)
    if not tried:
        return None
    best, others = _best(tried)
    at = best.change.set_up
    known = ~np.isnan(before.share)
    found = is_found(before, best.balance, known, together=1.0)
    found = found and is_found(held.fit(train.as_declared), held.fit(at), known, together=1.0)
    if not (found and _is_half_of(left, best.balance)):
        return None
    return SetUpSearch((best.change,), at, others, before, best.balance)


def _best(tried: Sequence[Tried]) -> tuple[Tried, tuple[Tried, ...]]:
    """The first of those that explain about as much as the best one, and the others that do not contain it.

    Links that are much further from the robot's file than under another one of them are no explanation.
    """
    least = min(t.balance.error for t in tried)
    alike = [t for t in tried if t.balance.error <= least + np.log(AS_WELL)]
    nearest = min(t.balance.departure for t in alike)
    alike = [t for t in alike if t.balance.departure <= nearest + UNLIKELY]
    first = alike[0].change
    others = (t for t in alike[1:] if t.change.kind != first.kind or not set(first.joints) <= set(t.change.joints))
    return alike[0], tuple(others)[:MOST_ALTERNATIVES]


def _is_half_of(left: FloatArray, after: Balance) -> bool:
    return bool(np.nanmin(after.share / left) <= HALVED)


def is_found(before: Balance, after: Balance, much: BoolArray, together: float = TOGETHER) -> bool:
    """Whether the errors of these fits say that the set-up of the second one is right and that of the first wrong.

    Args:
        before: Fit with the first set-up.
        after: Fit to the same rows, with the second one.
        much: (n,) joints of which the declared set-up leaves much.
        together: Factor by which the geometric mean of all joints' errors must fall.
    """
    ratio = after.share / before.share
    grows = (ratio > GROWS) & (after.share > SMALL)
    halved = (ratio[much] <= HALVED).any()
    return bool(halved and after.error <= before.error + np.log(together) and not grows.any())
