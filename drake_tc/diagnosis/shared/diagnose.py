"""`close-loop` of a rig whose loads come from a robot's model: shared causes first, then each joint's own.

1. All joints together, with the declared models: which causes that no single joint owns are missing (`selection`).
2. Each joint by itself, on loads without them (`diagnose_joint`).
3. The rival: no shared cause, each joint left to explain its own part. It stands when all joints together fit
   better that way.
4. The shared causes anew, beside the effects that the joints were found to have: those no longer real go.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.diagnosis.close_loop import DiagnosisOptions, diagnose_joint
from drake_tc.diagnosis.design import Columns, Term
from drake_tc.diagnosis.evidence import effective_samples
from drake_tc.diagnosis.prepared import Prepared, prepare_joint
from drake_tc.diagnosis.result import JointResult, SharedEffect
from drake_tc.diagnosis.search import Progress, Search, candidates, search
from drake_tc.diagnosis.shared.causes import CauseColumns, columns_over
from drake_tc.diagnosis.shared.correction import corrected
from drake_tc.diagnosis.shared.outcome import original_baseline, shared_effects
from drake_tc.diagnosis.shared.selection import SharedOptions, SharedSearch, select
from drake_tc.diagnosis.shared.stacked import StackedFit, stack
from drake_tc.effects.library import LIBRARY
from drake_tc.estimation.robot_loads import RobotLogs, with_robot_loads
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig


@dataclass(frozen=True)
class RobotResult:
    """What was found on a robot.

    Attributes:
        joints: By name; errors and models "before" are those of the loads as the robot's model gives them.
        shared: Causes that no single joint owns.
        held: Held-out runs with loads as the robot's model gives them.
        held_after: The same without the shared causes.
    """

    joints: Mapping[str, JointResult]
    shared: tuple[SharedEffect, ...]
    held: Sequence[Run] = field(default=())
    held_after: Sequence[Run] = field(default=())


LEAST_REMOVED = 1.0
"""Noise floors that a joint's own effect must explain here: the floor knows the sensors' noise, but not what the
filters do to an estimated load near reversals, which is about as large."""


@dataclass(frozen=True, eq=False)
class _Case:
    """A robot's runs, and how to diagnose its joints."""

    train: Sequence[Run]
    held: Sequence[Run]
    rig: Rig
    causes: CauseColumns
    options: DiagnosisOptions
    progress: Progress
    executor: Executor | None

    def without(self, fitted: StackedFit) -> tuple[list[Run], list[Run]]:
        """Both sides' runs without the fit's causes."""
        joints = self.rig.joints
        sides = (corrected(runs, self.causes, joints, fitted.columns, fitted.delta) for runs in (self.train, self.held))
        train, held = sides
        return train, held

    def diagnose(self, train: Sequence[Run], held: Sequence[Run], joints: Sequence[str]) -> dict[str, JointResult]:
        """Each of the joints by itself, beside each other where there are processes."""
        arguments = [(train, held, self.rig, joint, self.options) for joint in joints]
        if self.executor is None:
            made = []
            for number, each in enumerate(arguments):
                self.progress(each[3], number / len(arguments))
                made.append(_one(*each))
        else:
            futures = [self.executor.submit(_one, *each) for each in arguments]
            made = []
            for number, (joint, future) in enumerate(zip(joints, futures, strict=True)):
                self.progress(joint, number / len(arguments))
                made.append(future.result())
        return dict(zip(joints, made, strict=True))


def _one(train: Sequence[Run], held: Sequence[Run], rig: Rig, joint: str, options: DiagnosisOptions) -> JointResult:
    with threadpool_limits(1):
        return diagnose_joint(train, held, rig, joint, options)


def diagnose_robot(
    logs: RobotLogs,
    train_runs: Sequence[Run],
    held_runs: Sequence[Run],
    rig: Rig,
    options: DiagnosisOptions,
    shared_options: SharedOptions | None = None,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
) -> RobotResult:
    """Diagnose a robot. The held-out runs are looked at only after every choice is made.

    Args:
        logs: The robot's model.
        train_runs: As recorded, to fit.
        held_runs: As recorded, to judge by.
        rig: With a `RobotLoad`.
        options: Of the joints' own diagnosis.
        shared_options: Of the shared causes; None: the calibrated ones.
        progress: Told how far it is.
        executor: Diagnoses joints beside each other; None: one after the other, here.

    Raises:
        LogError: a sensor is missing, or a log too short.
        IdentificationError: a joint whose runs cannot identify even the declared model.
    """
    progress("the robot's torques", 0.0)
    train = with_robot_loads(logs, train_runs, rig.joints)
    held = with_robot_loads(logs, held_runs, rig.joints)
    progress("what all joints share", 0.0)
    least = max(options.search.least_removed, LEAST_REMOVED)
    options = replace(options, search=replace(options.search, least_removed=least))
    case = _Case(train, held, rig, columns_over(logs, [*train, *held]), options, progress, executor)
    prepared = {joint: prepare_joint(train, held, rig, joint) for joint in rig.joints}
    thresholds = shared_options or SharedOptions()
    found = _search(case, prepared, thresholds)
    if not found.chosen:
        return RobotResult(case.diagnose(train, held, rig.joints), (), held, held)
    after = case.without(found.fit)
    touched = _touched(found, rig.joints)
    if _evidence(case, prepared, after, touched, found) <= 0.0:
        return RobotResult(case.diagnose(train, held, rig.joints), (), held, held)
    return _settled(case, prepared, found, case.diagnose(*after, rig.joints), thresholds)


def _search(case: _Case, prepared: Mapping[str, Prepared], options: SharedOptions) -> SharedSearch:
    rows = stack(
        {joint: p.train for joint, p in prepared.items()}, {j: p.terms for j, p in prepared.items()}, case.causes
    )
    floor = np.array([p.floor for p in prepared.values()])
    return select(rows, case.causes.causes, floor, options)


def _touched(found: SharedSearch, joints: Sequence[str]) -> list[str]:
    """Joints whose error the shared causes change noticeably."""
    change = np.abs(np.log(found.fit.cv_rms / found.baseline.cv_rms))
    return [joint for joint, each in zip(joints, change, strict=True) if each > 0.01]


def _evidence(
    case: _Case,
    prepared: Mapping[str, Prepared],
    after: tuple[Sequence[Run], Sequence[Run]],
    joints: Sequence[str],
    found: SharedSearch,
) -> float:
    """Nats for the shared causes against joints that explain their part alone, parameters paid."""
    nats, rows, size = 0.0, 0.0, found.fit.delta.size
    for joint in joints:
        case.progress(f"{joint}: alone or shared", 0.0)
        alone = _own_search(case, prepared[joint])
        mended = prepare_joint(*after, case.rig, joint)
        mine = _own_search(case, mended)
        count = effective_samples(mine.chosen.residual, mended.train.samples)
        errors = [_own_error(alone, prepared[joint]), _own_error(mine, mended)]
        nats += count * float(np.log(errors[0] / errors[1]))
        rows += count
        size += mine.chosen.size - alone.chosen.size
    return nats - 0.5 * size * float(np.log(max(rows, 2.0)))


def _own_error(found: Search, prepared: Prepared) -> float:
    """Cross-validated RMS [effort], by the drive gain of the fit itself: see `StackedFit.cv_rms`."""
    return found.chosen.cv_rms / (prepared.train.gain or 1.0) * found.chosen.gain


def _own_search(case: _Case, prepared: Prepared) -> Search:
    """What one joint's own effects make of its loads."""
    usable, _ = candidates(LIBRARY, prepared.context, prepared.declared)
    return search(prepared.train, prepared.terms, usable, prepared.context, prepared.floor, case.options.search)


def _settled(
    case: _Case,
    prepared: Mapping[str, Prepared],
    found: SharedSearch,
    joints: Mapping[str, JointResult],
    options: SharedOptions,
) -> RobotResult:
    """Causes and coefficients beside the joints' own effects; joints that have some are diagnosed anew on such loads.

    A cause that is no longer real beside them was their imperfect form, and goes.
    """
    own = [joint for joint, result in joints.items() if result.effects]
    made = dict(joints)
    fitted = found.fit
    if own:
        rows = stack(_columns(prepared, made), _terms(made), case.causes)
        floor = np.array([p.floor for p in prepared.values()])
        found = select(rows, found.chosen, floor, options)
        if not found.chosen:
            return RobotResult(case.diagnose(case.train, case.held, case.rig.joints), (), case.held, case.held)
        fitted = found.fit
        made |= case.diagnose(*case.without(fitted), own)
    after = case.without(fitted)
    shared = shared_effects(prepared, _terms(made), case.causes, found)
    results = {joint: original_baseline(made[joint], prepared[joint]) for joint in case.rig.joints}
    return RobotResult(results, shared, case.held, after[1])


def _terms(joints: Mapping[str, JointResult]) -> dict[str, Sequence[Term]]:
    return {joint: result.final.terms for joint, result in joints.items()}


def _columns(prepared: Mapping[str, Prepared], joints: Mapping[str, JointResult]) -> dict[str, Columns]:
    return {joint: prepared[joint].train for joint in joints}
