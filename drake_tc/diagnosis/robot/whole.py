"""A robot from its runs to its result: every joint's own search, beside what the joints share.

1. All joints together with their declared models: which causes that no single joint owns are missing, and how large
   everything is that they share (links that are fitted, errors of sensors within tolerance, the causes).
2. Each joint's own search on these loads, beside what the other joints know of the shared parameters (`joints`); until
   the joints' sets stay the same.
3. The causes once more, beside the joints' effects. A cause stands if all joints together are more probable with it
   than without it, each joint with the set that it needs then, and if it lowers the error of the held-out runs.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.priors import FALLS, HELD_FROM_PERIOD, NAMED_FLOORS
from drake_tc.diagnosis.result.rig_result import SetUpCheck, is_wrong
from drake_tc.diagnosis.robot.causes import Causes, Named, in_time, most_probable, with_encoders
from drake_tc.diagnosis.robot.joints import RobotFit, RobotJoint, Shared, declared_fit, searched_fit, tempered
from drake_tc.diagnosis.robot.runs import ALL_JOINTS, RobotRuns
from drake_tc.diagnosis.robot.told import RobotResult, robot_result
from drake_tc.diagnosis.search import Progress
from drake_tc.diagnosis.set_up.search import check_set_up
from drake_tc.diagnosis.shared.causes import Cause
from drake_tc.diagnosis.shared.columns_of_runs import columns_over
from drake_tc.diagnosis.shared.timing import momenta_over
from drake_tc.estimation.robot_loads import RobotLogs, motor_turns, with_robot_loads
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.robot.rigid_regressor import link_model
from drake_tc.types import FloatArray

PASSES = 4
"""Of choosing causes under the noise that the last ones leave."""
SWEEPS = 3
"""Of searching all joints beside what the others know."""
MOVES = 4
"""Of a late encoder's readings, at most: its delay is known better once they have been moved."""
OFFSETS = 2
"""How often the columns of an encoder's zero are computed anew at the zero that was found."""
SETTLED = 0.02
"""Share of a delay or an offset that is left, below which it is known well enough."""


def diagnose_robot(
    logs: RobotLogs,
    train_runs: Sequence[Run],
    held_runs: Sequence[Run],
    rig: Rig,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> RobotResult:
    """Diagnose a robot. The held-out runs are looked at only after every choice is made.

    Args:
        logs: The robot's model.
        train_runs: As recorded, to fit.
        held_runs: Held-out runs as recorded.
        rig: With a `RobotLoad`.
        options: Of the diagnosis.
        progress: Told how far it is.
        executor: Assesses what is left in its workers; None does it here.

    Raises:
        LogError: a sensor is missing, or a log too short.
        IdentificationError: a joint whose runs cannot identify even the declared model.
    """
    progress("the robot's torques", 0.0)
    train = with_robot_loads(logs, train_runs, rig.joints)
    held = with_robot_loads(logs, held_runs, rig.joints)
    progress("what all joints share", 0.0)
    before = declared_robot(logs, train, held, rig, options, progress)
    set_up = _set_up(logs, before)
    if is_wrong(set_up):
        none = replace(before.runs, options=replace(before.runs.options, effects=(), assess_residual=False))
        fit = searched(replace(before, runs=none))
        return robot_result(logs, before, fit, Named.none(), Causes.of(before), set_up, executor)
    answer = _answer(logs, before)
    return robot_result(logs, before, answer.fit, answer.named, answer.causes, set_up, executor, answer.moved)


def declared_robot(
    logs: RobotLogs,
    train: Sequence[Run],
    held: Sequence[Run],
    rig: Rig,
    options: DiagnosisOptions,
    progress: Progress = lambda text, share: None,
) -> RobotFit:
    """All joints with their declared models, and fitted links where there are some, on runs with loads."""
    turns = None if logs.turns is None else motor_turns(rig.coupled, rig.joints)
    momenta = None if logs.links is None else momenta_over(logs, logs.links, (train, held), rig)
    scaled = rig if logs.links is None else _with_unit(rig)
    causes = columns_over(logs, [*train, *held], rig)
    return _with_hold(RobotRuns(train, held, scaled, causes, options, progress, turns, momenta))


def _with_unit(rig: Rig) -> Rig:
    """The rig whose drives in torque have the gain 1 where none is declared: fitted links leave the unit open."""
    unit = {joint: 1.0 for joint in rig.joints if rig.drive[joint] == "torque"}
    return replace(rig, drive_gain=unit | dict(rig.drive_gain))


@dataclass(frozen=True, eq=False)
class _Answer:
    """All joints after their searches, the causes, and by how much the readings of an encoder were moved [s]."""

    fit: RobotFit
    causes: Causes
    named: Named
    moved: float = 0.0


def _answer(logs: RobotLogs, before: RobotFit) -> _Answer:
    """The causes beside the sets of the joints; none where the joints alone are more probable."""
    start = _again(with_encoders(logs, before), before)
    fit, causes, named = with_causes(start, Causes.of(start))
    moved, late = 0.0, [c for c in named.causes if _is_encoder(c)]
    for _ in range(MOVES if late else 0):
        left = float(fit.moved()[_same(causes, late[0]).columns][0])
        if abs(left) < SETTLED * moved:
            break
        moved += left
        fit, causes, named = _in_time(logs, fit, late[0], moved)
    for _ in range(OFFSETS if any(c.id == "encoder_offset" for c in named.causes) else 0):
        fit, causes, named = _at_offsets(logs, fit, named)
    fit = searched(fit)
    again = most_probable(tempered(fit), causes)
    if _keys(again) != _keys(named):
        fit, named = searched(replace(fit, shared=causes.shared(again.causes))), again
    worse = [c for c in named.causes if not _is_encoder(c) and _falls(fit, causes, named, c) > FALLS]
    if worse:
        named = replace(named, causes=tuple(c for c in named.causes if c not in worse))
        fit = searched(replace(fit, shared=causes.shared(named.causes)))
    if not named.causes:
        return _Answer(fit, causes, named, moved)
    alone = _alone(start, fit, causes, named)
    with_named = fit.log_odds + causes.prior_odds(named.causes)
    if alone.log_odds * fit.rows >= with_named * alone.rows:
        return _Answer(alone, causes, Named.none())
    return _Answer(fit, causes, named, moved)


def _alone(start: RobotFit, fit: RobotFit, causes: Causes, named: Named) -> RobotFit:
    """The joints without the causes: those that a cause touches explain their part by effects of their own."""
    delta = fit.moved()
    touched = np.max([causes.sizes(c, delta) for c in named.causes], axis=0) >= NAMED_FLOORS
    names = [
        name for name, each in zip(fit.joints, touched, strict=True) if each or any(map(_is_encoder, named.causes))
    ]
    others = {name: joint for name, joint in fit.joints.items() if name not in names}
    return searched(replace(start, joints=dict(start.joints) | others), names) if names else start


def _falls(fit: RobotFit, causes: Causes, named: Named, cause: Cause) -> float:
    """Log predictive density of all held-out rows without a cause less that with it."""
    rest = causes.shared(_rest(named, cause))
    return fit.predictive(rest) - fit.predictive(causes.shared(named.causes))


def _same(causes: Causes, cause: Cause) -> Cause:
    """The cause of this name, whose columns may be at another place."""
    return next(c for c in causes.causes if c.key == cause.key)


def _keys(named: Named) -> frozenset[str]:
    return frozenset(c.key for c in named.causes)


def _rest(named: Named, cause: Cause) -> list[Cause]:
    return [c for c in named.causes if c is not cause]


def _is_encoder(cause: Cause) -> bool:
    return cause.id == "delay" and cause.where != ALL_JOINTS


def without_causes(runs: RobotRuns) -> RobotFit:
    """All joints with their declared models and errors within tolerance, links that are fitted among them."""
    nobody = Shared.within_tolerance(runs.every_cause)
    fit = declared_fit(runs, nobody, np.zeros(runs.width), tempered=True)
    for _ in range(PASSES if nobody.places.size else 0):
        fit = declared_fit(runs, nobody, fit.moved(), fit, tempered=True)
    return fit


def _again(runs: RobotRuns, before: RobotFit) -> RobotFit:
    """The same fit with further causes among the columns of its runs."""
    if runs is before.runs:
        return before
    delta = np.zeros(runs.width)
    delta[: before.runs.width - 1] = before.moved()[:-1]
    nobody = Shared.within_tolerance(runs.every_cause)
    first = declared_fit(runs, nobody, delta, tempered=True)
    return declared_fit(runs, nobody, delta, first, tempered=True)


def _with_hold(runs: RobotRuns) -> RobotFit:
    """The declared fit with commands of servos that hold or not, for all joints alike, whichever is more probable."""
    servos = "position_servo" in runs.rig.drive.values()
    if not servos or runs.rig.command_hold is not None or runs.train[0].period < HELD_FROM_PERIOD:
        return without_causes(runs)
    tried = []
    for hold in (True, False):
        fit = without_causes(replace(runs, options=replace(runs.options, command_held=hold)))
        tried.append((declared_fit(fit.runs, fit.shared, fit.moved(), fit).log_odds, fit))
    return max(tried, key=lambda pair: pair[0])[1]


def with_causes(before: RobotFit, causes: Causes) -> tuple[RobotFit, Causes, Named]:
    """The most probable causes beside the declared models, each pass under what the last ones leave.

    Rows count alike, as many of them as what is left has independent ones: a whitened residual trusts the fastest parts
    of a log, in which filters, clocks and sensors are worst, and causes that scale all torques together differ by next
    to nothing else. Where so few rows name nothing, the whitened residual may, and is asked again in this way.
    """
    named, fit = most_probable(before, causes), before
    if not named.causes:
        heard = declared_fit(fit.runs, fit.shared, fit.moved(), fit)
        named = most_probable(heard, causes)
    for _ in range(PASSES if named.causes else 0):
        shared = replace(fit, shared=causes.shared(named.causes))
        fit = declared_fit(shared.runs, shared.shared, shared.moved(), shared, tempered=True)
        again = most_probable(fit, causes)
        if _keys(again) == _keys(named):
            return fit, causes, again
        named = again
    return replace(fit, shared=causes.shared(named.causes)), causes, named


def _in_time(logs: RobotLogs, fit: RobotFit, late: Cause, delay: float) -> tuple[RobotFit, Causes, Named]:
    """The declared models on runs in which an encoder's readings are moved, and what is left of its delay."""
    runs = fit.runs
    first = runs.unmoved or (runs.train, runs.held)
    train, held = (with_robot_loads(logs, in_time(r, late.where, delay), runs.rig.joints) for r in first)
    causes = columns_over(logs, [*train, *held], runs.rig)
    moved = without_causes(replace(runs, train=train, held=held, causes=causes, unmoved=first))
    start = _again(with_encoders(logs, moved), moved)
    known = Causes.of(start)
    same = _same(known, late)
    shared = replace(start, shared=known.shared([same]))
    return declared_fit(shared.runs, shared.shared, shared.moved(), shared), known, Named((same,), {})


def _at_offsets(logs: RobotLogs, fit: RobotFit, named: Named) -> tuple[RobotFit, Causes, Named]:
    """The same with the columns of encoders' zeros at the offsets that were found."""
    delta, runs = fit.moved(), fit.runs
    offsets = {c.where: float(delta[c.columns][0]) for c in named.causes if c.id == "encoder_offset"}
    made = replace(runs, causes=columns_over(logs, [*runs.train, *runs.held], runs.rig, offsets))
    again = declared_fit(made, fit.shared, delta, fit)
    causes = Causes.of(again)
    chosen = tuple(c for c in causes.causes if c.key in _keys(named))
    return again, causes, replace(named, causes=chosen)


def searched(fit: RobotFit, names: Sequence[str] = ()) -> RobotFit:
    """All joints, or these, with the sets of effects that they lack."""
    for _ in range(SWEEPS):
        delta = fit.moved()
        left = [name for name in names or fit.joints if _is_open(fit.joints[name], delta)]
        if not left:
            break
        fit = searched_fit(fit, delta, left)
    return fit


def _is_open(joint: RobotJoint, delta: FloatArray) -> bool:
    """Whether a joint was not searched, or on a load that misses one by which an effect could be named."""
    return joint.decision is None or joint.moved_floors(delta) >= NAMED_FLOORS


def _set_up(logs: RobotLogs, before: RobotFit) -> SetUpCheck | None:
    """What the runs say against the set-up; None where this is not looked at or little of every effort is left."""
    links, runs = logs.links, before.runs
    if links is None:
        if not logs.robot.fixed_base or logs.reads_imu or logs.robot.force_torque:
            return None
        links = link_model(logs.robot)
    left = {name: _share_left(before, name) for name in before.joints}
    return check_set_up(logs, links, runs.train, runs.held, runs.rig, left)


def _share_left(fit: RobotFit, name: str) -> float:
    joint = fit.joints[name]
    train = joint.evidence.model.train
    spread = float(np.std(train.recorded.effort(())))
    return rms(joint.evidence.residual(train, joint.best)) / max(spread, 1e-300)
