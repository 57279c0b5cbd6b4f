"""`drake-tc compare`: what changed since a model was made, and the history of a joint."""

import json
from pathlib import Path
from typing import Annotated

import typer

from drake_tc.cli.out_files import Force, result_folder
from drake_tc.cli.terminal import progress_bar
from drake_tc.cli.usage import LARGEST_SEED
from drake_tc.errors import LogError

FILES = ("report.html", "compare.json")
EXIT_CODES = {"unchanged": 0, "parameters_changed": 1, "new_effect": 1, "cannot_tell": 3}
"""By verdict, the exit code; 2 is input that cannot be used."""


def compare_command(
    model: Annotated[Path, typer.Option(help="Stored model with intervals: model_after.yaml of close-loop.")],
    log: Annotated[list[Path], typer.Option(help="A new run; repeat for more.")],
    rig: Annotated[
        Path | None, typer.Option(help="Rig file of the new logs. Default: the one that the model file names.")
    ] = None,
    holdout: Annotated[
        list[Path] | None,
        typer.Option(help="A new run that only tests; repeat for more. Default: the last third of each log."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for report.html and compare.json.")] = Path("out"),
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of what is drawn at random.")] = 0,
    force: Force = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print compare.json to stdout instead of the tables.")
    ] = False,
) -> None:
    """Report what changed between a stored model and new logs of the same joint.

    The exit code is 0 if nothing changed, 1 if parameters changed or a new effect appeared, 3 if the logs cannot tell,
    and 2 on input that cannot be used.
    """
    read = [model, rig, *log, *(holdout or [])]
    with (
        result_folder(out, "--out", names=FILES, inputs=read, force=force, error=LogError) as folder,
        progress_bar("compare", quiet=as_json) as progress,
    ):
        from drake_tc.diagnosis.options import DiagnosisOptions
        from drake_tc.report.comparison import comparison_json, comparison_page
        from drake_tc.watch.compare import compare

        found = compare(model, log, rig, holdout or [], DiagnosisOptions(seed=seed), progress)
        document = comparison_json(found)
        (folder / "compare.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        (folder / "report.html").write_text(comparison_page(found), encoding="utf-8")
    if as_json:
        print(json.dumps(document, indent=1))
    else:
        print(found)
        print(f"{found.seconds:.1f} s; report: {out / 'report.html'}")
    if EXIT_CODES[found.verdict]:
        raise typer.Exit(EXIT_CODES[found.verdict])
