"""Draw, diagnose, score: `python -m tests.benchmarks.hard --seed N --count 100 --folder F`."""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

from tests.benchmarks.hard import score
from tests.benchmarks.hard.draw import draw
from tests.benchmarks.hard.files import write

Diagnose = Callable[[Path, Path], None]


def hard_benchmark(
    folder: Path,
    seed: int,
    count: int,
    executor: Executor | None,
    diagnose: Diagnose,
    only: Sequence[str] = (),
) -> list[score.Outcome]:
    """Outcomes of `count` rigs of a seed, with their files in `folder`.

    `diagnose(rig_folder, reports_folder)` writes reports_folder/NAME/report.json and can be pickled. An exception is
    written as the message of a refused rig. `only` names the rigs to draw and diagnose anew.
    """
    names = [f"rig_{number:03d}" for number in range(count)]
    if unknown := sorted(set(only) - set(names)):
        raise ValueError(f"no rig {', '.join(unknown)}; the rigs are {names[0]} to {names[-1]}")
    numbers = [number for number, name in enumerate(names) if not only or name in only]
    one = partial(_one, folder, seed, diagnose)
    list(executor.map(one, numbers) if executor else map(one, numbers))
    return score.outcomes(folder, names)


def _one(folder: Path, seed: int, diagnose: Diagnose, number: int) -> None:
    drawn = draw(seed, number)
    write(drawn, folder)
    reports, name = folder / "reports", drawn.rig.name
    (reports / name).mkdir(parents=True, exist_ok=True)
    report = reports / name / "report.json"
    report.unlink(missing_ok=True)
    try:
        diagnose(folder / "rigs" / name, reports)
    except Exception as error:
        report.write_text(json.dumps({"error": f"{type(error).__name__}: {error}"}) + "\n", encoding="utf-8")


def close_loop_on(rig: Path, reports: Path) -> None:
    """Write the library's report, and in it the intervals of the final model's parameters under `final_parameters`."""
    from drake_tc.diagnosis.run import close_loop
    from drake_tc.report.data_files import result_json

    logs = sorted(rig.glob("run_*.csv"))
    holdout = [path for path in logs if path.name.startswith("run_held_")]
    result = close_loop(rig / "rig.yaml", [path for path in logs if path not in holdout], holdout)
    document = result_json(result)
    for name, joint in result.joints.items():
        document["joints"][name]["final_parameters"] = {
            effect: {key: {"value": one.value, "ci95": list(one.ci95)} for key, one in parameters.items()}
            for effect, parameters in joint.final_parameters.items()
        }
    (reports / rig.name / "report.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
