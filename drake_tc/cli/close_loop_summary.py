"""What `drake-tc close-loop` prints: what was found, the trial of an export, and where the report is."""

import sys
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from drake_tc.cli.terminal import print_wide
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.report.sections import cells, headings
from drake_tc.report.summary import say, say_result


def print_summary(result: CloseLoopResult, out: Path) -> None:
    """Verdict and one table a joint on stdout."""
    console = Console(file=sys.stdout, highlight=False)
    say_result(console, result)
    _print_export(console, result)
    console.print(f"{result.seconds:.1f} s; report: {out / 'report.html'}")


def _print_export(console: Console, result: CloseLoopResult) -> None:
    """Errors of the exported model beside those of the model, and what its simulator lacks."""
    if result.export is None:
        return
    trial = result.export
    title = f"RMS position error of free runs, {trial.model_file}"
    print_wide(
        headings(trial.rows, trial.runner),
        cells(trial.rows, {name: joint.units for name, joint in result.joints.items()}),
        left=("joint", "run"),
        title=title,
    )
    for loss in trial.losses:
        say(console, f"  {escape(loss)}")
