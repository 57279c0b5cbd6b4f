"""`close-loop` from logs to result: every joint of a rig, one after the other or in processes."""

import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from threadpoolctl import threadpool_limits

from drake_tc.diagnosis.diagnose import diagnose_joint
from drake_tc.diagnosis.notes import LoadInAllRuns
from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.problem.prepared import without_errors
from drake_tc.diagnosis.refinement import refine_joint
from drake_tc.diagnosis.residual.remainder import remainder_of
from drake_tc.diagnosis.residual.unexplained import SEVERITY, Verdict
from drake_tc.diagnosis.result.errors import FreeRun, with_free_runs
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.links import FittedLinks
from drake_tc.diagnosis.result.rig_result import CloseLoopResult, SetUpCheck, SharedEffect, is_wrong
from drake_tc.diagnosis.robot.whole import diagnose_robot
from drake_tc.diagnosis.search import Progress
from drake_tc.effects.library import registered_effects
from drake_tc.errors import RigError
from drake_tc.estimation.robot_loads import RobotLogs, robot_logs
from drake_tc.logs.files.episodes import require_different_files, require_different_runs, require_two_runs
from drake_tc.logs.files.readers import LogTable, named_logs
from drake_tc.logs.prepare import in_order, load_runs
from drake_tc.logs.record import Run, distinct_notes
from drake_tc.logs.rig import Rig, load_rig, parse_rig
from drake_tc.logs.rig_document.declared import with_declared_file
from drake_tc.robot.plant import make_plant

Log = Path | str | pd.DataFrame
"""A log file, or a table in memory with the columns of a CSV log: `time` [s] and `joint/quantity`."""


def close_loop(
    rig: Rig | Mapping[str, Any] | Path | str,
    logs: Sequence[Log],
    holdout: Sequence[Log],
    options: DiagnosisOptions | None = None,
    free_run: FreeRun | None = None,
    progress: Progress = lambda text, share: None,
    executor: Executor | None = None,
    declared: Path | None = None,
) -> CloseLoopResult:
    """Read the rig and its runs, diagnose every joint, and say how long it took.

    Args:
        rig: Rig file, or a mapping with the keys of one, or a `Rig`.
        logs: Runs to fit; those in memory are called "log 1", "log 2" and so on by their places in the list.
        holdout: Runs that take no part in fitting or choosing; those in memory are called "held-out 1" and so on.
        options: What to do otherwise.
        free_run: Simulates the model driven by a recorded command; None leaves the free-run errors out.
        progress: Told how far it is.
        executor: Runs free runs and the fits of what is left beside each other; None runs them here.
        declared: File of another simulator whose model is declared (`drake_tc.logs.rig_document.declared`).

    Raises:
        RigError, LogError, IdentificationError: input that cannot be used.

    Example:
        >>> from drake_tc.diagnosis.options import DiagnosisOptions
        >>> rig = leg_rig_file()
        >>> found = close_loop(rig, [leg_log()], [leg_log(seed=1)], DiagnosisOptions(effects=(effect("stribeck"),)))
        >>> found["knee"].verdict
        'no_missing_effect'
    """
    with threadpool_limits(1):  # thousands of small problems: threads would wait for each other
        known = _rig_of(rig, declared)
        train, held = named_logs(logs, "log"), named_logs(holdout, "held-out")
        return _close_loop(known, train, held, options or DiagnosisOptions(), free_run, progress, executor)


def _rig_of(rig: object, declared: Path | None) -> Rig:
    """The rig, whatever it was given as.

    Raises:
        RigError: It is none, or of another type.
    """
    if isinstance(rig, Path | str):
        return load_rig(rig, declared)
    if not isinstance(rig, Rig | Mapping):
        raise RigError(
            "rig: expected a path (str or Path), a mapping with the keys of a rig file, or a Rig, got a "
            f"{type(rig).__name__}"
        )
    known = rig if isinstance(rig, Rig) else parse_rig(rig)
    return known if declared is None else with_declared_file(known, declared)


def _close_loop(
    rig: Rig,
    logs: Sequence[Path | LogTable],
    holdout: Sequence[Path | LogTable],
    options: DiagnosisOptions,
    free_run: FreeRun | None,
    progress: Progress,
    executor: Executor | None,
) -> CloseLoopResult:
    start = time.perf_counter()
    registered_effects()  # one that cannot be loaded ends the run before it begins
    require_two_runs([str(log) for log in (*logs, *holdout)])
    require_different_files(*([log for log in part if isinstance(log, Path)] for part in (logs, holdout)))
    progress("reading", 0.0)
    runs = load_runs([*logs, *holdout], rig)
    require_different_runs(runs)
    train, held = in_order(runs[: len(logs)], rig), in_order(runs[len(logs) :], rig)
    joints: dict[str, JointResult] = {}
    shared: tuple[SharedEffect, ...] = ()
    before: Sequence[Run] | None = None
    links: FittedLinks | None = None
    set_up: SetUpCheck | None = None
    logs_of_robot = robot_logs(rig, runs)
    if logs_of_robot is not None:
        robot = diagnose_robot(logs_of_robot, train, held, rig, options, progress=progress, executor=executor)
        joints = {name: _ranked(joint, robot.robot_gains) for name, joint in robot.joints.items()}
        shared, before, links, set_up = robot.shared, robot.held, robot.links, robot.set_up
        held, train = list(robot.held_after), list(robot.train_after)
    wrong = is_wrong(set_up)
    if wrong:  # such a model is worth no simulation and no experiment
        joints = {
            name: replace(joint, next_experiment=None, verdict="unexplained_structure", set_up_wrong=True)
            for name, joint in joints.items()
        }
    for joint in rig.joints:
        if logs_of_robot is None:
            joints[joint] = diagnose_joint(train, held, rig, joint, options, progress, executor=executor)
        if joints[joint].verdict == "unexplained_structure" and not wrong:
            joints[joint] = _with_remainder(joints[joint])
        if free_run is not None and not wrong:
            result = joints[joint]
            own = [without_errors(runs, rig, joint, result.final) for runs in (train, held)]
            refined = replace(result, refinement=refine_joint(result, rig, own[0], executor, progress))
            progress("free run", 0.0)
            of_before = without_errors(held if before is None else before, rig, joint, result.baseline)
            joints[joint] = with_free_runs(refined, rig, own[1], free_run, executor, of_before)
    verdict = _overall(joints.values())
    return CloseLoopResult(
        joints=joints,
        verdict="effects_found" if shared and verdict == "no_missing_effect" else verdict,
        seconds=time.perf_counter() - start,
        train_files=tuple(str(p) for p in logs),
        heldout_files=tuple(str(p) for p in holdout),
        rig_file=str(rig.source or "rig"),
        rig=rig,
        shared=shared,
        links=links,
        set_up=set_up,
        notes=link_notes(shared, logs_of_robot),
        hints=distinct_notes((run.name, hint) for run in runs for hint in run.hints),
    )


def _with_remainder(joint: JointResult) -> JointResult:
    """The result with the smooth part of what is left."""
    return replace(joint, remainder=remainder_of(joint.train, joint.heldout, joint.final.gain))


def _ranked(joint: JointResult, gains: Mapping[tuple[str, str], float]) -> JointResult:
    """The joint's result with what each effect is worth on the whole robot."""
    effects = tuple(replace(e, robot_gain=gains.get((joint.joint, e.key))) for e in joint.effects)
    return replace(joint, effects=effects)


def _overall(joints: Iterable[JointResult]) -> Verdict:
    verdicts = {j.verdict for j in joints}
    return next(v for v in SEVERITY if v in verdicts)


def link_notes(shared: Sequence[SharedEffect], logs: RobotLogs | None) -> tuple[LoadInAllRuns, ...]:
    """Which masses of links among `shared` may be loads.

    Gravity acts on a mass at a link's centre as on one beside it: a mass larger than the link's own is hardly an error
    of the file, but a tool or a load. An F/T sensor or an IMU tells these apart.
    """
    masses = [cause for cause in shared if cause.id == "link_mass"]
    if logs is None or not masses or not logs.robot.fixed_base or logs.reads_imu or logs.robot.force_torque:
        return ()
    plant = make_plant(logs.robot, 0.0, followers="free")
    whole = float(plant.CalcTotalMass(plant.CreateDefaultContext()))  # no arm carries more than itself
    notes = []
    for cause in masses:
        own, found = float(plant.GetBodyByName(cause.where).default_mass()), float(cause.parameters["mass"].value)
        notes += [LoadInAllRuns(cause.where, found, own)] if own < found < whole else []
    return tuple(notes)
