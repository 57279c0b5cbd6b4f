"""`bench robot`: simulated logs of a leg, diagnosed from the files alone, scored against the truth.

Each case has one thing wrong that no file says: an effect in one joint, a sensor, a link's mass or its centre; or
nothing. Its runs: base at rest, base swinging, foot on a soft mat, and one more, swinging, held out.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from drake_tc.diagnosis.close_loop import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.search import Progress
from drake_tc.diagnosis.shared.causes import TITLES
from drake_tc.diagnosis.to_json import result_json
from drake_tc.errors import DrakeTcError

HELD_OUT = "run_held"
SHARED = tuple(TITLES)


@dataclass(frozen=True)
class RobotScore:
    """How a case came out.

    Attributes:
        name: Of the case. id: what is wrong, "" for nothing. where: joint, link or sensor.
        first: Whether the right effect in the right place came first (a null: whether nothing was named).
        exact: ... and no other was named.
        named: What was named, first first.
    """

    name: str
    id: str
    where: str
    first: bool
    exact: bool
    named: tuple[str, ...]


def score_report(name: str, truth: Mapping[str, Any], report: Mapping[str, Any]) -> RobotScore:
    """Score one report. Shared causes come before joints' own effects; these by their held-out gain.

    An effect that is listed as indistinguishable from the right one, in the same place or at another link, counts.
    """
    named = [_alike_shared(entry) for entry in report.get("shared", [])]
    own = [
        (effect["heldout_gain"] or 0.0, {(effect["id"], joint), *_pairs(effect["id"], joint, entry)})
        for joint, entry in report.get("joints", {}).items()
        for effect in entry["effects"]
    ]
    named += [alike for _, alike in sorted(own, key=lambda pair: -pair[0])]
    shown = tuple(" = ".join(f"{i}@{w}" for i, w in sorted(alike)) for alike in named)
    wanted = (truth["id"], truth["where"])
    failed = "error" in report
    if not truth["id"]:
        quiet = not named and not failed
        return RobotScore(name, "", "", quiet, quiet, shown)
    first = bool(named) and wanted in named[0]
    return RobotScore(name, truth["id"], truth["where"], first, first and len(named) == 1, shown)


def _alike_shared(entry: Mapping[str, Any]) -> set[tuple[str, str]]:
    return {(entry["id"], entry["where"]), *((t["id"], t["where"]) for t in entry["indistinguishable"])}


def _pairs(effect: str, joint: str, entry: Mapping[str, Any]) -> Iterable[tuple[str, str]]:
    return ((other, joint) for chosen, other in entry["indistinguishable"] if chosen == effect)


def run_case(folder: Path, number: int, seed: int) -> str:
    """Record case `number` in `folder` unless it is there, diagnose it unless its report is there; its name."""
    from drake_tc.diagrams.blind_leg.cases import leg_case, record_case

    case = leg_case(number, seed)
    rig, report = folder / "rigs" / case.name, folder / "reports" / f"{case.name}.json"
    truth = folder / "truth" / f"{case.name}.json"
    if not truth.exists():
        record_case(case, rig)
        truth.parent.mkdir(parents=True, exist_ok=True)
        truth.write_text(json.dumps(case.truth) + "\n", encoding="utf-8")
    if not report.exists():
        logs = sorted(rig.glob("run_*.npz"))
        held = [log for log in logs if log.name.startswith(HELD_OUT)]
        try:
            fit = [log for log in logs if log not in held]
            text = json.dumps(
                result_json(close_loop(rig / "rig.yaml", fit, held, DiagnosisOptions(assess_residual=False)))
            )
        except DrakeTcError as error:
            text = json.dumps({"schema": 1, "joints": {}, "shared": [], "error": str(error)})
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(text + "\n", encoding="utf-8")
    return str(case.name)


def robot_benchmark(
    folder: Path, cases: Sequence[int], seed: int, executor: Executor, progress: Progress
) -> list[RobotScore]:
    """Run cases side by side and score them.

    Args:
        folder: Gets rigs/, truth/ and reports/; what is there of the same seed is used again.
        cases: Their numbers.
        seed: Of all draws.
        executor: Runs them.
        progress: Told how far it is.
    """
    stamp = folder / "seed.json"
    if stamp.exists() and json.loads(stamp.read_text(encoding="utf-8")) != seed:
        raise DrakeTcError(f"{folder}: holds cases of another seed; name another folder")
    folder.mkdir(parents=True, exist_ok=True)
    stamp.write_text(json.dumps(seed), encoding="utf-8")
    futures = [executor.submit(run_case, folder, number, seed) for number in cases]
    names = []
    for done, future in enumerate(as_completed(futures), start=1):
        names.append(future.result())
        progress(f"{names[-1]}, {done} of {len(futures)}", done / len(futures))
    return [
        score_report(
            name,
            json.loads((folder / "truth" / f"{name}.json").read_text(encoding="utf-8")),
            json.loads((folder / "reports" / f"{name}.json").read_text(encoding="utf-8")),
        )
        for name in sorted(names)
    ]


def summary_rows(scores: Sequence[RobotScore]) -> list[dict[str, Any]]:
    """Rows of figures: share of cases [%] and their number."""
    wrong = [s for s in scores if s.id]
    groups: dict[str, tuple[list[bool], float | None]] = {
        "right place and effect first": ([s.first for s in wrong], 90.0),
        "that and no other": ([s.exact for s in wrong], None),
        "nulls quiet": ([s.first for s in scores if not s.id], 97.0),
        "first, one joint's own effect": ([s.first for s in wrong if s.id not in SHARED], None),
        "first, shared cause": ([s.first for s in wrong if s.id in SHARED], None),
    }
    for name in sorted({s.id for s in wrong}):
        groups[f"first, {name}"] = ([s.first for s in wrong if s.id == name], None)
    return [
        {"name": name, "unit": "%", "value": 100.0 * float(np.mean(hits)), "expected": wanted, "n": len(hits)}
        for name, (hits, wanted) in groups.items()
        if hits
    ]
