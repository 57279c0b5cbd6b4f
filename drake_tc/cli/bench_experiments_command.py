"""`drake-tc bench check` and `bench experiments`: promises of checks and designs held against simulated truth."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from drake_tc.cli.bench_seeds import ALL_CORES, AsJson, Jobs, Out, Seeds, by_seed
from drake_tc.cli.bench_table import print_rows
from drake_tc.cli.progress import progress_bar
from drake_tc.report.figure_row import FigureRow, rows_json

if TYPE_CHECKING:
    from drake_tc.experiments.evidence.load_loop import LoadCase
    from drake_tc.experiments.evidence.loop import LoopCase


def bench_check(
    kind: Annotated[list[str] | None, typer.Option(help="Effect, such as stribeck; repeat. Default: all.")] = None,
    strength: Annotated[
        list[float] | None,
        typer.Option(min=1e-6, help="Strength of the effects, 1 for the middle one; repeat. Default: 0.04, 0.3 and 1."),
    ] = None,
    out: Out = None,
    seed: Seeds = None,
    jobs: Jobs = ALL_CORES,
    as_json: AsJson = False,
) -> None:
    """Count whether the diagnosis finds the effects that a check predicts to be visible, and no others."""
    from drake_tc.experiments.evidence.predicted import STRENGTHS, prediction_rows, predictions

    strengths = tuple(dict.fromkeys(strength or STRENGTHS))

    found = by_seed(
        "bench check",
        seed,
        out,
        jobs,
        lambda folder, number, pool, report: predictions(folder, kind or (), number, pool, report, strengths),
        quiet=as_json,
    )
    every = [each for part in found.values() for each in part]
    rows = prediction_rows(every)
    if as_json:
        print(json.dumps(rows_json("check", rows) | {"rigs": [asdict(each) for each in every]}))
        return
    print_rows("", rows, as_json=False)
    for each in every:
        if (each.predicted == "seen") != each.found and each.predicted != "between":
            named = ", ".join(each.named) or "nothing"
            print(f"{each.name}: {each.size:.3g}, found from {each.smallest:.3g}; named: {named}")


def bench_experiments(
    seed: Annotated[int, typer.Option(help="Seed of the joints, motions and noise.")] = 1,
    pair: Annotated[list[int] | None, typer.Option(help="Number of a pair, from 0; repeat. Default: all.")] = None,
    size: Annotated[
        float, typer.Option(min=0.01, help="Factor by which the sizes of all effects are multiplied.")
    ] = 1.0,
    loads: Annotated[
        bool, typer.Option("--loads", help="Pairs that motions hardly separate, designed with known loads as well.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Count how often a designed experiment, and how often a sinusoid, separates two effects that logs left open."""
    from drake_tc.experiments.evidence.load_loop import load_rows, run_load_cases
    from drake_tc.experiments.evidence.loop import decided_rows, run_cases
    from drake_tc.experiments.evidence.pairs import LOAD_PAIRS, PAIRS

    known = LOAD_PAIRS if loads else PAIRS
    pairs = [known[i].scaled(size) for i in (pair or range(len(known)))]
    rows: list[FigureRow]
    with progress_bar("bench experiments", quiet=as_json) as progress:
        if loads:
            with_loads = run_load_cases(pairs, seed, progress)
            rows, cases = load_rows(with_loads), [asdict(case) for case in with_loads]
            lines = [_load_line(case) for case in with_loads]
        else:
            without = run_cases(pairs, seed, progress)
            rows, cases, lines = decided_rows(without), [asdict(case) for case in without], list(map(_line, without))
    if as_json:
        print(json.dumps(rows_json("experiments", rows) | {"cases": cases}))
        return
    print_rows("", rows, as_json=False)
    print("\n".join(lines))


def _line(case: "LoopCase") -> str:
    words = case.refusal or (
        f"after the designed run: {case.designed} (predicted probability {case.predicted:.2f}); "
        f"after the sinusoid: {case.default}"
    )
    return f"{case.truth} against {case.other}: after the first logs: {case.first}; {words}"


def _load_line(case: "LoadCase") -> str:
    without = f"{case.unloaded} (predicted probability {case.predicted_unloaded:.2f})"
    loaded = f"{case.loaded} (predicted probability {case.predicted:.2f})"
    return (
        f"{case.truth} against {case.other}: after the first logs: {case.first}; "
        f"without loads: {case.refusal or without}; with loads: {case.loads_refusal or loaded}"
    )
