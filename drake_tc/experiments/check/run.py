"""`check` from files to result: what the logs of a rig contain, and what they can and cannot show."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.errors import IdentificationError
from drake_tc.estimation.coupled_gears import at_motors, motor_turns
from drake_tc.estimation.robot_loads import robot_logs, with_robot_loads
from drake_tc.experiments.check.consistency import Finding, findings
from drake_tc.experiments.check.joint import JointEffects, joint_effects
from drake_tc.experiments.check.late_columns import late_columns
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.prepare import in_order, load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, load_rig
from drake_tc.types import FloatArray

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class ColumnFacts:
    """One column of one run: its range in SI units, the step of its values (0: on no grid) and its noise.

    Attributes:
        run, column: Names.
        low, high: Range of the usable samples.
        step: Of the recorded values.
        rms_change: RMS of the change from sample to sample.
    """

    run: str
    column: str
    low: float
    high: float
    step: float
    rms_change: float


@dataclass(frozen=True)
class RunFacts:
    """One run: length [s], rate [Hz], usable share of its samples, and what was repaired on reading."""

    name: str
    seconds: float
    rate: float
    usable: float
    stretches: int
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class JointCheck:
    """One joint.

    Attributes:
        joint: Its name.
        drive: Kind of drive.
        effects: What its logs show of each effect; None where the declared model cannot be fitted.
        findings: Whether the columns can belong together.
        refusal: Why the declared model cannot be fitted; empty where it can.
        rows: Samples in motion that take part. seconds: their length [s].
    """

    joint: str
    drive: str
    effects: JointEffects | None
    findings: tuple[Finding, ...]
    refusal: str
    rows: int
    seconds: float


@dataclass(frozen=True, eq=False)
class CheckResult:
    """All joints and runs of a rig."""

    rig_file: str
    logs: tuple[str, ...]
    joints: dict[str, JointCheck]
    runs: tuple[RunFacts, ...]
    columns: tuple[ColumnFacts, ...]
    seconds: float


def check_rig(
    rig_path: Path,
    logs: Sequence[Path],
    progress: Progress = lambda text, share: None,
    declared: Path | None = None,
) -> CheckResult:
    """Read a rig and its runs, and say what they contain and what they can show.

    Args:
        rig_path: Rig file.
        logs: Runs that a diagnosis would fit.
        progress: Told how far it is.
        declared: File of another simulator whose model is declared (`drake_tc.logs.rig_document.declared_file`).

    Raises:
        RigError, LogError: input that cannot be used.
        IdentificationError: the declared model of no joint can be fitted.
    """
    with threadpool_limits(1):
        start = time.perf_counter()
        rig = load_rig(rig_path, declared)
        progress("reading", 0.0)
        runs = load_runs(logs, rig)
        return replace(check_runs(rig, runs, progress), seconds=time.perf_counter() - start)


def check_runs(rig: Rig, runs: Sequence[Run], progress: Progress = lambda text, share: None) -> CheckResult:
    """The same of runs that were read already."""
    prepared_runs, rig_used = with_loads(rig, runs)
    links_fitted = _fits_links(rig)
    joints = {}
    for number, joint in enumerate(rig.joints):
        progress(joint, (number + 0.5) / len(rig.joints))
        joints[joint] = _check_joint(prepared_runs, rig_used, joint, links_fitted=links_fitted)
    refused = [each for each in joints.values() if each.refusal]
    if len(refused) == len(joints):
        raise IdentificationError(refused[0].refusal)
    return CheckResult(
        rig_file=str(rig.source or "rig"),
        logs=tuple(run.file_name for run in runs),
        joints=joints,
        runs=tuple(_run_facts(run) for run in runs),
        columns=tuple(each for run in runs for each in _column_facts(run, rig)),
        seconds=float("nan"),
    )


def with_loads(rig: Rig, runs: Sequence[Run]) -> tuple[list[Run], Rig]:
    """The runs with the load torques of the rig's robot where it has one, positions at the motors, and the rig.

    Links that a diagnosis would fit have the values of their file here.
    """
    if _fits_links(rig):
        rig = replace(rig, load=dict.fromkeys(rig.joints, RobotLoad("inverse_dynamics")))
    logs = robot_logs(rig, runs)
    if logs is None:
        return in_order(runs, rig), rig
    loaded = with_robot_loads(logs, runs, rig.joints)
    turns = None if logs.turns is None else motor_turns(rig.coupled, rig.joints)
    return in_order(loaded if turns is None else at_motors(turns, rig.joints, loaded), rig), rig


def _fits_links(rig: Rig) -> bool:
    """Whether a diagnosis fits the links of the rig's robot."""
    first = next(iter(rig.load.values()))
    return isinstance(first, RobotLoad) and first.fitted


def _check_joint(runs: Sequence[Run], rig: Rig, joint: str, *, links_fitted: bool) -> JointCheck:
    try:
        prepared = prepare_joint(runs, [], rig, joint)
    except IdentificationError as error:
        return JointCheck(joint, rig.drive[joint], None, (), str(error), 0, 0.0)
    effects = joint_effects(prepared, links_fitted=links_fitted)
    samples = prepared.train.samples
    seconds = float(np.count_nonzero(samples.moving)) * samples.signals.period
    found = findings(effects.fitted, late_columns(effects.fitted, runs, joint))
    return JointCheck(joint, rig.drive[joint], effects, found, "", int(samples.rows.size), seconds)


def _run_facts(run: Run) -> RunFacts:
    usable = run.segment >= 0
    count = int(np.unique(run.segment[usable]).size)
    return RunFacts(
        run.name, float(run.time[-1] - run.time[0]), 1.0 / run.period, float(np.mean(usable)), count, run.notes
    )


def _column_facts(run: Run, rig: Rig) -> list[ColumnFacts]:
    usable = run.segment >= 0
    out = []
    for name, values in run.columns.items():
        if name.rpartition("/")[0] not in rig.joints:
            continue
        kept: FloatArray = values[usable]
        change = float(np.sqrt(np.mean(np.diff(kept) ** 2))) if kept.size > 1 else 0.0
        out.append(ColumnFacts(run.name, name, float(kept.min()), float(kept.max()), run.steps.get(name, 0.0), change))
    return out
