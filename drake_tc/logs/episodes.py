"""Files of several episodes: all of them as one log with gaps between, or one of them by `FILE#NUMBER`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from drake_tc.config.is_file import is_file, is_folder
from drake_tc.errors import LogError

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


def _span(numbers: Sequence[int]) -> str:
    whole = len(numbers) > 2 and list(numbers) == list(range(numbers[0], numbers[-1] + 1))
    return f"{numbers[0]} to {numbers[-1]}" if whole else ", ".join(map(str, numbers[:20]))
