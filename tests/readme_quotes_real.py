"""Cells of the README files' tables that quote a benchmark on real data, by the benchmark.

A cell holds numbers, compared as in `readme_tables`, and perhaps `yes` or `no` for what is met.
"""

import re
from collections.abc import Callable, Iterable, Mapping

from readme_tables import assert_quoted, row

from drake_tc.report.figure_row import FigureRow
from tests.benchmarks import real_bam, real_dfki, real_icub, real_tmotor, real_uart

DIAGNOSIS, BASE = "drake_tc/diagnosis/README.md", "drake_tc/estimation/base/README.md"
PERCENT = 100.0

Rows = Mapping[str, FigureRow]
Quote = tuple[str, str, int, Callable[[Rows], list[float | bool]]]
"""File, beginning of the row, cell, and what stands in it: numbers in order, and what `yes` and `no` say."""


def each(*names: str, times: float = 1.0) -> Callable[[Rows], list[float | bool]]:
    """The values of these rows."""
    return lambda rows: [times * rows[name].value for name in names]


def expected(*names: str) -> Callable[[Rows], list[float | bool]]:
    """What these rows have to reach."""
    return lambda rows: [rows[name].expected for name in names]


def met(*names: str) -> Callable[[Rows], list[float | bool]]:
    """Whether all these rows reach it."""
    return lambda rows: [all(bool(rows[name].met) for name in names)]


def told_of(name: str) -> Callable[[Rows], list[float | bool]]:
    """The size that the row's note tells, as in `of 0.315 N*m`."""
    return lambda rows: [float(rows[name].note.split()[1])]


def constant(*values: float) -> Callable[[Rows], list[float | bool]]:
    """Published values, which no benchmark computes."""
    return lambda rows: list(values)


def both(*parts: Callable[[Rows], list[float | bool]]) -> Callable[[Rows], list[float | bool]]:
    """One after the other."""
    return lambda rows: [value for part in parts for value in part(rows)]


def _bam() -> Iterable[Quote]:
    folders = {f"XL330, {kp}": f"xl330_kp{kp}" for kp in real_bam.GAINS} | {"STS3250, 32": "sts3250_kp32"}
    for shown, folder in folders.items():
        for cell, model in enumerate(("refined", "after", "before", "published"), start=1):
            yield DIAGNOSIS, f"{shown} |", cell, each(f"{folder}/{model}")
        yield DIAGNOSIS, f"{shown} |", 5, expected(f"{folder}/refined")


def _dfki() -> Iterable[Quote]:
    shown = dict(zip(real_dfki.GOOD, ("ddp", "direct collocation", "energy shaping", "SAC"), strict=True))
    cases = [(f"{text}, alone", f"{name}_alone_held_out/{name}") for name, text in shown.items()]
    for case, first, second in (
        ("optimal_control_held_out", "ddp", "direct_collocation"),
        ("energy_shaping_held_out", "energy_shaping", "sac"),
    ):
        for one, other in ((first, second), (second, first)):
            cases.append((f"{shown[one]}, with {shown[other]}", f"{case}/{one}"))
    for text, name in cases:
        for cell, what in ((1, "whole"), (2, "band"), (3, "in_band")):
            yield DIAGNOSIS, f"{text} |", cell, each(f"{name}/{what}")
        yield DIAGNOSIS, f"{text} |", 4, met(f"{name}/in_band")
    for name, text in shown.items():
        begin = f"fits of {text} |"
        yield DIAGNOSIS, begin, 1, each(f"{name}/own_fit")
        yield DIAGNOSIS, begin, 2, each(f"{name}/fit_of_others")
        yield DIAGNOSIS, begin, 3, each(f"{name}/own_share", f"{name}/others_share")
        yield DIAGNOSIS, f"one more for {text} |", 1, each(f"{name}/with_ripple")
        yield DIAGNOSIS, f"one more for {text} |", 2, each(f"{name}/one_effect_more")


def _tmotor() -> Iterable[Quote]:
    for name in real_tmotor.CASES:
        limits = f"limits of {name} |"
        yield DIAGNOSIS, limits, 1, each(f"{name}/best_fit_ratio")
        yield DIAGNOSIS, limits, 2, each(f"{name}/repeats_within", f"{name}/repeats_between")
        yield DIAGNOSIS, limits, 3, each(f"{name}/offset")
        yield DIAGNOSIS, limits, 4, each(*(f"{name}/training/{o}" for o in real_tmotor.CASES if o != name))
        yield DIAGNOSIS, f"{name} |", 5, each(f"{name}/found_model_zeroed")
        found = f"{name}/found_model"
        for cell, what in (
            (1, each(f"{name}/published_model")),
            (2, each(found)),
            (3, expected(found)),
            (4, met(found)),
        ):
            yield DIAGNOSIS, f"{name} |", cell, what


def _uart() -> Iterable[Quote]:
    for stand in real_uart.STANDS:
        for joint in stand.held:
            begin, name = f"{stand.folder}, {joint} |", f"{stand.folder}/{joint}"
            loaded, unloaded = f"{name}/loaded_span", f"{name}/unloaded_span"
            yield DIAGNOSIS, begin, 1, each(loaded)
            yield DIAGNOSIS, begin, 2, expected(loaded)
            yield DIAGNOSIS, begin, 3, each(unloaded)
            yield DIAGNOSIS, begin, 4, expected(unloaded)
            yield DIAGNOSIS, begin, 5, both(met(loaded), met(unloaded))


def _icub() -> Iterable[Quote]:
    run = real_icub.LONG
    for begin, whats in (("x, y, z [m]", ("x", "y", "z")), ("yaw [deg]", ("yaw",))):
        yield BASE, begin, 1, constant(*(real_icub.PUBLISHED[what] for what in whats))
        yield BASE, begin, 2, expected(*(f"{run}/{what}" for what in whats))
    for begin, whats in (
        ("x, y, z [m]", ("x", "y", "z")),
        ("yaw [deg]", ("yaw",)),
        ("roll, pitch [deg]", ("roll", "pitch")),
    ):
        yield BASE, begin, 3, each(*(f"{run}/{what}" for what in whats))
        yield BASE, begin, 4, each(*(f"{run}/foot_centre_{what}" for what in whats))


BENCHES: dict[str, Callable[[], Iterable[Quote]]] = {
    "real-bam": _bam,
    "real-dfki": _dfki,
    "real-tmotor": _tmotor,
    "real-uart": _uart,
    "real-icub": _icub,
}


def differing_cells(bench: str, rows: Rows) -> list[str]:
    """What the cells that quote this benchmark contradict, one text each; empty where all agree with `rows`."""
    found = []
    for file, begin, cell, values in BENCHES[bench]():
        try:
            _assert_cell(row(file, begin)[cell], values(rows), f"{file}: {begin}, cell {cell}")
        except AssertionError as error:
            found.append(str(error))
    return found


def _assert_cell(cell: str, values: list[float | bool], what: str) -> None:
    assert_quoted(cell, [value for value in values if not isinstance(value, bool)], what)
    verdicts = ["yes" if value else "no" for value in values if isinstance(value, bool)]
    assert re.findall(r"\b(?:yes|no)\b", cell) == verdicts, f"{what}: {cell!r}, but computed: {', '.join(verdicts)}"
