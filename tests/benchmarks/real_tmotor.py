"""`bench real-tmotor`: what `close-loop` leaves of an AK80-9's torque on logs that took no part, and what anyone could.

The cases are those of `bench/rigs/tmotor-ak80-9-bench`. Beside the error of `close-loop` stand the published model,
fitted on the same training logs and rows, and figures that say whether the logs can tell of anything better
(`flexible_fits`): the best of many flexible fits, how far equal motions repeat, and the offset of the torque sensor.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.run import close_loop
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.flexible_fits import (
    PUBLISHED,
    LogRows,
    evaluated_errors,
    log_rows,
    offset_of,
    repeatability,
    smallest,
)
from tests.benchmarks.real_log_cases import case_files, import_set
from tests.benchmarks.real_logs import chosen_sets

DATA_SET = "tmotor-ak80-9-bench"
CASES = {
    "sysid_test_1": "early/test_1_held_out",
    "sysid_test_high_speed": "early/high_speed_held_out",
    "sysid_opposing_motor_2": "early/opposing_motor_held_out",
}
"""Held-out log to the case that holds it out.

The fourth log, `sysid_torque_rampup`, is a training run alone: it moves faster than its sensor of the speed resolves
for half a second in all, so `close-loop` refuses to judge by it (`bench real-logs` prints the refusal).
"""
LOWER_BY = 0.25
LEAST_PAIRS = 30


@dataclass(frozen=True)
class HeldOutLog:
    """What `close-loop` found without a log, and the rows of that log through the same filters."""

    result: JointResult
    rows: LogRows

    @property
    def before(self) -> float:
        """RMS [N m] of the declared model on the log."""
        return self.result.before.heldout / self.result.final.gain

    @property
    def after(self) -> float:
        """RMS [N m] with the effects that were found."""
        return self.result.after.heldout / self.result.final.gain

    @property
    def varying(self) -> float:
        """The same about its mean: what is left if the sensor's zero of this log were known."""
        return float(np.std(self.result.heldout.after)) / self.result.final.gain


def held_out(data: Path, names: tuple[str, ...] = tuple(CASES)) -> dict[str, HeldOutLog]:
    """`close-loop` without each of these logs, by log.

    Args:
        data: Folder of public data sets.
        names: Which logs are held out, in turn.

    Raises:
        LogError: the set is not in `data`.
    """
    (chosen,) = chosen_sets([DATA_SET])
    cases = {case.name: case for case in chosen.cases}
    out = {}
    with TemporaryDirectory() as scratch:
        logs = import_set(chosen, data, Path(scratch))
        for name in names:
            files = case_files(chosen, cases[CASES[name]], logs, Path(scratch))
            options = DiagnosisOptions(assess_residual=False)
            (result,) = close_loop(files.rig, files.log, files.holdout, options).joints.values()
            out[name] = HeldOutLog(result, log_rows(result.heldout.samples))
    return out


def rows(data: Path) -> list[BenchmarkRow]:
    """The table: held-out torque error [N m], expected 25 % below the published model fitted on the same logs."""
    results = held_out(data)
    logs = {name: each.rows for name, each in results.items()}
    out: list[BenchmarkRow] = []
    for name, each in results.items():
        errors = evaluated_errors([log for other, log in logs.items() if other != name], logs[name])
        published = errors[PUBLISHED]
        found = ", ".join(effect.key for effect in each.result.effects) or "nothing"
        note = f"{each.rows.torque.size} rows; {found}"
        out += [
            BenchmarkRow(f"{name}/published_model", published, "N*m", note="fitted on the other logs, same filter"),
            BenchmarkRow(f"{name}/declared_model", each.before, "N*m"),
            BenchmarkRow(f"{name}/found_model", each.after, "N*m", (1 - LOWER_BY) * published, "max", note=note),
            BenchmarkRow(f"{name}/found_model_zeroed", each.varying, "N*m", note="about the mean error of this log"),
            *_limits(name, errors, logs),
        ]
    return out


def _limits(name: str, errors: Mapping[str, float], logs: Mapping[str, LogRows]) -> Iterator[BenchmarkRow]:
    """What the other logs, and equal motions, can tell of this one."""
    best, error = smallest(errors)
    yield BenchmarkRow(f"{name}/best_fit", error, "N*m", note=f"chosen in view of the held-out log: {best}")
    yield BenchmarkRow(
        f"{name}/best_fit_ratio", error / errors[PUBLISHED], "-", note="over the published model's error"
    )
    others = {other: log for other, log in logs.items() if other != name}
    for what, pool in (("within", ()), ("between", tuple(others.values()))):
        value, pairs = repeatability(logs[name], pool)
        if pairs >= LEAST_PAIRS:
            yield BenchmarkRow(f"{name}/repeats_{what}", value, "N*m", note=f"{pairs} pairs of rows with equal signals")
    yield BenchmarkRow(f"{name}/offset", offset_of(logs[name]), "N*m", note="constant torque fitted to this log alone")
    for evaluated, log in others.items():
        trained = evaluated_errors([each for other, each in others.items() if other != evaluated], log)
        best, error = smallest(trained)
        note = f"one log predicts the other: {best}"
        yield BenchmarkRow(f"{name}/training/{evaluated}", error / trained[PUBLISHED], "-", note=note)
