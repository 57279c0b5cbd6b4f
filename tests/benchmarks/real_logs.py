"""`bench real-logs`: `close-loop` on public logs as a new user would call it, and whether what it claims holds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from drake_tc.diagnosis.options import DiagnosisOptions
from drake_tc.diagnosis.run import close_loop
from drake_tc.errors import DrakeTcError, IdentificationError, ParamsError
from drake_tc.report.data_files import result_json
from tests.benchmarks.figures import BenchmarkRow
from tests.benchmarks.real_log_cases import (
    CaseFiles,
    RealLogCase,
    RealLogSet,
    case_files,
    import_set,
    load_sets,
)
from tests.benchmarks.real_log_claims import FLOORS, CaseClaims, claims_of

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class SetClaims:
    """One data set: its cases, or why it was not read."""

    name: str
    cases: tuple[CaseClaims, ...]
    not_readable: str = ""


def chosen_sets(names: Sequence[str] = ()) -> list[RealLogSet]:
    """The committed sets of these names, all where none is given.

    Args:
        names: "SET", or "SET/CASE" for the cases alone whose names begin with CASE.

    Raises:
        ParamsError: An unknown set or case; lists those there are.
    """
    sets = load_sets()
    if not names:
        return list(sets.values())
    chosen: dict[str, RealLogSet] = {}
    for name in names:
        of, _, begin = name.partition("/")
        if of not in sets:
            raise ParamsError(f"no data set {of!r} has rig files; sets: {', '.join(sets)}")
        cases = tuple(case for case in sets[of].cases if case.name.startswith(begin))
        if begin and not cases:
            raise ParamsError(f"no case of {of} begins with {begin!r}; {_listed(sets[of])}")
        already = chosen[of].cases if of in chosen else ()
        both = tuple(case for case in sets[of].cases if case in (*already, *cases))
        chosen[of] = replace(sets[of], cases=both)
    return [chosen[name] for name in sets if name in chosen]


def _listed(entry: RealLogSet) -> str:
    return f"cases: {', '.join(case.name for case in entry.cases)}" if entry.cases else "it has no cases"


def _reports(files: CaseFiles) -> tuple[dict[str, Any], dict[str, dict[str, Any]], str]:
    """report.json with all held-out runs, with each of them alone, by file name, and a note on runs that cannot be.

    The search sees the training runs only, but confirmation withdraws an effect that some held-out run speaks against.
    The model of a call with one held-out run can therefore have effects that the model of the first call lacks, and the
    error of a run is that of its own call. What is left is only evaluated in the first call. A run that is too short to
    be held out alone is evaluated together with the others.
    """
    whole = result_json(close_loop(files.rig, files.log, files.holdout))
    names = _distinct_names(files.holdout)
    if len(names) == 1:
        return whole, {names[0]: whole}, ""
    quick, alone, short = DiagnosisOptions(assess_residual=False), {}, []
    for path, name in zip(files.holdout, names, strict=True):
        try:
            alone[name] = result_json(close_loop(files.rig, files.log, [path], quick))
        except IdentificationError:
            short.append(name)
    note = f"Not held out alone, as it moves too little: {', '.join(short)}." if short else ""
    return whole, {"all held-out runs": whole} | alone if short else alone, note


def _distinct_names(paths: Sequence[Path]) -> list[str]:
    """File names, with their folders where two are the same."""
    names = [path.name for path in paths]
    return [
        f"{path.parent.name}/{name}" if names.count(name) > 1 else name for path, name in zip(paths, names, strict=True)
    ]


def run_case(chosen: RealLogSet, case: RealLogCase, logs: Path, scratch: Path) -> CaseClaims:
    """Call `close-loop` on one case; input that it refuses is a result too."""
    name = f"{chosen.name}/{case.name}"
    try:
        whole, alone, note = _reports(case_files(chosen, case, logs, scratch))
    except DrakeTcError as error:
        return CaseClaims(name, "refused", refusal=str(error), note=case.note)
    return claims_of(name, whole, alone, " ".join(text for text in (case.note, note) if text))


def real_log_claims(
    data: Path,
    names: Sequence[str] = (),
    progress: Progress = lambda text, share: None,
    finished: Callable[[CaseClaims], None] = lambda case: None,
) -> list[SetClaims]:
    """Run every case of the chosen sets.

    Args:
        data: Folder of public data sets.
        names: As for `chosen_sets`. A set that is not in `data` is left out with the reason where they are empty.
        progress: Told which case runs.
        finished: Given every case as soon as it is done.

    Raises:
        ParamsError: An unknown set or case.
        LogError: A set that was asked for by name is not in `data`.
    """
    sets = chosen_sets(names)
    total, done = max(1, sum(len(entry.cases) for entry in sets)), 0
    out = []
    for entry in sets:
        if entry.not_readable:
            out.append(SetClaims(entry.name, (), entry.not_readable))
            continue
        with TemporaryDirectory() as folder:
            scratch = Path(folder)
            try:
                logs = import_set(entry, data, scratch)
            except DrakeTcError as error:
                if names:
                    raise
                out.append(SetClaims(entry.name, (), str(error)))
                done += len(entry.cases)
                continue
            cases = []
            for case in entry.cases:
                progress(f"{entry.name}/{case.name}", done / total)
                cases.append(run_case(entry, case, logs, scratch))
                finished(cases[-1])
                done += 1
            out.append(SetClaims(entry.name, tuple(cases)))
    return out


def rows_of(sets: Sequence[SetClaims]) -> list[BenchmarkRow]:
    """The figures of the benchmark: how many claims do not hold, and the error over the floor on every run."""
    rows = []
    for case in (case for entry in sets for case in entry.cases if case.verdict != "refused"):
        false, against = len(case.failures), len(case.disagreements)
        rows.append(BenchmarkRow(f"{case.name}/claims_not_held", false, "-", 0.0, "max", note="; ".join(case.failures)))
        rows.append(
            BenchmarkRow(
                f"{case.name}/verdict_contradicted", against, "-", 0.0, "max", note="; ".join(case.disagreements)
            )
        )
        for joint in case.joints:
            for run in (joint.train, *joint.heldout):
                name = f"{case.name}/{joint.joint}/{run.name}/floors"
                rows.append(BenchmarkRow(name, run.ratio, "-", note=f"{case.verdict}; green up to {FLOORS:g}"))
    return rows
