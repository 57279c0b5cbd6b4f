"""Which runs may stand together: two at least, none given twice."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drake_tc.config.is_file import is_file
from drake_tc.errors import LogError
from drake_tc.logs.episodes import source_of
from drake_tc.logs.record import Run


def require_two_runs(runs: Sequence[Run | Path | str], what: str = "runs") -> None:
    """Refuse fewer than two runs: one to fit, one held out.

    Raises:
        LogError: Fewer than two.
    """
    if len(runs) < 2:
        came = ", ".join(str(run.source or run.name) if isinstance(run, Run) else str(run) for run in runs) or "none"
        raise LogError(
            f"expected at least two {what}, one to fit and one held out, got {len(runs)} ({came}); record another run"
        )


def require_different_runs(runs: Sequence[Run]) -> None:
    """Refuse a run whose samples another file holds too, in whatever format.

    Raises:
        LogError: Two runs have the same samples in all columns that both have.
    """
    for number, run in enumerate(runs):
        for other in runs[:number]:
            common = set(run.columns) & set(other.columns)
            if all(np.array_equal(run.columns[c], other.columns[c]) for c in common):
                raise LogError(f"{run.source}: it holds the same samples as {other.source}; remove one of them")


def require_different_files(logs: Sequence[Path], holdout: Sequence[Path]) -> None:
    """Refuse a run that is given twice: a held-out run that was fitted says nothing, and one fitted twice counts twice.

    Files are the same if their contents are, whatever their names. All episodes of a file are no other run than one.

    Raises:
        LogError: Two of them are the same.
    """
    seen: dict[str, tuple[str, Path]] = {}
    sources = [(path, source_of(path)) for path in (*logs, *holdout)]
    for path, source in sources:
        whole = next((other for other, each in sources if each.path == source.path and each.episode is None), None)
        if source.episode is not None and whole is not None:
            raise LogError(
                f"{path}: {whole} is also given and has all episodes; give each run by its episode, as {whole.name}#0"
            )
    for option, paths in (("--log", logs), ("--holdout", holdout)):
        for path in paths:
            file, episode = source_of(path)
            if not is_file(file):
                continue  # the reader says what is wrong with it
            content = f"{hashlib.sha256(file.read_bytes()).hexdigest()}#{episode}"
            if content in seen:
                first, other = seen[content]
                same = "the same file" if other == path else f"the same content as {other}"
                raise LogError(f"{path}: given as {option}, but {same} is already given as {first}; remove one of them")
            seen[content] = (option, path)
