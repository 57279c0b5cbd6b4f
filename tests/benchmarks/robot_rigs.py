"""`bench robot`: simulated logs of a leg, diagnosed from the files alone, scored against the truth.

Each case has one thing wrong that no file says: an effect in one joint, a sensor, a link's mass or its centre; or
nothing. Its runs: base at rest, base swinging, foot on a soft mat, and one more, swinging, held out.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.search import Progress
from drake_tc.diagnosis.shared.causes import TITLES
from drake_tc.errors import DrakeTcError
from drake_tc.report.data_files import result_json
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.interval_coverage import final_parameters, friction_intervals, own_intervals

HELD_OUT = "run_held"
SHARED = tuple(TITLES)
INTERVALS = ("95 % intervals of the wrong parameter hold the truth", "95 % intervals of friction hold the truth")
"""Rows of interval coverage."""


@dataclass(frozen=True)
class RobotScore:
    """How a case came out.

    Attributes:
        name: Of the case. id: what is wrong, "" for nothing. where: joint, link or sensor.
        first: Whether the right effect in the right place came first (a null: whether nothing was named).
        exact: ... and no other was named.
        named: What was named, first first.
        own_intervals: For each parameter of the right effect, whether its 95 % interval holds the truth.
        friction_intervals: The same for each joint's viscous and Coulomb friction.
        failure: Why there is no diagnosis; empty where there is one.
    """

    name: str
    id: str
    where: str
    first: bool
    exact: bool
    named: tuple[str, ...]
    own_intervals: tuple[bool, ...] = ()
    friction_intervals: tuple[bool, ...] = ()
    failure: str = ""


def score_report(name: str, truth: Mapping[str, Any], report: Mapping[str, Any]) -> RobotScore:
    """Score one report. Effects are ordered by their held-out gain, whether a joint's own or shared.

    An effect that is listed as indistinguishable from the right one, in the same place or at another link, counts. A
    sensor's bias that the case has drawn within its declared tolerance is no effect: to name it is wrong.
    """
    found = [(entry.get("heldout_gain") or 0.0, _alike_shared(entry)) for entry in report.get("shared", [])]
    found += [
        (_robot_gain(effect), {(effect["id"], joint), *_pairs(effect["id"], joint, entry)})
        for joint, entry in report.get("joints", {}).items()
        for effect in entry["effects"]
    ]
    named = [alike for _, alike in sorted(found, key=lambda pair: -pair[0])]
    shown = tuple(" = ".join(f"{i}@{w}" for i, w in sorted(alike)) for alike in named)
    failure = str(report.get("error", ""))
    friction = friction_intervals(truth, report)
    if not truth["id"]:
        quiet = not named and not failure
        return RobotScore(name, "", "", quiet, quiet, shown, (), friction, failure)
    first = bool(named) and (truth["id"], truth["where"]) in named[0]
    exact = first and len(named) == 1
    own = own_intervals(truth, report)
    return RobotScore(name, truth["id"], truth["where"], first, exact, shown, own, friction, failure)


def _robot_gain(effect: Mapping[str, Any]) -> float:
    """Held-out gain of the whole robot, which compares with a shared cause's; the joint's own in older reports."""
    gain = effect.get("robot_heldout_gain")
    return float((effect["heldout_gain"] if gain is None else gain) or 0.0)


def _alike_shared(entry: Mapping[str, Any]) -> set[tuple[str, str]]:
    return {(entry["id"], entry["where"]), *((t["id"], t["where"]) for t in entry["indistinguishable"])}


def _pairs(effect: str, joint: str, entry: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    return ((other, joint) for chosen, other in entry["indistinguishable"] if chosen == effect)


def run_case(folder: Path, number: int, seed: int, tolerance_scale: float = 1.0) -> str:
    """Record case `number` in `folder` unless it is there, diagnose it unless its report is there; its name."""
    from tests.benchmarks.blind_leg.cases import leg_case, record_case

    case = leg_case(number, seed, tolerance_scale)

    def record(rig: Path) -> Mapping[str, Any]:
        record_case(case, rig)
        return case.truth

    return recorded_and_diagnosed(folder, case.name, record)


def recorded_and_diagnosed(folder: Path, name: str, record: Callable[[Path], Mapping[str, Any]]) -> str:
    """Record a case and diagnose it, as far as that is not done; its name.

    Args:
        folder: Gets rigs/, truth/ and reports/.
        name: Of the case.
        record: Writes the rig into a folder and returns the truth.
    """
    rig, report = folder / "rigs" / name, folder / "reports" / f"{name}.json"
    truth = folder / "truth" / f"{name}.json"
    if not truth.exists():
        known = record(rig)
        truth.parent.mkdir(parents=True, exist_ok=True)
        truth.write_text(json.dumps(known) + "\n", encoding="utf-8")
    if not report.exists():
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(json.dumps(diagnose_rig(rig)) + "\n", encoding="utf-8")
    return name


def diagnose_rig(rig: Path) -> dict[str, Any]:
    """The report on a rig's logs; where the tool refuses or fails, one with the reason and without joints."""
    logs = sorted(rig.glob("run_*.npz"))
    held = [log for log in logs if log.name.startswith(HELD_OUT)]
    fit = [log for log in logs if log not in held]
    try:
        result = close_loop(rig / "rig.yaml", fit, held, DiagnosisOptions(assess_residual=False))
        return result_json(result) | {"final_parameters": final_parameters(result)}
    except DrakeTcError as error:
        why = f"refused: {error}"
    except Exception as error:  # one case must not end the benchmark
        why = f"failed with {type(error).__name__}: {error}"
    return {"schema": 1, "joints": {}, "shared": [], "error": why}


def robot_benchmark(
    folder: Path,
    cases: Sequence[int],
    seed: int,
    executor: Executor,
    progress: Progress,
    tolerance_scale: float = 1.0,
) -> list[RobotScore]:
    """Run cases side by side and score them.

    Args:
        folder: Gets rigs/, truth/ and reports/; what is there of the same seed and tolerances is used again.
        cases: Their numbers.
        seed: Of all draws.
        executor: Runs them.
        progress: Told how far it is.
        tolerance_scale: Factor of the sensors' tolerances and of their drawn biases.

    Raises:
        DrakeTcError: A folder that holds cases of another seed or other tolerances.
    """
    expected: Any = seed if tolerance_scale == 1.0 else {"seed": seed, "tolerance_scale": tolerance_scale}
    run = partial(run_case, seed=seed, tolerance_scale=tolerance_scale)
    return [score_report(*case) for case in run_cases(folder, expected, run, cases, executor, progress)]


def run_cases(
    folder: Path,
    expected: Any,
    run: Callable[[Path, int], str],
    cases: Sequence[int],
    executor: Executor,
    progress: Progress,
) -> list[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Name, truth and report of each case, by name.

    Args:
        folder: Gets rigs/, truth/ and reports/; what is there with the same stamp is used again.
        expected: What the cases depend on, kept in `seed.json`.
        run: Records and diagnoses a case, given the folder and its number; returns its name.
        cases: Their numbers.
        executor: Runs them.
        progress: Told how far it is.

    Raises:
        DrakeTcError: A folder that holds cases of another stamp.
    """
    stamp = folder / "seed.json"
    if stamp.exists() and json.loads(stamp.read_text(encoding="utf-8")) != expected:
        raise DrakeTcError(f"{folder}: it holds cases of another seed or other tolerances; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    stamp.write_text(json.dumps(expected), encoding="utf-8")
    futures = [executor.submit(run, folder, number) for number in cases]
    names = []
    for done, future in enumerate(as_completed(futures), start=1):
        names.append(future.result())
        progress(f"{names[-1]}, {done} of {len(futures)}", done / len(futures))
    return [
        (
            name,
            json.loads((folder / "truth" / f"{name}.json").read_text(encoding="utf-8")),
            json.loads((folder / "reports" / f"{name}.json").read_text(encoding="utf-8")),
        )
        for name in sorted(names)
    ]


def summary_rows(scores: Sequence[RobotScore], nulls: float = 0.98) -> list[BenchmarkRow]:
    """Shares of cases and of intervals; intervals that hold the truth more often than in 99 % are too wide.

    Args:
        scores: Of the cases.
        nulls: Goal of the share of nulls in which nothing is named.
    """
    wrong = [s for s in scores if s.id]
    own = [hit for s in wrong for hit in s.own_intervals]
    friction = [hit for s in scores for hit in s.friction_intervals]
    rows = [
        BenchmarkRow.share("right place and effect first", [s.first for s in wrong], "min", 0.95),
        BenchmarkRow.share("that and no other", [s.exact for s in wrong], "min", 0.90),
        BenchmarkRow.share("nulls quiet", [s.first for s in scores if not s.id], "min", nulls),
        *(interval_row(name, hits) for name, hits in zip(INTERVALS, (own, friction), strict=True)),
        BenchmarkRow.share("first, one joint's own effect", [s.first for s in wrong if s.id not in SHARED]),
        BenchmarkRow.share("first, shared cause", [s.first for s in wrong if s.id in SHARED]),
    ]
    for name in sorted({s.id for s in wrong}):
        of_kind = [s for s in wrong if s.id == name]
        rows.append(BenchmarkRow.share(f"first, {name}", [s.first for s in of_kind]))
        rows.append(BenchmarkRow.share(f"intervals, {name}", [hit for s in of_kind for hit in s.own_intervals]))
    return [row for row in rows if row.n]


def interval_row(name: str, hits: Sequence[bool]) -> BenchmarkRow:
    """Share of 95 % intervals that hold the truth: 90 to 99 % is expected."""
    return BenchmarkRow.share(name, hits, "within", 0.945, 0.045)
