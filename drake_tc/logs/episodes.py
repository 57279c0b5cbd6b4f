"""Several runs: in one file, as one log with gaps between or as `FILE#NUMBER`, and the sets that a command takes.

Of a set, two at least may stand together, none given twice.
"""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from drake_tc.config.files import is_file, is_folder
from drake_tc.errors import LogError
from drake_tc.logs.inspection.names import meaning
from drake_tc.logs.record import Run

GAP_SECONDS, GAP_PERIODS = 1.0, 20.0
"""Between two episodes in one log, the larger of the two: the readers split a run at gaps of more than 5 periods."""


class Source(NamedTuple):
    """What a path names.

    Attributes:
        path: The file or folder.
        episode: The number of an episode in it; None for all.
    """

    path: Path
    episode: int | None = None


def source_of(path: Path) -> Source:
    """The file and the episode that `FILE#NUMBER` names, if there is no file of that name itself."""
    name, mark, number = path.name.rpartition("#")
    if not mark or not number.isdigit() or is_file(path) or is_folder(path):
        return Source(path)
    return Source(path.with_name(name), int(number)) if name else Source(path)


def one_log(episodes: Mapping[int, pd.DataFrame], time: str, source: Source) -> pd.DataFrame:
    """The table of one episode, or those of all after each other with gaps of the clock between.

    Args:
        episodes: By number, the tables with the same columns.
        time: Name of their times [s].
        source: Which of them.

    Raises:
        LogError: no episode of this number, or none at all.
    """
    path, number = source
    if not episodes:
        raise LogError(f"{path}: no episodes; expected at least one")
    if number is not None and number not in episodes:
        raise LogError(f"{path}: no episode {number}; episodes here: {_span(list(episodes))}")
    if number is not None or len(episodes) == 1:
        return episodes[number if number is not None else next(iter(episodes))].reset_index(drop=True)
    parts, start = [], 0.0
    for table in episodes.values():
        own = table[time].to_numpy(dtype=np.float64)
        period = float(np.median(np.diff(own))) if own.size > 1 else 0.0
        own = start + own - own[0] if own.size else own
        parts.append(table.assign(**{time: own}))
        start = (float(own[-1]) if own.size else start) + max(GAP_SECONDS, GAP_PERIODS * period)
    joined = pd.concat(parts, ignore_index=True)
    joined.attrs["notes"] = [
        f"The log has {len(episodes)} episodes ({_span(list(episodes))}), with gaps of the clock between them;"
        f" {path.name}#{next(iter(episodes))} is the first episode alone."
    ]
    return joined


NUMBERS = ("episode", "episode_index", "episode_id", "episode_number")
"""Names of a column that numbers the episodes."""


def with_episodes_apart(table: pd.DataFrame, source: Source) -> pd.DataFrame:
    """The table of one episode, or of all; gaps are put between them where their times begin anew.

    Raises:
        LogError: an episode is asked for, and the table has no column that numbers them, or not this one.
    """
    names = [str(name) for name in table.columns]
    number = next((name for name in names if name.lower() in NUMBERS), None)
    values = None if number is None else pd.to_numeric(table[number], errors="coerce").to_numpy(np.float64)
    if values is None or not np.all(values == np.round(values)):
        if source.episode is None:
            return table
        raise LogError(f"{source.path}: no episodes in this file; expected the file without #{source.episode}")
    time = next((name for name in names if (told := meaning(name)) is not None and told.quantity == "time"), names[0])
    stamps = pd.to_numeric(table[time], errors="coerce").to_numpy(np.float64)
    if source.episode is None and not np.any(np.diff(stamps)[np.diff(values) != 0.0] < 0.0):
        return table
    return one_log({int(each): table[values == each] for each in np.unique(values)}, time, source)


def _span(numbers: Sequence[int]) -> str:
    whole = len(numbers) > 2 and list(numbers) == list(range(numbers[0], numbers[-1] + 1))
    return f"{numbers[0]} to {numbers[-1]}" if whole else ", ".join(map(str, numbers[:20]))


def require_two_runs(runs: Sequence[str]) -> None:
    """Refuse fewer than two runs: one to fit, one held out.

    Raises:
        LogError: Fewer than two.
    """
    if len(runs) < 2:
        came = ", ".join(runs) or "none"
        raise LogError(
            f"expected at least two runs, one to fit and one held out, got {len(runs)} ({came}); record another run"
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
