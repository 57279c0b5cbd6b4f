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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.result.rig_result import SetUpCheck, SetUpError
from drake_tc.diagnosis.set_up.balance import ArmBalance, Balance, SetUp, set_up_rows
from drake_tc.diagnosis.set_up.changes import Change, Tried, gains_of_one_joint, payloads, tried_changes
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.rigid_regressor import LinkModel
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
KNOWN = 0.1
"""Standard deviation of a link's mass, as a share of it, where the links are taken as the robot's file says."""


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


def check_set_up(
    logs: RobotLogs,
    links: LinkModel,
    train: Sequence[Run],
    held: Sequence[Run],
    rig: Rig,
    left: Mapping[str, float],
) -> SetUpCheck | None:
    """What the runs say against the set-up; None where the declared model leaves little of every joint's effort."""
    names = logs.robot.joints
    load = next(iter(rig.load.values()))
    if not isinstance(load, RobotLoad):
        return None
    fitted = load.fitted
    tolerance = links.deviations(load.tolerance if fitted else KNOWN)
    gain = np.array([rig.drive_gain.get(joint, np.nan) for joint in names])
    own = np.array([rig.drive.get(joint) != "position_servo" for joint in names])
    rows = [set_up_rows(logs, runs, rig) for runs in (train, held)]
    carrier = _carrier(links, load)
    loaded = tuple((name,) for name in load.payload)
    every = () if fitted else tuple(run.name for run in (*train, *held))
    training = ArmBalance(links, rows[0], tolerance, gain, own, logs.turns, carrier, loaded, every)
    heldout = replace(training, rows=rows[1])
    found = search_set_up(training, heldout, np.array([left[joint] for joint in names]))
    if found is None:
        return None

    def error(change: Change, balance: Balance, set_up: SetUp) -> SetUpError:
        gains = dict(zip(names, zip(balance.gain, gain, strict=True), strict=True))
        made = _error(change, set_up, names, rig, gains)
        if carrier is None or change.kind != "payload":
            return made
        return replace(
            made,
            mass=float(balance.loads[set_up.loaded.index(change.runs), 0]),
            carrier=links.tree.links[carrier],
            runs=() if change.runs == every else change.runs,
            links_fitted=fitted,
            held_out=change.runs != every and {run.name for run in held}.issuperset(change.runs),
        )

    return SetUpCheck(
        errors=tuple(error(change, found.after, found.set_up) for change in found.changes),
        alternatives=tuple(error(t.change, t.balance, t.change.set_up) for t in found.alternatives),
        before=_by_joint(found.before.share, names),
        after=_by_joint(found.after.share, names),
    )


def _carrier(links: LinkModel, load: RobotLoad) -> int | None:
    """Number of the link that may carry something: the one of the rig file, or the only outermost one."""
    if not load.carrier and len(links.outermost) > 1:
        return None
    return links.tree.links.index(load.carrier or links.outermost[0])


def _by_joint(values: FloatArray, names: Sequence[str]) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True) if np.isfinite(value)}


def _error(
    change: Change, set_up: SetUp, names: Sequence[str], rig: Rig, gains: Mapping[str, tuple[float, float]]
) -> SetUpError:
    """What a change says of the files; `set_up` is the assumption with all changes, `gains` are fitted and declared."""
    joints = tuple(names[j] for j in change.joints)
    direction = set_up.gravity / np.linalg.norm(set_up.gravity)
    zero = sum(float(set_up.turned[j] * set_up.zero[j]) for j in change.joints) if change.kind == "zero" else 0.0
    return SetUpError(
        kind=change.kind,
        joints=joints,
        units=_units(change, joints, rig),
        gains={j: (float(gains[j][0]), float(gains[j][1])) for j in joints} if change.kind == "drive_gain" else {},
        zero=zero,
        gravity=(float(direction[0]), float(direction[1]), float(direction[2])),
        turns=float(set_up.turns[change.joints]) if change.kind == "coupled" and set_up.turns is not None else 0.0,
    )


def _units(change: Change, joints: Sequence[str], rig: Rig) -> dict[str, str | float]:
    """Entries of `units` with the other sign."""
    turned = change.kind in ("joint_reversed", "position_reversed")
    driven = change.kind in ("joint_reversed", "effort_reversed")
    found: dict[str, str | float] = {}
    for joint in joints:
        command = rig.command_column(joint)
        if turned:
            found[f"{joint}/position"] = rig.opposite_unit(f"{joint}/position", rig.units_of(joint).position)
        if driven:
            found[command] = rig.opposite_unit(command, rig.units_of(joint).effort)
    return found
