"""The report as one self-contained HTML file: text, tables, plots and the script of some plots; nothing is fetched.

A page of many joints and runs stays below 4 MB: each plot gets a share of its bytes. The script is uPlot (Leon Sorokin,
MIT licence, 120 kB), as the package `uplot-python` ships it; it draws time series on a canvas. The licence lets it be
part of generated files as long as its notice stays, which stands at the top of the script.
"""

import difflib
import json
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup, escape

from drake_tc import __version__
from drake_tc.config.files import utf8_text, write_whole
from drake_tc.diagnosis.result.joint_result import JointResult
from drake_tc.diagnosis.result.rig_result import CloseLoopResult
from drake_tc.errors import DrakeTcError
from drake_tc.report import tables, words
from drake_tc.report.equation import model_equations
from drake_tc.report.notes import next_experiment, note_sentences, set_up_sentences, warnings
from drake_tc.report.numbers import fold, percent, scale_for, significant
from drake_tc.report.plots.residual_plots import LEGEND, CloudLook, leftover_plots, residual_cards, signature_plots
from drake_tc.report.plots.rows import MOST_POINTS
from drake_tc.report.plots.spectrum import correlation_plots, spectrum_plot
from drake_tc.report.plots.svg import PIXELS_PER_INCH
from drake_tc.report.plots.time_plots import effort_plot, position_plot
from drake_tc.report.sections import (
    closed_loop_section,
    export_section,
    links_section,
    refinement_section,
    shared_section,
)

SAMPLE_BYTES = 16
"""Of one sample of a trace: time, measured value and two errors, as text, and what surrounds them."""
TRACE_BYTES = 1_900_000
"""Of all traces of a page."""
MOST_SAMPLES, LEAST_SAMPLES = 6000, 60
"""Of one trace: two for each pixel of a wide screen and some to zoom into, and what still shows the motion."""
FULL_JOINTS = 1.5
"""Joints up to which clouds are drawn with all that a plot shows; more joints share as much."""

TRAIN_JOINTS = 4
"""Joints up to which the residual of the training runs is drawn against every signal too."""


@dataclass(frozen=True)
class PageBudget:
    """Sizes of a page's plots.

    Attributes:
        trace_samples: Samples of one trace of one run.
        held, train: Look of the clouds of the held-out and of the training runs; None where these are left out.
    """

    trace_samples: int
    held: CloudLook
    train: CloudLook | None

    @classmethod
    def of(cls, joints: int, traces: int) -> "PageBudget":
        """The sizes for a page with so many joints and traces."""
        each = TRACE_BYTES // (SAMPLE_BYTES * max(traces, 1))
        samples = min(MOST_SAMPLES, max(LEAST_SAMPLES, each))
        share = min(1.0, FULL_JOINTS / max(joints, 1))
        sharpness = round(PIXELS_PER_INCH * share**0.5)
        held, train = (CloudLook(round(n * share), sharpness) for n in (MOST_POINTS, MOST_POINTS // 2))
        return cls(samples, held, train if joints <= TRAIN_JOINTS else None)


PACKAGE = "uplot-python"
SCRIPT, STYLE = "uplot/static/uPlot.iife.js", "uplot/static/uPlot.min.css"


def plot_script() -> str:
    """The library's script without comments and indentation, its notice kept; it defines `uPlot`, fetches nothing.

    Raises:
        DrakeTcError: the package is not installed.
    """
    lines = (line.strip() for line in _text(SCRIPT).splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//")).replace("</script", "<\\/script")


def plot_style() -> str:
    """The library's style sheet.

    Raises:
        DrakeTcError: the package is not installed.
    """
    return _text(STYLE)


def _text(name: str) -> str:
    """A file of the package; read without importing it, as its import loads IPython."""
    try:
        path = Path(str(distribution(PACKAGE).locate_file(name)))
    except PackageNotFoundError:
        raise DrakeTcError(f"the report needs the package {PACKAGE}: pip install {PACKAGE}") from None
    return path.read_text(encoding="utf-8")


def model_diff(before: str, after: str, context: int = 3) -> Sequence[tables.Row]:
    """Lines of the unified difference of two texts, with what became of them; empty when they are the same.

    Args:
        before: Text of the model file before.
        after: The same after.
        context: Unchanged lines to keep around a change.
    """
    kinds = {"@": "place", "+": "added", "-": "removed", " ": "kept"}
    names, lines = 2, list(difflib.unified_diff(before.splitlines(), after.splitlines(), n=context, lineterm=""))
    return [{"kind": kinds[line[0]], "text": line if line[0] == "@" else line[1:]} for line in lines[names:]]


CODE = re.compile(r"`([^`]+)`")
"""What a sentence quotes as code."""


def write_report(result: CloseLoopResult, path: Path, executor: Executor | None = None) -> None:
    """Write the report of a whole call to `path`: one HTML file (UTF-8) that needs nothing else.

    Args:
        result: Of the call.
        path: File to write.
        executor: Draws panels beside each other; None draws them here.
    """
    write_whole(path, render(result, executor))


def render(result: CloseLoopResult, executor: Executor | None = None) -> str:
    """The report's HTML; `executor` as in `write_report`."""
    environment = Environment(
        loader=DictLoader(_templates()),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"svg": Markup, "percent": percent, "significant": significant}
    budget = _budget(result)
    joints = [_joint(joint, f"j{i}", budget, executor) for i, joint in enumerate(result.joints.values())]
    plots = [plot for j in joints for plot in (j["effort_plot"], j["position_plot"]) if plot is not None]
    data = json.dumps({p.id: p.data for p in plots}, separators=(",", ":"))
    page = environment.get_template("report.html.jinja").render(
        style=Markup(_file("report.css")),
        plot_style=Markup(plot_style() if plots else ""),
        scripts=[Markup(plot_script()), Markup(_file("time_plots.js"))] if plots else [],
        plot_data=Markup(data.replace("<", "\\u003c")),  # no `<` in it can end the script element
        version=__version__,
        verdict=words.verdict_words(result),
        joints=joints,
        train=[_short(p) for p in result.train_files],
        heldout=[_short(p) for p in result.heldout_files],
        rig=_short(result.rig_file),
        seconds=significant(result.seconds),
        difference=model_diff(result.model_before_yaml, result.model_after_yaml),
        has_models=bool(result.model_before_yaml or result.model_after_yaml),
        legend=LEGEND,
        shared=shared_section(result),
        links=links_section(result.links, wrong_set_up=result.has_wrong_set_up),
        notes=note_sentences(result.notes),
        ranking=[(words.title_of(name), where, percent(gain)) for name, where, gain in words.ranked_effects(result)],
        set_up=[Markup(CODE.sub(r"<code>\1</code>", str(escape(line)))) for line in set_up_sentences(result.set_up)],
        closed=closed_loop_section(result),
        export=export_section(result.export, {name: joint.units for name, joint in result.joints.items()}),
    )
    return utf8_text(page)


def _budget(result: CloseLoopResult) -> PageBudget:
    joints = result.joints.values()
    traces = sum(len(j.train.samples.runs) + len(j.heldout.samples.runs) + len(j.free_run) for j in joints)
    return PageBudget.of(len(joints), traces)


def _file(name: str) -> str:
    return (files("drake_tc.report") / name).read_text(encoding="utf-8")


def _templates() -> Mapping[str, str]:
    folder = files("drake_tc.report")
    return {f.name: f.read_text(encoding="utf-8") for f in folder.iterdir() if f.name.endswith(".jinja")}


def _short(path: str) -> str:
    """A file's name without its folders, of either kind of path."""
    return re.split(r"[\\/]", path)[-1]


def _joint(joint: JointResult, prefix: str, budget: PageBudget, executor: Executor | None) -> dict[str, Any]:
    """What the template shows of one joint."""
    held = residual_cards(joint, joint.heldout, f"{prefix}-held", budget.held, executor)
    train = (
        [] if budget.train is None else residual_cards(joint, joint.train, f"{prefix}-train", budget.train, executor)
    )
    tried, barred = tables.rejected_rows(joint.rejected)
    scale = scale_for(joint.after.heldout, joint.unit)
    left = joint.unexplained
    parameters = tables.parameter_rows(joint)
    correlograms, correlated = correlation_plots(joint.heldout, prefix)
    return {
        "id": prefix,
        "name": joint.joint,
        "unit": joint.unit,
        "units": joint.units,
        "verdict": joint.verdict,
        "verdict_words": words.verdict_words(joint),
        "headline": words.headline(joint),
        "warnings": warnings(joint),
        "effects": [
            {
                "title": e.title,
                "id": e.id,
                "gain": percent(e.heldout_gain),
                "stability": percent(e.stability),
                "contribution": scale_for(e.contribution, joint.unit).quantity(e.contribution),
                "sizes": [row for row in parameters if row["key"] == e.key],
            }
            for e in joint.effects
        ],
        "fold": fold(joint.before.heldout, joint.after.heldout),
        "set_up_wrong": joint.set_up_wrong,
        "errors": tables.error_table(joint),
        "run_errors": tables.run_error_rows(joint),
        "signatures": signature_plots(joint, prefix, budget.held),
        "spectrum": spectrum_plot(joint, prefix),
        "correlations": correlograms,
        "correlated": words.correlation_words(correlated, left),
        "effort_plot": effort_plot(joint, prefix, budget.trace_samples),
        "position_plot": position_plot(joint, prefix, budget.trace_samples),
        "equations": model_equations(joint),
        "free_runs": tables.free_run_table(joint),
        "refinement": refinement_section(joint),
        "parameters": parameters,
        "did_not_hold": tables.did_not_hold_rows(joint.did_not_hold),
        "tried": tried,
        "barred": barred,
        "indistinguishable": [(words.title_of(a), words.title_of(b)) for a, b in joint.indistinguishable],
        "next_experiment": next_experiment(joint),
        "left": {
            "fraction": percent(left.fraction),
            "structure": words.structure_words(left),
            "sentence": " ".join(
                filter(None, (words.capital(words.unexplained(joint)), words.remainder_sentence(joint)))
            ),
            "depends_on": words.dependence_words(left),
            "confined_to": left.confined_to,
            "line": "none" if left.period_hz is None else f"{significant(left.period_hz)} Hz",
            "explainable": scale.quantity(left.explainable_rms),
            "floors": significant(words.floors_left(joint), 2),
            "share": percent(left.share_of_signal),
            "band": words.band_sentence(joint),
            "shaded": joint.shared_band is not None and joint.shared_band.limit_hz > 0.0,
        },
        "leftovers": leftover_plots(joint, prefix, budget.held),
        "notes": note_sentences(joint.notes, joint.units),
        "runs": [*tables.data_rows(joint.train, "training"), *tables.data_rows(joint.heldout, "held-out")],
        "facts": tables.data_facts(joint),
        "held_cards": [drawing.card() for drawing in held],
        "train_cards": [drawing.card() for drawing in train],
    }
