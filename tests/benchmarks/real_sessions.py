"""`compare` on public recordings of one joint in several sessions: figures alone, the logs stay where they are.

Nobody knows what changed between these sessions, so no figure has a goal: the table says what a user is told. The servo
of `bam-xl330-pendulum` warmed up from 27 to 40 °C between its sessions, and its position gain differs; the drive of
`tmotor-ak80-9-bench` was recorded before and after its firmware computed the current in another way.
"""

import math
from pathlib import Path
from tempfile import TemporaryDirectory

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.models import models_of
from drake_tc.diagnosis.run import close_loop
from drake_tc.errors import DrakeTcError, LogError
from drake_tc.loops.recording import Progress
from drake_tc.watch.compare import JointComparison, compare
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.real_log_cases import RealLogSet, case_files, import_set, load_sets

PAIRS = (
    ("bam-xl330-pendulum", "kp100/voltage", "kp200/voltage"),
    ("bam-xl330-pendulum", "kp100/voltage", "kp800/voltage"),
    ("bam-xl330-pendulum", "kp200/voltage", "kp800/voltage"),
    ("tmotor-ak80-9-bench", "early/two_held_out", "final"),
)
"""Set, the case of the model, and the case of the new logs, whose runs `REAL_LOGS.md` describes."""


def session_rows(data: Path, progress: Progress) -> list[BenchmarkRow]:
    """Rows of `python -m tests.benchmarks real-sessions`.

    Raises:
        LogError: none of the sets is in `data`.
    """
    rows: list[BenchmarkRow] = []
    for name in dict.fromkeys(pair[0] for pair in PAIRS):
        chosen = load_sets()[name]
        with TemporaryDirectory() as folder:
            try:
                logs = import_set(chosen, data, Path(folder))
            except DrakeTcError:
                continue
            for _, then, now in (pair for pair in PAIRS if pair[0] == name):
                progress(f"{name}: {then} to {now}", 0.5)
                rows += _pair_rows(chosen, then, now, logs, Path(folder))
    if not rows:
        raise LogError(f"{data}: expected one of the data sets {', '.join(dict.fromkeys(pair[0] for pair in PAIRS))}")
    return rows


def _pair_rows(chosen: RealLogSet, then: str, now: str, logs: Path, scratch: Path) -> list[BenchmarkRow]:
    """What is told of one pair of sessions."""
    cases = {case.name: case for case in chosen.cases}
    before, after = (case_files(chosen, cases[name], logs, scratch) for name in (then, now))
    title, quick = f"{chosen.name}, {then} to {now}", DiagnosisOptions(assess_residual=False)
    out = scratch / then.replace("/", "_")
    out.mkdir(exist_ok=True)
    try:
        models_of(close_loop(before.rig, before.log, before.holdout, quick), out)
        found = compare(out / "model_after.yaml", after.log, after.rig, after.holdout, quick)
    except DrakeTcError as error:
        return [BenchmarkRow(f"{title}: refused", 1.0, note=str(error))]
    rows: list[BenchmarkRow] = []
    for joint in found.joints.values():
        rows += _joint_rows(title, joint)
    return rows


def _joint_rows(title: str, joint: JointComparison) -> list[BenchmarkRow]:
    changed = ", ".join(f"{p.key}.{p.name}" for p in joint.parameters if p.changed)
    moved = ", ".join(f"{e.key} {e.status}" for e in joint.effects if e.status != "present")
    note = "; ".join(text for text in (joint.verdict, joint.why, changed, moved) if text)
    rows = [
        BenchmarkRow(f"{title}: parameters that changed", float(sum(p.changed for p in joint.parameters)), note=note)
    ]
    for p in joint.parameters:
        if p.key in ("drive", "viscous", "coulomb") and math.isfinite(p.share):
            rows.append(BenchmarkRow(f"{title}: change of {p.key}", 100.0 * p.share, "%"))
    if not any(math.isnan(each) for each in joint.temperature):
        rows.append(BenchmarkRow(f"{title}: warmer by", joint.temperature[1] - joint.temperature[0], "K"))
    rows += [BenchmarkRow(f"{title}: floors under the stored numbers", joint.floors_then)]
    return [*rows, BenchmarkRow(f"{title}: floors under the new ones", joint.floors_now)]
