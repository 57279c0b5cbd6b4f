"""The check's predictions held against the truth of blind rigs: is what is said to be seen found, and nothing else?

Each effect is put into one rig of each strength, by default 4 %, 30 % and 100 % of the strength that the blind
benchmark calls middle. The check of a rig's training runs predicts "seen" where the true size is at least the smallest
size that it states, and "not seen" where the true size is below the size that it states for the most favourable shape.
The diagnosis of the same files says whether the effect was found.
"""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from drake_tc.errors import DrakeTcError
from drake_tc.experiments.causes import size_in
from drake_tc.experiments.check.effects import Visibility
from drake_tc.experiments.check.run import check_rig
from drake_tc.joint_simulator.spec import BlindError, Joint, RigSpec
from tests.benchmarks.blind.catalogue import SETTINGS, caused_rig
from tests.benchmarks.blind.generate import generate
from tests.benchmarks.blind.outcome import read_outcome
from tests.benchmarks.blind_rigs import HELD_OUT, diagnose_folder
from tests.benchmarks.figures import BenchmarkRow

Progress = Callable[[str, float], None]
Predicted = Literal["seen", "between", "not_seen"]
STRENGTHS = (0.04, 0.3, 1.0)
"""Strengths, in units of the blind benchmark's middle one."""
SEEN_AND_FOUND, HIDDEN_AND_FOUND = 0.95, 0.05
"""Goals: at least, and at most."""


@dataclass(frozen=True)
class Prediction:
    """One rig.

    Attributes:
        name, effect: Of the rig. size: True size. smallest, easiest: That the check states; see `Visibility`.
        predicted: What follows. found: Whether the diagnosis names the effect, or lists it as an alternative.
        named: What it names.
    """

    name: str
    effect: str
    size: float
    smallest: float
    easiest: float
    predicted: Predicted
    found: bool
    named: tuple[str, ...]


def weakened_rigs(kinds: Sequence[str], seed: int, strengths: Sequence[float] = STRENGTHS) -> list[RigSpec]:
    """Rigs with one effect each, one of each strength.

    Raises:
        BlindError: An effect that the blind rigs do not have.
    """
    unknown = [kind for kind in kinds if kind not in SETTINGS]
    if unknown:
        raise BlindError(f"no effect {unknown[0]!r} among the blind rigs; effects: {', '.join(SETTINGS)}")
    out = []
    for kind in kinds or tuple(SETTINGS):
        for k, factor in enumerate(strengths):
            spec = caused_rig((kind,), "single", "middle", k, seed)
            targets = {cause: factor * target for cause, target in spec.targets.items()}
            out.append(replace(spec, name=f"{kind}_{factor:g}", targets=targets, strength=f"{factor:g}"))
    return out


def predictions(
    folder: Path,
    kinds: Sequence[str],
    seed: int,
    executor: Executor,
    progress: Progress,
    strengths: Sequence[float] = STRENGTHS,
) -> list[Prediction]:
    """Simulate the rigs in `folder` unless they are there, diagnose and check them.

    Args:
        folder: Gets rigs/, truth/ and reports/.
        kinds: Effects; empty for all.
        seed: Of the rigs.
        executor: Works on rigs beside each other.
        progress: Told how far it is.
        strengths: Of the effects [the blind benchmark's middle strength].

    Raises:
        BlindError: An effect that the blind rigs do not have.
    """
    specs = weakened_rigs(kinds, seed, strengths)
    missing = [s for s in specs if not (folder / "truth" / s.name / "truth.json").exists()]
    generate(missing, folder, lambda done, total: progress(f"simulated {done} of {total}", 0.3 * done / max(total, 1)))
    futures = [executor.submit(predicted_of, folder, spec.name) for spec in specs]
    out = []
    for done, future in enumerate(as_completed(futures)):
        out.append(future.result())
        progress(f"checked and diagnosed {out[-1].name}", 0.3 + 0.7 * (done + 1) / len(futures))
    return sorted(out, key=lambda p: p.name)


def predicted_of(folder: Path, name: str) -> Prediction:
    """One rig from its files; a report that is there is used again."""
    rig, report = folder / "rigs" / name, folder / "reports" / name / "report.json"
    if not report.exists():
        diagnose_folder(rig, folder / "reports")
    truth_path = folder / "truth" / name / "truth.json"
    truth = json.loads(truth_path.read_text(encoding="utf-8"))
    outcome = read_outcome(truth_path, report)
    logs = [p for p in sorted(rig.iterdir()) if p.name.startswith("run_") and not p.name.startswith(HELD_OUT)]
    kind, size = str(truth["kind"]), size_in(spec_of(truth), str(truth["kind"]))
    try:
        checked = check_rig(rig / "rig.yaml", logs)
        found = next(joint.effects for joint in checked.joints.values())
        own = [e for e in found.effects if e.id == kind] if found is not None else []
    except DrakeTcError:
        own = []
    smallest, easiest, said = compared(own, size)
    return Prediction(name, kind, size, smallest, easiest, said, outcome.all_found, outcome.named)


def compared(forms: Sequence[Visibility], size: float) -> tuple[float, float, Predicted]:
    """(smallest, easiest, what follows for a true size) over the forms of one effect."""
    if not forms:
        return float("inf"), float("inf"), "not_seen"
    if forms[0].size.falling:
        smallest, easiest = max(f.smallest for f in forms), max(f.easiest for f in forms)
        return smallest, easiest, "seen" if size <= smallest else "not_seen" if size > easiest else "between"
    smallest, easiest = min(f.smallest for f in forms), min(f.easiest for f in forms)
    return smallest, easiest, "seen" if size >= smallest else "not_seen" if size < easiest else "between"


def spec_of(truth: dict[str, Any]) -> RigSpec:
    """The rig that a truth file describes: joint, causes and load."""
    pendulum = truth["pendulum"]
    return RigSpec(
        truth["name"],
        truth["group"],
        truth["kind"],
        truth["strength"],
        Joint(**truth["joint"]),
        0,
        causes=truth["causes"],
        pendulum=None if pendulum is None else (float(pendulum[0]), float(pendulum[1])),
    )


def prediction_rows(found: Sequence[Prediction]) -> list[BenchmarkRow]:
    """Rows of `bench check`: shares with their goals."""
    hits = {said: [p.found for p in found if p.predicted == said] for said in ("seen", "between", "not_seen")}
    return [
        BenchmarkRow.share("predicted seen, found", hits["seen"], "min", SEEN_AND_FOUND),
        BenchmarkRow.share("predicted between, found", hits["between"]),
        BenchmarkRow.share("predicted not seen, found", hits["not_seen"], "max", HIDDEN_AND_FOUND),
    ]
