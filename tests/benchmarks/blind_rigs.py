"""`bench diagnosis`: simulated rigs, written as files, diagnosed from the files alone, scored against the truth."""

import json
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.search import Progress
from drake_tc.errors import DrakeTcError
from drake_tc.joint_simulator.spec import BlindError, RigSpec
from drake_tc.report.data_files import result_json
from tests.benchmarks.blind.catalogue import Scale, catalogue
from tests.benchmarks.blind.generate import generate
from tests.benchmarks.blind.outcome import read_outcome
from tests.benchmarks.blind.score import BenchmarkScore, score_outcomes
from tests.benchmarks.interval_coverage import final_parameters

HELD_OUT = "run_multisine"
GROUPS = {"nulls": "null", "singles": "single", "pairs": "pair", "outside": "outside"}
"""Names on the command line to the groups of `RigSpec`."""
TOGETHER = 30
"""Rigs that one process simulates at a time."""


def diagnose_folder(rig: Path, reports: Path) -> str:
    """Diagnose one rig's files and write `reports/NAME/report.json`; returns the rig's name.

    Beside the report's own keys, `final_parameters` has the values and intervals of the final model.

    A rig that the tool refuses leaves a report without joints, which scores as wrong. So does one on which it fails
    with an error of its own, so that one rig does not end the benchmark; the score prints the reason.
    """
    logs = sorted(p for p in rig.iterdir() if p.name.startswith("run_"))
    held = [p for p in logs if p.name.startswith(HELD_OUT)]
    try:
        result = close_loop(rig / "rig.yaml", [p for p in logs if p not in held], held)
        report = result_json(result) | {"final_parameters": final_parameters(result)}
    except DrakeTcError as error:
        report = _no_answer(f"refused: {error}")
    except Exception as error:
        report = _no_answer(f"failed with {type(error).__name__}: {error}")
    out = reports / rig.name
    out.mkdir(parents=True, exist_ok=True)
    (out / "report.json").write_text(json.dumps(report) + "\n", encoding="utf-8")
    return rig.name


def _no_answer(why: str) -> dict[str, Any]:
    return {"schema": 1, "verdict": "no_missing_effect", "joints": {}, "error": why}


@dataclass(frozen=True)
class BlindOptions:
    """What of the benchmark is run.

    Attributes:
        scale: "smoke" (about 35 rigs) or "full" (about 340).
        groups: Groups of rigs; empty for all of them.
        kinds: Kinds of rigs (`stribeck`, `drifting_noise`, `touch` ...); empty for all of them.
    """

    scale: Scale = "smoke"
    groups: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()

    def chosen(self, seed: int) -> list[RigSpec]:
        """The rigs of a seed that are run; their names are those of the whole benchmark.

        Raises:
            BlindError: An unknown group, or a kind that the chosen rigs do not have.
        """
        for group in self.groups:
            if group not in GROUPS:
                raise BlindError(f"no group {group!r}; groups are {', '.join(GROUPS)}")
        within = {GROUPS[group] for group in self.groups or GROUPS}
        specs = [spec for spec in catalogue(self.scale, seed) if spec.group in within]
        possible = sorted({spec.kind for spec in specs})
        for kind in self.kinds:
            if kind not in possible:
                raise BlindError(f"no kind {kind!r} among the chosen rigs; kinds are {', '.join(possible)}")
        return [spec for spec in specs if not self.kinds or spec.kind in self.kinds]


def blind_benchmark(
    folder: Path,
    options: BlindOptions,
    seed: int,
    executor: Executor,
    progress: Progress,
) -> BenchmarkScore:
    """Make the chosen rigs in `folder` unless they are there, diagnose each, score them.

    Args:
        folder: Gets rigs/, truth/ and reports/; rigs made before with the same scale and seed are used again.
        options: Scale, and which part of the benchmark.
        seed: Of the catalogue.
        executor: Diagnoses rigs side by side.
        progress: report(text, share).

    Raises:
        BlindError: A folder that holds rigs of another scale or seed, or a choice that is not possible.
    """
    specs = options.chosen(seed)
    _claim(folder, options.scale, seed)
    missing = [spec for spec in specs if not (folder / "truth" / spec.name / "truth.json").exists()]
    for done in _simulated(missing, folder, executor):
        progress(f"simulated rig {done} of {len(missing)}", 0.4 * done / len(missing))
    rigs = [folder / "rigs" / spec.name for spec in sorted(specs, key=lambda spec: spec.name)]
    for number, name in enumerate(_diagnosed(rigs, folder / "reports", executor), start=1):
        progress(f"diagnosed {name}, {number} of {len(rigs)}", 0.4 + 0.6 * number / len(rigs))
    return score_outcomes(
        [
            read_outcome(folder / "truth" / rig.name / "truth.json", folder / "reports" / rig.name / "report.json")
            for rig in rigs
        ]
    )


def _simulated(specs: Sequence[RigSpec], folder: Path, executor: Executor) -> Iterator[int]:
    """Simulate rigs and write their files, some at a time beside each other; how many are done."""
    parts = [list(specs[i : i + TOGETHER]) for i in range(0, len(specs), TOGETHER)]
    futures = [executor.submit(generate, part, folder) for part in parts]
    done = 0
    for future in as_completed(futures):
        done += len(future.result())
        yield done


def _claim(folder: Path, scale: Scale, seed: int) -> None:
    """Note in the folder whose rigs it holds."""
    stamp = folder / "catalogue.json"
    expected = {"scale": scale, "seed": seed, "rigs": len(catalogue(scale, seed))}
    if stamp.exists():
        found = json.loads(stamp.read_text(encoding="utf-8"))
        if found != expected:
            raise BlindError(f"{folder}: it holds rigs of {found}, not of {expected}; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    stamp.write_text(json.dumps(expected), encoding="utf-8")


def _diagnosed(rigs: list[Path], reports: Path, executor: Executor) -> Iterable[str]:
    futures = [executor.submit(diagnose_folder, rig, reports) for rig in rigs]
    for future in as_completed(futures):
        yield future.result()
