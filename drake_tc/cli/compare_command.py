"""`drake-tc compare`: what changed since a model was made, and the history of a joint."""

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from drake_tc.cli.options import LARGEST_SEED, Force
from drake_tc.cli.out_files import result_folder
from drake_tc.cli.terminal import progress_bar
from drake_tc.errors import LogError

if TYPE_CHECKING:
    from drake_tc.watch.compare import ComparisonResult

FILES = ("report.html", "compare.json", "model_now.yaml")
EXIT_CODES = {"unchanged": 0, "parameters_changed": 1, "new_effect": 1, "cannot_tell": 3}
"""By verdict, the exit code; 2 is input that cannot be used."""


@dataclass(frozen=True, kw_only=True)
class HistoryEntry:
    """Where the session is kept, and under which unit and time."""

    history: Annotated[
        Path | None,
        typer.Option(help="Folder that keeps one record a session; history.html there shows drift and wear."),
    ] = None
    serial: Annotated[str, typer.Option(help="Serial number of the unit, for --history.")] = ""
    time: Annotated[
        datetime | None,
        typer.Option(help="When the logs were recorded, for --history. Default: when the last log was written."),
    ] = None

    def keep(self, found: "ComparisonResult", logs: list[Path]) -> list[str]:
        """Keep the session, write history.html, and return sentences on what drifts; nothing without a folder."""
        from drake_tc.config.files import write_whole
        from drake_tc.report.comparison import history_page, history_sentences
        from drake_tc.watch.history import add_session, read_history

        if self.history is None:
            return []
        written = datetime.fromtimestamp(max(each.stat().st_mtime for each in logs), UTC)
        add_session(found, self.history, self.serial, self.time or written)
        sessions = read_history(self.history)
        write_whole(self.history / "history.html", history_page(sessions))
        return [*history_sentences(sessions), f"history: {self.history / 'history.html'}"]


@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """Options of `drake-tc compare`."""

    model: Annotated[Path, typer.Option(help="Stored model with intervals: model_after.yaml of close-loop.")]
    log: Annotated[list[Path], typer.Option(help="A new run; repeat for more.")]
    rig: Annotated[
        Path | None, typer.Option(help="Rig file of the new logs. Default: the one that the model file names.")
    ] = None
    holdout: Annotated[
        list[Path] | None,
        typer.Option(help="A new run that only tests; repeat for more. Default: the last third of each log."),
    ] = None
    out: Annotated[Path, typer.Option(help="Folder for report.html, compare.json and model_now.yaml.")] = Path("out")
    session: HistoryEntry
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of what is drawn at random.")] = 0
    force: Force = False
    as_json: Annotated[bool, typer.Option("--json", help="Print compare.json to stdout instead of the tables.")] = False


def compare_command(options: CompareOptions) -> None:
    """Report what changed between a stored model and new logs of the same joint.

    The exit code is 0 if nothing changed, 1 if parameters changed or a new effect appeared, 3 if the logs cannot tell,
    and 2 on input that cannot be used.
    """
    session, log, out, held = options.session, options.log, options.out, options.holdout or []
    if session.history is None and (session.serial or session.time):
        raise LogError(f"{'--serial' if session.serial else '--time'} belongs to --history FOLDER, which is missing")
    read = [options.model, options.rig, *log, *held]
    with (
        result_folder(out, "--out", names=FILES, inputs=read, force=options.force) as folder,
        progress_bar("compare", quiet=options.as_json) as progress,
    ):
        from drake_tc.diagnosis.options import DiagnosisOptions
        from drake_tc.report.comparison import comparison_json, comparison_page
        from drake_tc.watch.compare import compare
        from drake_tc.watch.history import save_new_model

        found = compare(options.model, log, options.rig, held, DiagnosisOptions(seed=options.seed), progress)
        document = comparison_json(found)
        (folder / "compare.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        save_new_model(found, folder / "model_now.yaml", out)
        (folder / "report.html").write_text(comparison_page(found), encoding="utf-8")
    drifts = session.keep(found, log)
    if options.as_json:
        print(json.dumps(document, indent=1))
    else:
        print(found)
        for line in drifts:
            print(line)
        print(f"{found.seconds:.1f} s; report: {out / 'report.html'}")
    if EXIT_CODES[found.verdict]:
        raise typer.Exit(EXIT_CODES[found.verdict])
