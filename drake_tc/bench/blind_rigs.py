"""`bench diagnosis`: simulated rigs, written as files, diagnosed from the files alone, scored against the truth."""

import json
from collections.abc import Iterable
from concurrent.futures import Executor, as_completed
from pathlib import Path

from drake_tc.blind.catalogue import Scale, catalogue
from drake_tc.blind.generate import generate
from drake_tc.blind.score import BenchmarkScore, score_reports
from drake_tc.diagnosis.run import close_loop
from drake_tc.diagnosis.search import Progress
from drake_tc.diagnosis.to_json import result_json
from drake_tc.errors import DrakeTcError

HELD_OUT = "run_multisine"


def diagnose_folder(rig: Path, reports: Path) -> str:
    """Diagnose one rig's files and write `reports/NAME/report.json`; returns the rig's name.

    A rig that the tool refuses leaves a report without joints, which scores as wrong.
    """
    logs = sorted(p for p in rig.iterdir() if p.name.startswith("run_"))
    held = [p for p in logs if p.name.startswith(HELD_OUT)]
    try:
        report = result_json(close_loop(rig / "rig.yaml", [p for p in logs if p not in held], held))
    except DrakeTcError as error:
        report = {"schema": 1, "verdict": "no_missing_effect", "joints": {}, "error": str(error)}
    out = reports / rig.name
    out.mkdir(parents=True, exist_ok=True)
    (out / "report.json").write_text(json.dumps(report) + "\n", encoding="utf-8")
    return rig.name


def blind_benchmark(folder: Path, scale: Scale, seed: int, executor: Executor, progress: Progress) -> BenchmarkScore:
    """Make the rigs in `folder` unless they are there, diagnose each, score all.

    Args:
        folder: Gets rigs/, truth/ and reports/; rigs made before with the same scale and seed are used again.
        scale: "smoke" (about 30 rigs) or "full" (over 300).
        seed: Of the catalogue.
        executor: Diagnoses rigs side by side.
        progress: report(text, share).
    """
    specs = catalogue(scale, seed)
    stamp = folder / "catalogue.json"
    wanted = {"scale": scale, "seed": seed, "rigs": len(specs)}
    if not (stamp.exists() and json.loads(stamp.read_text(encoding="utf-8")) == wanted):
        generate(specs, folder, lambda done, total: progress(f"simulating rig {done} of {total}", 0.4 * done / total))
        stamp.write_text(json.dumps(wanted), encoding="utf-8")
    rigs = sorted((folder / "rigs").iterdir())
    for number, name in enumerate(_diagnosed(rigs, folder / "reports", executor), start=1):
        progress(f"diagnosed {name}, {number} of {len(rigs)}", 0.4 + 0.6 * number / len(rigs))
    return score_reports(folder / "truth", folder / "reports")


def _diagnosed(rigs: list[Path], reports: Path, executor: Executor) -> Iterable[str]:
    futures = [executor.submit(diagnose_folder, rig, reports) for rig in rigs]
    for future in as_completed(futures):
        yield future.result()
