"""An arm's set-up held against its logs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from drake_tc.diagnosis.result.set_up import SetUpCheck, SetUpError
from drake_tc.diagnosis.set_up.balance import ArmBalance, Balance, SetUp
from drake_tc.diagnosis.set_up.changes import Change
from drake_tc.diagnosis.set_up.rows import set_up_rows
from drake_tc.diagnosis.set_up.search import search_set_up
from drake_tc.estimation.robot_loads import RobotLogs
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.link_parameters import LinkModel
from drake_tc.types import FloatArray

KNOWN = 0.1
"""Standard deviation of a link's mass, as a share of it, where the links are taken as the robot's file says."""


def check_set_up(
    logs: RobotLogs,
    links: LinkModel,
    train: Sequence[Run],
    held: Sequence[Run],
    rig: Rig,
    left: Mapping[str, float],
) -> SetUpCheck | None:
    """What the runs say against the set-up; None where the declared model leaves little of every joint's effort.

    Args:
        logs: The robot.
        links: Of its file.
        train: Runs to fit.
        held: Held-out runs, which confirm what was found.
        rig: With a `RobotLoad`.
        left: By joint, share of the effort that the declared model of the diagnosis leaves.
    """
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
