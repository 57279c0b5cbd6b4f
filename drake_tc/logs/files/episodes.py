"""Several runs: in one file, as one log with gaps between or as `FILE#NUMBER`, and the sets that a command takes.

Of a set, two at least may stand together, none given twice.

Data sets of LeRobot, versions 2 and 3: Parquet files of frames, whose lists `meta/info.json` names.

    meta/info.json                        features: by column, the names of the members of its lists; fps
    data/chunk-000/episode_000000.parquet     version 2: one episode a file
    data/chunk-000/file-000.parquet           version 3: several episodes a file

`observation.state` holds positions and `action` position commands; a member `elbow.pos` names its quantity itself.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow.parquet  # type: ignore[import-untyped]

from drake_tc.config.files import check_size, is_file, is_folder
from drake_tc.errors import LogError
from drake_tc.logs.names import meaning, names_joints, time_among
from drake_tc.logs.record import MIN_ROWS, Run

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
    """The table of one episode, by its number, or those of all after each other with gaps of the clock between.

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


def with_times_told(episodes: Sequence[pd.DataFrame], source: Source, expected: str) -> pd.DataFrame:
    """The table of one of these episodes, or those of all after each other; each has a column of times.

    Raises:
        LogError: No times; says what was `expected`.
    """
    time = time_among(map(str, episodes[0].columns))
    if time is None:
        raise LogError(f"{source.path}: {len(episodes)} episodes without times; expected {expected}")
    return one_log(dict(enumerate(episodes)), time, source)


def episodes_of_arrays(arrays: Mapping[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """By episode, the arrays of a file whose arrays are (E, T, n) or (T, E, n), or whose times are (E, T).

    Other arrays belong to each, unless they have as many samples: then all are of one run. What follows the last time
    that grows is padding. Where no time tells which axis is which, the second one is the time, or the first one if the
    second one is too short for it.
    """
    values = {name: np.squeeze(value) for name, value in arrays.items()}
    stacks = {value.shape[:2] for value in values.values() if value.ndim == 3}
    called = time_among(values)
    time = None if called is None else values[called]
    if time is not None and time.ndim == 2 and (not stacks or stacks == {time.shape}):
        shape, along = time.shape, int(np.all(time[:, 1] > time[:, 0]))
    elif len(stacks) == 1 and (time is None or time.ndim == 1):
        (shape,) = stacks
        along = int(time.size == shape[1]) if time is not None else int(shape[1] >= MIN_ROWS)
        beside = [
            value for value in values.values() if value.ndim < 3 and value.shape[:2] != shape and value is not time
        ]
        if (time is not None and time.size != shape[along]) or any(shape[along] in value.shape for value in beside):
            return []
    else:
        return []
    out = []
    for number in range(shape[1 - along]):
        own = {
            name: value.take(number, axis=1 - along) if value.shape[:2] == shape else arrays[name]
            for name, value in values.items()
        }
        kept = shape[along]
        if time is not None and time.ndim == 2:
            still = np.flatnonzero(~(np.diff(time.take(number, axis=1 - along)) > 0.0))
            kept = int(still[0]) + 1 if still.size else kept
        out.append({name: value[:kept] if values[name].shape[:2] == shape else value for name, value in own.items()})
    return out


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
    time = time_among(names) or names[0]
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


INFO = Path("meta") / "info.json"
"""Of a data set, relative to its folder."""
TIME, EPISODE = "timestamp", "episode_index"
NORMALISED, MOST_RADIANS = 100.0, 4.0 * np.pi
"""LeRobot's normalised positions lie within the first; those in rad within the second."""
SHARES_HINT = (
    "All positions lie within ±100. LeRobot writes the positions of many arms as a share of each joint's calibrated"
    " range, from -100 to 100, unless degrees were asked for: write the factor to rad of each joint under `units:`."
)
PICTURES = ("image", "video")
"""Types of features that are no signals."""


def is_data_set(path: Path) -> bool:
    """Whether a path is the folder of a LeRobot data set."""
    return is_folder(path) and (path / INFO).is_file()


def read_data_set(source: Source) -> pd.DataFrame:
    """The frames of a data set, of all episodes or of one.

    Raises:
        LogError: No Parquet files, files that cannot be read, or no such episode.
    """
    files = sorted((source.path / "data").rglob("*.parquet"))
    if not files:
        raise LogError(f"{source.path}: a LeRobot data set without data/**/*.parquet; copy its data folder, too")
    if source.episode is not None:
        named = [file for file in files if file.stem == f"episode_{source.episode:06d}"]
        files = named or files
    tables = [_frames(file) for file in files]
    table = _of_episodes(pd.concat(tables, ignore_index=True) if len(tables) > 1 else tables[0], source)
    positions = [name for name in table.columns if str(name).endswith(("/pos", "/position"))]
    largest = float(table[positions].abs().to_numpy().max(initial=0.0)) if positions else 0.0
    if MOST_RADIANS < largest <= NORMALISED:
        table.attrs["hints"] = [*table.attrs.get("hints", ()), SHARES_HINT]
    return table


def _frames(path: Path) -> pd.DataFrame:
    with path.open("rb") as file:
        about = pyarrow.parquet.read_metadata(file)
        check_size(path, path.stat().st_size, 8.0 * about.num_rows * about.num_columns)
        file.seek(0)
        return pd.read_parquet(file)


def without_lists(table: pd.DataFrame, source: Source) -> pd.DataFrame:
    """The table of a Parquet file with each column of lists (n a row) as n columns; others stay.

    Members have the names that the data set's `meta/info.json` gives them, without them numbers.

    Raises:
        LogError: Lists of different lengths in one column, or no such episode.
    """
    objects = [name for name in table.columns if pd.api.types.is_object_dtype(table[name])]
    lists = [name for name in objects if _has_lists(table[name])]
    return _of_episodes(table, source) if lists else with_episodes_apart(table, source)


def _of_episodes(table: pd.DataFrame, source: Source) -> pd.DataFrame:
    info = _info(source.path)
    features = info.get("features")
    flat = _flat(table, features if isinstance(features, dict) else {}, source.path)
    if EPISODE not in flat or (flat[EPISODE].nunique() < 2 and source.episode is None):
        return flat
    if TIME not in flat:
        fps = info.get("fps")
        if not isinstance(fps, int | float) or fps <= 0:
            raise LogError(f"{source.path}: no column {TIME!r} and no fps in {INFO}; expected one of them")
        flat[TIME] = flat.groupby(EPISODE).cumcount() / fps
    numbers = flat[EPISODE].to_numpy(dtype=np.int64)
    episodes = {int(number): flat[numbers == number] for number in np.unique(numbers)}
    return one_log(episodes, TIME, source)


def _flat(table: pd.DataFrame, features: Mapping[str, Any], path: Path) -> pd.DataFrame:
    """Lists as columns, without pictures."""
    parts: list[pd.DataFrame] = []
    called = next((list(table[name].iloc[0]) for name in table if _names_the_joints(str(name), table[name])), None)
    for name in table.columns:
        feature = features.get(str(name), {})
        feature = feature if isinstance(feature, dict) else {}
        if feature.get("dtype") in PICTURES:
            continue
        column = table[name]
        if _names_the_joints(str(name), column):
            continue
        if not _has_lists(column):
            parts.append(table[[name]])
            continue
        lengths = column.dropna().map(len)
        if lengths.nunique() > 1:
            raise LogError(
                f"{path}: column {name!r} holds lists of {lengths.min()} to {lengths.max()} numbers; expected one"
                " length"
            )
        size = int(lengths.iloc[0])
        names = [_name(str(name), member) for member in _members(feature.get("names", called), size)]
        values = np.array([np.full(size, np.nan) if row is None else row for row in column], dtype=np.float64)
        parts.append(pd.DataFrame(values, columns=names, index=table.index))
    return pd.concat(parts, axis=1)


def _has_lists(column: pd.Series) -> bool:
    """Whether the cells that are not missing are lists."""
    known = column.dropna() if pd.api.types.is_object_dtype(column) else column[:0]
    return len(known) > 0 and bool(known.map(_is_list).all())


def _is_list(value: Any) -> bool:
    return isinstance(value, list | np.ndarray) and all(np.isscalar(each) for each in value)


def _names_the_joints(name: str, column: pd.Series) -> bool:
    """Whether all cells are the same list of the joints' names."""
    return names_joints(name) and _has_lists(column) and column.map(str).nunique() == 1


def _name(column: str, member: str) -> str:
    """The column of a joint: `elbow.pos` of `observation.state` is `elbow/pos`, of `action` it is `elbow/pos_command`.

    A member that names no quantity is a joint, and the column names the quantity: `elbow` of `observation.state` is
    `elbow/position`, of `action` it is `elbow/position_command`, of `observation.effort` it is `elbow/effort`.
    """
    joint, _, quantity = member.rpartition(".")
    if not joint or meaning(quantity) is None:
        joint, quantity = (f"joint_{member}" if member.isdigit() else member), ""
    if column == "action":
        return f"{joint}/{quantity or 'position'}_command"
    if column == "observation.state":
        return f"{joint}/{quantity or 'position'}"
    last = column.rpartition(".")[2]
    told = meaning(last)
    return f"{joint}/{last}" if told is not None and not told.joint else f"{column}/{member}"


def _members(names: Any, size: int) -> list[str]:
    """Names of the members of a list; some data sets have them below a key such as "motors", or by their number."""
    if isinstance(names, dict) and names and all(isinstance(value, int) for value in names.values()):
        names = sorted(names, key=lambda name: int(names[name]))
    while isinstance(names, dict) or (isinstance(names, list) and len(names) == 1 and isinstance(names[0], list)):
        names = next(iter(names.values()), None) if isinstance(names, dict) else names[0]
    if isinstance(names, list) and len(names) == size and all(isinstance(name, str) for name in names):
        return list(names)
    return [str(i) for i in range(size)]


def _info(path: Path) -> dict[str, Any]:
    """`meta/info.json` of the data set, in the folder or in one above the file; nothing where there is none."""
    resolved = path.resolve()
    for folder in (resolved, *resolved.parents):
        if (folder / INFO).is_file():
            try:
                found = json.loads((folder / INFO).read_text(encoding="utf-8"))
            except (OSError, ValueError):
                return {}
            return found if isinstance(found, dict) else {}
    return {}
