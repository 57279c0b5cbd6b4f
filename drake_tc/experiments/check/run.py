"""`check` from files to result: what the logs of a rig contain, and what they can and cannot show.

A check as a page for a person (`check.html`) and as plain data (`check.json`).
"""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from drake_tc.config.quoted import json_value
from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.diagnosis.search import Progress
from drake_tc.errors import IdentificationError
from drake_tc.estimation.robot_loads import at_motors, motor_turns, robot_logs, with_robot_loads
from drake_tc.experiments.check.consistency import Finding, findings
from drake_tc.experiments.check.delays import late_columns
from drake_tc.experiments.check.effects import JointEffects, Visibility, by_reason, joint_effects
from drake_tc.logs.files.episodes import require_different_files
from drake_tc.logs.loads import RobotLoad
from drake_tc.logs.prepare import in_order, load_runs
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig, load_rig
from drake_tc.report.numbers import percent, pretty_unit, significant
from drake_tc.report.pages import PageSection, PageTable, plain_page
from drake_tc.report.words import capital
from drake_tc.types import FloatArray


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
        drive: Kind of drive.
        effects: What its logs show of each effect; None where the declared model cannot be fitted.
        findings: Whether the columns can belong together.
        refusal: Why the declared model cannot be fitted; empty where it can.
    """

    drive: str
    effects: JointEffects | None
    findings: tuple[Finding, ...] = ()
    refusal: str = ""


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
        declared: File of another simulator whose model is declared (`drake_tc.logs.rig_document.declared`).

    Raises:
        RigError, LogError: input that cannot be used.
        IdentificationError: the declared model of no joint can be fitted.
    """
    with threadpool_limits(1):
        start = time.perf_counter()
        rig = load_rig(rig_path, declared)
        require_different_files(logs, ())
        progress("reading", 0.0)
        runs = load_runs(logs, rig)
        prepared_runs, rig_used = with_loads(rig, runs)
        links_fitted, joints = _fits_links(rig), {}
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
            seconds=time.perf_counter() - start,
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
        return JointCheck(rig.drive[joint], None, refusal=str(error))
    effects = joint_effects(prepared, links_fitted=links_fitted)
    found = findings(effects.fitted, late_columns(effects.fitted, runs, joint))
    return JointCheck(rig.drive[joint], effects, found)


def _run_facts(run: Run) -> RunFacts:
    usable = run.segment >= 0
    count = int(np.unique(run.segment[usable]).size)
    seconds = float(run.time[-1] - run.time[0])
    return RunFacts(run.name, seconds, 1.0 / run.period, float(np.mean(usable)), count, run.notes)


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


WORDS = {"seen": "seen", "weakly": "weakly seen", "not_seen": "not seen", "not_separable": "not separable"}


def check_page(result: CheckResult) -> str:
    """The HTML of a check."""
    sections = [section for name, joint in result.joints.items() for section in _joint(name, joint)]
    numbers = ("length", "rate", "usable", "stretches")
    runs = PageTable(("run", *numbers, "repairs on reading"), [_run_row(run) for run in result.runs], numbers)
    columns = PageTable(
        ("run", "column", "from", "to", "step"),
        [
            (c.run, c.column, significant(c.low), significant(c.high), significant(c.step) if c.step else "none")
            for c in result.columns
        ],
        ("from", "to", "step"),
    )
    sections.append(PageSection("Runs and columns", aside="in SI units", tables=(runs, columns)))
    lead = [summary(name, joint) for name, joint in result.joints.items()]
    return plain_page("What these logs can show", f"check · rig {result.rig_file.rpartition('/')[2]}", lead, sections)


def _run_row(run: RunFacts) -> tuple[str, ...]:
    length, rate = f"{significant(run.seconds)} s", f"{significant(run.rate, 4)} Hz"
    return run.name, length, rate, percent(run.usable), str(run.stretches), " ".join(run.notes) or "none"


def summary(name: str, joint: JointCheck) -> str:
    """One sentence: how many effects would be found, and what speaks against the columns."""
    if joint.effects is None:
        return f"{name}: the declared model cannot be fitted. {joint.refusal}"
    status = [e.status for e in joint.effects.effects if not e.obstacle]
    doubts = sum(f.level == "warning" for f in joint.findings)
    text = (
        f"{name}: of the {len(status)} effects that can be looked for, these logs would show {status.count('seen')} at "
        f"their typical size, and cannot separate {status.count('not_separable')} from another effect."
    )
    doubtful = {0: "", 1: " One property of the columns is doubtful."}
    return text + doubtful.get(doubts, f" {doubts} properties are doubtful.")


def _joint(name: str, joint: JointCheck) -> list[PageSection]:
    if joint.effects is None:
        return [PageSection(name, warnings=(joint.refusal,))]
    good, doubtful = ([f.text for f in joint.findings if (f.level == "warning") == bad] for bad in (False, True))
    noise, unit = joint.effects.fitted.balance, pretty_unit(joint.effects.facts.units.torque)
    explain = (
        f"The sensor noise alone leaves an error of {significant(noise.floor)} {unit} (RMS) in the torque balance; the "
        f"most probable model leaves {significant(noise.left)} {unit}, with {significant(noise.independent)} "
        "independent samples. The smallest size is the size at which close-loop would name the effect in 95 % of such "
        "logs, for most values of its other parameters. “Seen” means that it would name an effect of the typical size, "
        "from which on the effect matters to the user of a model. A saturation is stronger the smaller its limit is."
    )
    table = PageTable(
        ("effect", "these logs", "smallest size", "typical size", "unit", "why"),
        [_row(each) for each in joint.effects.effects if not each.obstacle],
        ("smallest size", "typical size"),
    )
    labels = {each.key: _label(each) for each in joint.effects.effects}
    reasons = by_reason(joint.effects.effects).items()
    rows = [(", ".join(labels[key] for key in keys), f"{capital(reason)}.") for reason, keys in reasons]
    never = [PageTable(("cannot be looked for", "why"), rows)] if rows else []
    aside = f"{joint.drive}, {significant(joint.effects.fitted.seconds)} s in motion"
    return [
        PageSection(f"{name}: columns", good, doubtful, aside=aside),
        PageSection(f"{name}: effects", (explain,), tables=(table, *never)),
    ]


def _row(found: Visibility) -> tuple[str, ...]:
    why = found.reason or (f"In these motions it is {found.why}." if found.why else "")
    sizes = _size(found.smallest), _size(found.size.typical), pretty_unit(found.size.unit)
    return _label(found), WORDS[found.status], *sizes, why


def _label(found: Visibility) -> str:
    return found.title if found.key == found.id else f"{found.title} ({found.key})"


def _size(value: float) -> str:
    return significant(value) if 0.0 < value < math.inf else "–"


def check_json(result: CheckResult) -> dict[str, Any]:
    """{"name": "check", "joints": {NAME: {"effects": [{"id", "status", "size", ...}], ...}}, "runs", "columns"}."""
    document = {
        "name": "check",
        "schema": 1,
        "rig": result.rig_file,
        "logs": list(result.logs),
        "joints": {name: _joint_json(each) for name, each in result.joints.items()},
        "runs": [asdict(run) for run in result.runs],
        "columns": [asdict(column) for column in result.columns],
        "seconds": result.seconds,
    }
    out: dict[str, Any] = json_value(document)
    return out


def _joint_json(joint: JointCheck) -> dict[str, Any]:
    found, noise = joint.effects, None
    if found is not None:
        noise = asdict(found.fitted.balance)
        noise["independent_samples"] = noise.pop("independent")
    return {
        "drive": joint.drive,
        "rows": 0 if found is None else found.fitted.prepared.train.samples.rows.size,
        "seconds_in_motion": 0.0 if found is None else found.fitted.seconds,
        "refusal": joint.refusal or None,
        "findings": [asdict(each) for each in joint.findings],
        "declared": None if found is None else asdict(found.fitted.numbers),
        "motion": None if found is None else asdict(found.facts),
        "noise": noise,
        "effects": [] if found is None else [_effect(each) for each in found.effects],
    }


def _effect(found: Visibility) -> dict[str, Any]:
    same = ("id", "key", "status", "not_separable_from", "separable", "confused_below", "kept")
    size = {name: getattr(found.size, name) for name in ("name", "unit", "typical")}
    size |= {"smallest": found.smallest, "easiest": found.easiest}
    return {name: getattr(found, name) for name in same} | {"size": size, "reason": found.reason or None}
