"""JSON logs: columns, records, or one record a line.

    {"time": [0.0, 0.01], "knee": {"position": [0.1, 0.2]}}                      columns
    [{"time": 0.0, "knee/position": 0.1}, {"time": 0.01, "knee/position": 0.2}]  records
    {"mass": 0.5, "entries": [{"time": 0.0}, {"time": 0.01}]}                    records under one key
    {"hz": 100, "data": [{"q": [0.1, 0.2, ...]}, {"q": [0.0, 0.1, ...]}]}        episodes of columns
    {"columns": ["time", "q"], "data": [[0.0, 0.1], [0.01, 0.2]]}                rows, as pandas writes them
    {"time": {"0": 0.0, "1": 0.01}, "q": {"0": 0.1, "1": 0.2}}                   columns by row number, likewise

Fields of a nested mapping become `outer/inner`; a vector in each sample becomes `name_0, name_1, ...`; single values
beside the samples are no columns. A list `joint_names` or `name` of texts names the members of vectors of its length:
`{"name": ["hip", "knee"], "position": [0.1, 0.2]}` has `hip/position` and `knee/position`. A value that a record lacks,
and `null`, is missing.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, TypeGuard

import pandas as pd

from drake_tc.config.files import unpacked_gzip
from drake_tc.config.quoted import quoted
from drake_tc.errors import LogError
from drake_tc.logs.checks.clock import stated_period, with_times
from drake_tc.logs.files.episodes import Source, with_times_told
from drake_tc.logs.names import member, names_joints, time_among
from drake_tc.logs.record import MIN_ROWS

FORMS = "a mapping of columns {name: [values]}, or a list of records [{name: value}, ...]"


def _units(document: Any) -> dict[str, str]:
    """The texts of a mapping `units` beside the samples, by the columns that they are of."""
    own = document.get("units") if isinstance(document, dict) else None
    return {name: text for name, text in _leaves("", own) if isinstance(text, str)} if isinstance(own, dict) else {}


def read_json(path: Path, episode: int | None = None) -> pd.DataFrame:
    """A table of a .json or .json.gz file; see this module for the forms.

    Args:
        path: Of the file.
        episode: Number of the only episode to read, from 0; None for all.

    Raises:
        LogError: Not JSON, none of the forms, a name twice in one mapping, columns of different lengths, or no such
            episode.
    """
    text = _text(path)
    document = _by_joint(_listed(_lines(text, path) if _has_lines(text) else _parsed(text, path)))
    table = _table_of(document, Source(path, episode))
    if units := _units(document):
        own = {str(name): units.get(str(name), units.get(str(name).rpartition("/")[2], "")) for name in table.columns}
        table.attrs |= {"units": own, "units_by": "'units'"}
    return table


def _table_of(document: Any, source: Source) -> pd.DataFrame:
    path, episode = source
    records = document if isinstance(document, list) else _records_inside(document)
    period = stated_period(_numbers(document))
    if records and all(map(_is_episode, records)):
        return _of_episodes(records, period, Source(path, episode))
    if episode is not None:
        raise LogError(f"{path}: no episodes in this file; expected the file without #{episode}")
    if records is not None:
        return with_times(_of_records(records, path, _joints(document)), period)
    if not isinstance(document, dict):
        raise LogError(f"{path}: expected {FORMS}, got {_kind(document)}")
    return with_times(_of_columns(document, path), period)


def _leaves(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """(name, value) of all that nested mappings hold: lists, and single values."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(f"{prefix}/{name}" if prefix else name, inner)
    else:
        yield prefix, value


def _numbers(document: Any) -> dict[str, float]:
    """The single numbers in nested mappings, by name."""
    leaves = _leaves("", document)
    return {name: float(x) for name, x in leaves if isinstance(x, int | float) and not isinstance(x, bool)}


def _lists(document: Any) -> dict[str, list[Any]]:
    """The lists of samples in nested mappings, by name."""
    return {name: values for name, values in _leaves("", document) if isinstance(values, list)}


MOST_JOINTS = 128
OF_JOINTS = ("joints", "motors", "servos", "actuators", "axes", "drives", "dofs", "arms", "legs", "limbs")
"""Keys of lists of joints; the entries of other lists, such as episodes, may have names too."""


def _listed(value: Any) -> Any:
    """Nested values, with lists in place of mappings from row numbers, and records of `columns` and `data`."""
    if not isinstance(value, dict):
        return value
    if value and list(value) == [str(number) for number in range(len(value))]:
        return [_listed(inner) for inner in value.values()]
    names, rows = value.get("columns"), value.get("data")
    if _are_names(names) and isinstance(rows, list) and all(isinstance(r, list) and len(r) == len(names) for r in rows):
        return [dict(zip(names, row, strict=True)) for row in rows]
    return {name: _listed(inner) for name, inner in value.items()}


def _by_joint(value: Any) -> Any:
    """Nested values, where a list of joints that each have a name of their own is a mapping of these names.

    `{"joints": [{"name": "hip", "q": 0.1}, {"name": "knee", "q": 0.2}]}` is `{"joints": {"hip": {"q": 0.1}, ...}}`.
    """
    if not isinstance(value, dict):
        return value
    out = {}
    for name, inner in value.items():
        if isinstance(inner, list) and 0 < len(inner) <= MOST_JOINTS and all(isinstance(each, dict) for each in inner):
            listed = name.lower().endswith(OF_JOINTS)
            keys = [key for key in inner[0] if key.lower() in ("joint", "joint_name") or (listed and names_joints(key))]
            called = next(
                ([each.get(key) for each in inner] for key in keys if _are_names([e.get(key) for e in inner])), None
            )
            if called is not None:
                inner = dict(
                    zip(called, ({k: v for k, v in each.items() if k not in keys} for each in inner), strict=True)
                )
        out[name] = _by_joint(inner)
    return out


def _joints(document: Any) -> list[str]:
    """The texts of the first list that names joints in nested mappings; none where there is none."""
    named = (values for name, values in _leaves("", document) if names_joints(name) and _are_names(values))
    return next(named, [])


def _are_names(values: Any) -> TypeGuard[list[str]]:
    return (
        isinstance(values, list) and all(isinstance(each, str) for each in values) and len(set(values)) == len(values)
    )


def _is_episode(record: object) -> bool:
    """Whether a record holds lists of samples, and not the values of one sample."""
    if not isinstance(record, dict):
        return False
    stamped = time_among(_numbers(record)) is not None
    lengths = [len(values) for values in _lists(record).values()]
    return not stamped and bool(lengths) and min(lengths) >= MIN_ROWS


def _of_episodes(records: Sequence[dict[str, Any]], period: float | None, source: Source) -> pd.DataFrame:
    episodes = []
    for record in records:
        table = with_times(_of_columns(record, source.path), stated_period(_numbers(record)) or period)
        table.attrs = {}  # the same notes for each
        episodes.append(table)
    expected = 'a list of times in each, or the rate in each or beside them, such as "hz": 100'
    return with_times_told(episodes, source, expected)


def read_json_lines(path: Path) -> pd.DataFrame:
    """A table of a .jsonl file: one record per line. Empty lines, and a last line that is cut off, are skipped.

    Raises:
        LogError: A line that is not a JSON mapping: names the line.
    """
    text = _text(path).rstrip()
    whole, _, last = text.rpartition("\n")
    cut = bool(whole) and last.startswith("{") and not last.endswith("}")
    table = _of_records(_lines(whole if cut else text, path), path)
    table.attrs["notes"] = ["The last line is cut off and was left out."] if cut else []
    return table


def _lines(text: str, path: Path) -> list[Any]:
    lines = enumerate(text.splitlines(), start=1)
    return [_parsed(line, path, number) for number, line in lines if line.strip()]


def _has_lines(text: str) -> bool:
    """Whether the first two lines that are not empty are a mapping each, as in a .jsonl file."""
    lines = [line.strip() for line in islice(text.strip().splitlines(), 2)]
    return len(lines) == 2 and all(line.startswith("{") and line.endswith("}") for line in lines)


def _text(path: Path) -> str:
    content = unpacked_gzip(path) if path.name.lower().endswith(".gz") else path.read_bytes()
    return content.decode("utf-8-sig")


def _parsed(text: str, path: Path, line: int | None = None) -> Any:
    def mapping(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            twice = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
            raise LogError(
                f"{path}: {quoted(twice)} stands more than once in one mapping; give each column a name of its own"
            )
        return found

    try:
        return json.loads(text, object_pairs_hook=mapping) if text.strip() else []
    except json.JSONDecodeError as error:
        where = f"line {line or error.lineno}, column {error.colno}"
        raise LogError(f"{path}: not valid JSON at {where}: {error.msg}; write the file again") from None
    except RecursionError:
        raise LogError(f"{path}: expected {FORMS}, got mappings or lists inside each other without end") from None


def _records_inside(document: object) -> list[Any] | None:
    """The only list of records in a mapping; None where there is none or there are several."""
    if not isinstance(document, dict):
        return None
    lists = [value for value in document.values() if isinstance(value, list) and value and isinstance(value[0], dict)]
    return lists[0] if len(lists) == 1 else None


def _of_records(records: Sequence[Any], path: Path, joints: Sequence[str] = ()) -> pd.DataFrame:
    rows = []
    for number, record in enumerate(records, start=1):
        if not isinstance(record, dict):
            raise LogError(f"{path}: row {number} is {_kind(record)}; expected a mapping {{name: value}} a sample")
        rows.append(sample(record, joints))
    return pd.DataFrame.from_records(rows)


def sample(record: Mapping[str, Any], joints: Sequence[str] = ()) -> dict[str, Any]:
    """The plain values of one sample by name; `joints` name the members of vectors of their number."""
    return dict(_values("", _by_joint(record), joints))


def _values(prefix: str, value: Any, joints: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """(name, value) of the plain values in one sample; `joints` name the members of vectors of their number."""
    if isinstance(value, dict):
        own = next((each for name, each in value.items() if names_joints(name) and _are_names(each)), joints)
        for name, inner in value.items():
            if inner is not own:
                yield from _values(f"{prefix}/{name}" if prefix else name, inner, own)
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from _values(member(prefix, number, len(value), joints), inner, joints)
    else:
        yield prefix, value


def _of_columns(document: Mapping[str, Any], path: Path) -> pd.DataFrame:
    columns: dict[str, list[Any]] = {}
    joints, lists = _joints(document), _lists(document)
    rows = len(lists.get(time_among(lists) or "", ()))
    for name, values in lists.items():
        if values is joints:
            continue
        if not any(isinstance(value, list | dict) for value in values):
            columns[name] = values
            continue
        if len(values) != rows and all(isinstance(each, list) and len(each) == rows for each in values):
            values = [list(row) for row in zip(*values, strict=True)]  # a row for each joint
        width = len(values[0]) if isinstance(values[0], list) else 0
        for row, value in enumerate(values, start=1):
            if isinstance(value, dict) or (len(value) if isinstance(value, list) else 0) != width:
                expected = f"{width} values as in row 1" if width else "one value, or a list of values in every row"
                raise LogError(f"{path}: column {name!r}: row {row} holds {_kind(value)}; expected {expected}")
        columns |= {member(name, at, width, joints): [value[at] for value in values] for at in range(width)}
    if not columns and document:
        raise LogError(f"{path}: expected {FORMS}, got a mapping without a list: {', '.join(list(document)[:5])}")
    table = pd.DataFrame(_one_length(columns, path))
    short = [name for name in columns if name not in table]
    if short:
        table.attrs["notes"] = [f"Lists that are shorter than a log were left out: {', '.join(short)}."]
    return table


def _one_length(columns: dict[str, list[Any]], path: Path) -> dict[str, list[Any]]:
    lengths = {name: len(values) for name, values in columns.items()}
    rows = lengths.get("time", max(lengths.values(), default=0))
    for name, count in lengths.items():
        if count != rows and (count >= MIN_ROWS or rows < MIN_ROWS):
            raise LogError(
                f"{path}: column {name!r} has {count} rows where the others have {rows}; save one row a sample"
            )
    return {name: values for name, values in columns.items() if len(values) == rows}


def _kind(value: object) -> str:
    """A value as messages name it."""
    if isinstance(value, list):
        return f"a list of {len(value)} values"
    return "a mapping" if isinstance(value, dict) else f"the value {json.dumps(value)[:40]}"
