"""`drake-tc export --ranges`: how far each parameter may be randomised, in the file of a simulator or as samples."""

import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from drake_tc.cli.export_options import ExportOptions, Target
from drake_tc.cli.out_files import result_file
from drake_tc.cli.terminal import print_wide
from drake_tc.config.quoted import json_value
from drake_tc.errors import ParamsError

if TYPE_CHECKING:
    from drake_tc.exchange.ranges.posterior import Posterior
    from drake_tc.exchange.ranges.program import TermRanges

TARGETS_OF_RANGES = ("mjlab", "isaaclab", "playground", "parquet")
PROJECTED = 600
"""Draws that are projected into the terms of a simulator."""


def export_ranges(options: ExportOptions) -> None:
    """Write the ranges, and print the distributions with what the logs could not show.

    Args:
        options: Of the command.

    Raises:
        ParamsError: a target without ranges, Parquet without a file, or files that cannot be used.
    """
    from drake_tc.exchange.ranges.posterior import posterior_of
    from drake_tc.exchange.ranges.program import as_document, save_samples
    from drake_tc.exchange.ranges.unit import read_unit

    to, out, samples_only = options.to.value, options.out, options.to is Target.parquet
    if to not in TARGETS_OF_RANGES:
        raise ParamsError(f"export --ranges: expected --to {', '.join(TARGETS_OF_RANGES)}, got --to {to}")
    if samples_only and out is None:
        raise ParamsError("export --ranges --to parquet: expected --out FILE.parquet, got none")
    first, units = read_unit(options.model, options.report), options.unit or ()
    for name in options.joint or ():
        if name not in first.models:
            raise ParamsError(f"{options.model}: no joint {name!r}; joints: {', '.join(first.models)}")
    posterior = posterior_of([first, *(read_unit(each) for each in units)], options.joint)
    document = as_document(posterior) | {"name": "export", "to": to}
    text, ranges = "", list["TermRanges"]()
    if not samples_only:
        text, ranges = _program(options, posterior)
        document["terms"] = {each.joint: _terms(each) for each in ranges}
        document["losses"] = _losses(to, ranges)
    if out is not None:
        inputs = [options.model, options.report, *units]
        with result_file(out, "--out", inputs=inputs, force=options.force) as path:
            if samples_only:
                save_samples(posterior, path, options.samples, options.seed)
            else:
                path.write_text(text, encoding="utf-8")
    if options.as_json:
        print(json.dumps(json_value(document | {"file": out and str(out)}), indent=1))
        return
    if out is None:
        sys.stdout.write(text)
    _print(posterior, ranges, options)


def _program(options: ExportOptions, posterior: "Posterior") -> "tuple[str, list[TermRanges]]":
    from drake_tc.exchange.ranges.posterior import draws
    from drake_tc.exchange.ranges.program import term_ranges
    from drake_tc.exchange.ranges.simulators import to_isaaclab_events, to_mjlab, to_playground

    to = options.to.value
    drawn = draws(posterior, PROJECTED, options.seed)
    recorded = options.runs.speeds(list(posterior.unit.models))
    ranges = term_ranges(posterior, to, drawn, recorded, options.servo.torque_constant)
    writer = {"mjlab": to_mjlab, "isaaclab": to_isaaclab_events, "playground": to_playground}[to]
    return writer(posterior, ranges), ranges


def _losses(to: str, ranges: "Sequence[TermRanges]") -> list[str]:
    """Sentences on what the simulator cannot express, of which the ranges have nothing."""
    from drake_tc.exchange.projection import TARGETS
    from drake_tc.exchange.trial import sentences

    return sentences([each.projection for each in ranges], TARGETS[to]) if ranges else []


def _terms(each: "TermRanges") -> dict[str, Any]:
    return {
        name: {
            "unit": each.unit(name),
            "law": of.law,
            "value": of.value,
            "deviation": of.deviation,
            "central95": list(of.interval),
        }
        for name, of in each.distributions.items()
    } | {"correlation": each.correlation.tolist()}


def _print(posterior: "Posterior", ranges: "Sequence[TermRanges]", options: ExportOptions) -> None:
    """The tables of the parameters and of the simulator's terms, what was not shown, and the notes."""
    from drake_tc.exchange.ranges.program import interval_text, row_text

    to, shown = options.to.value, options.shown
    rows = [
        (
            each.joint,
            ".".join(each.key),
            f"{each.distribution.value:.4g}",
            interval_text(each.distribution),
            each.unit,
            each.distribution.law,
            ", ".join(f"{name} {size:.2g}" for name, size in each.parts.items() if size > 0.0),
        )
        for found in posterior.unit.estimated.values()
        for each in found
    ]
    names = ("joint", "parameter", "value", "95 %", "unit", "law", "standard deviations")
    print_wide(names, rows, left=(*names[:2], *names[4:]), title="Parameters of the model, by the logs", file=shown)
    if ranges:
        terms = [
            (each.joint, name, f"{of.value:.4g}", interval_text(of), each.unit(name), of.law)
            for each in ranges
            for name, of in each.distributions.items()
        ]
        heads = ("joint", "term", "value", "95 %", "unit", "law")
        print_wide(heads, terms, left=(*heads[:2], *heads[4:]), title=f"The same in the parameters of {to}", file=shown)
    for title, found in (("The logs could not show:", False), ("Looked for and not found; larger is ruled out:", True)):
        lines = [row_text(each) for each in posterior.not_shown if each.found_above is found]
        if lines:
            print(title, *(f"  {line}" for line in lines), sep="\n", file=shown)
    for note in (*_losses(to, ranges), *posterior.notes):
        print(note, file=shown)
    if options.out is not None:
        print(options.out, file=shown)
