"""CSV files to tables: separators, decimal commas, encodings, comments, a line of names, perhaps one of units below it.

In some files each channel has a time column of its own, as oscilloscopes and drive tools write them.

position [rad],,current [A],,          Time [s],position,Time [s],current
X,Y,X,Y,                       or      0.000,0.10,0.0000,0.5
0.000,0.10,0.0000,0.5
"""

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import islice, takewhile
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd

from drake_tc.config.files import unpacked_gzip
from drake_tc.config.quoted import quoted
from drake_tc.errors import LogError
from drake_tc.logs.files.table_forms import MISSING, of_series
from drake_tc.logs.names import meaning
from drake_tc.logs.units import is_known, is_unit, unit_named

ENDINGS = (".csv", ".csv.gz", ".tsv", ".txt")
SEPARATORS = (",", ";", "\t")
"""Of cells; the first of them that the header has."""
LINES_ABOVE = 50
"""Lines among which a header is looked for that is not the first line."""
COMMENT_MARKS = (b"#", b"%", b"//")
"""What a line of a comment begins with."""


def _is_comment(line: bytes) -> bool:
    """Whether a line of a CSV file is a comment or empty."""
    text = line.strip().lstrip(b'"')
    return not text or text.startswith(COMMENT_MARKS)


def _comments_above(content: bytes) -> list[bytes]:
    """The comments and empty lines above the names and the data."""
    found = list(takewhile(_is_comment, io.BytesIO(content)))
    return found if sum(map(len, found)) < len(content) else []


def _commented_names(comments: Sequence[bytes], below: str) -> str:
    """The names of the columns that the last comment above a row of numbers holds; empty where it holds none.

    `numpy.savetxt` writes its header so, `# time,position` above `0.0,0.1`, and `rostopic echo -p` `%time,field.name0`.
    """
    cells = _cells_of(below)
    if not comments or not any(map(_is_number, cells)):
        return ""
    text = _decoded(comments[-1]).strip().strip('"').lstrip("#%/ ")
    names = _cells_of(text)
    return text if len(names) == len(cells) > 1 and not any(map(_is_number, names)) else ""


def _separator(line: str) -> str:
    """The character that splits a header: a comma unless there is none but a semicolon or a tab."""
    return next((mark for mark in SEPARATORS if mark in line), ",")


def _cells_of(line: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line.strip()], delimiter=_separator(line)), [])]


def _decoded(line: bytes) -> str:
    """The text of a line: UTF-8, or else Windows-1252, which spreadsheets write where a name has a degree sign."""
    try:
        return line.decode("utf-8-sig")
    except UnicodeDecodeError:
        return line.decode("cp1252", errors="replace")


def _head(content: bytes, lines: int = LINES_ABOVE) -> list[str]:
    """The first lines; fewer where the content ends before."""
    return [_decoded(line) for line in islice(io.BytesIO(content), lines)]


def _first_cells(content: bytes) -> list[list[str]]:
    """The cells of the first lines."""
    lines = _head(content, FIRST_ROWS)
    return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=_separator("".join(lines[:1])))]


def _stated_units(rows: Sequence[Sequence[str]]) -> dict[str, str]:
    """By column, the units that the second line of a CSV file states; empty where it is a row of data.

    It states units if none of its cells is a number, at least half of the filled ones are units, and the next line has
    a number.
    """
    if len(rows) < 3:
        return {}
    names, second, third = rows[:3]
    filled = {name: cell.strip("[]()") for name, cell in zip(names, second, strict=False) if cell}
    if not filled or any(map(_is_number, filled.values())) or not any(map(_is_decimal, third)):
        return {}
    known = sum(is_unit(cell) or is_known(cell) for cell in filled.values())
    return filled if 2 * known >= len(filled) else {}


def _check_header_is_first(path: Path, content: bytes) -> None:
    """Refuse lines of text above the names: a first line of one cell where lines below have several."""
    lines = _head(content)
    widths = [max(line.count(mark) for mark in SEPARATORS) + 1 for line in lines]
    if max(widths, default=1) < 2 or widths[0] > 1:
        return
    header = widths.index(max(widths))
    above = "line 1" if header == 1 else f"lines 1 to {header}"
    raise LogError(
        f"{path}: expected the names of the columns in line 1, got {quoted(lines[0].strip())}; line {header + 1} has"
        f" {widths[header]} cells: remove {above}, so that the names come first"
    )


def _with_commas(path: Path, content: bytes) -> bytes:
    """The content with commas between its cells, if only blanks separate the numbers, as `numpy.savetxt` writes them.

    Raises:
        LogError: The line above the first row of numbers has another number of words.
    """
    lines = content.split(b"\n", LINES_ABOVE)[:LINES_ABOVE]
    rows = [re.split(" +", _decoded(line).strip().lstrip("#%/ ")) for line in lines]
    first = next((i for i, row in enumerate(rows) if len(row) > 1 and all(map(_is_number, row))), None)
    if first is None or re.search(rb"[,;\t]", b"\n".join(lines[first:])):
        return content
    if len(rows[max(0, first - 1)]) != len(rows[first]):
        raise LogError(
            f"{path}: the cells are separated by blanks; expected {len(rows[first])} names above {len(rows[first])}"
            f" numbers, got {len(rows[max(0, first - 1)])} words; write each name as one word, or use commas"
        )
    return re.sub(rb"(?m)(?<=[^\s#%/]) +(?=\S)", b",", re.sub(rb"(?m)^ +| +(?=\r?$)", b"", content))


def _check_names_are_words(path: Path, names: Sequence[str]) -> None:
    """Refuse a first line of numbers alone, or with a decimal fraction: a file without a header."""
    filled = [name for name in names if name]
    fractions = [name for name in filled if re.fullmatch(r"[+-]?\d*\.\d+(e[+-]?\d+)?", name, re.IGNORECASE)]
    if fractions or (filled and all(map(_is_number, filled))):
        first = quoted((fractions or filled)[0])
        raise LogError(
            f"{path}: expected the names of the columns in line 1, got numbers ({first} first);"
            " add a header line, such as time,<joint>/position"
        )


def _is_decimal(text: str) -> bool:
    """Whether a cell is a number, its decimal sign a point or a comma."""
    return _is_number(text.replace(",", ".", 1))


def _lines_above_names(content: bytes) -> int:
    """How many lines above the names say something else, such as the date and the device.

    The names are the line above the first row of numbers, or above a line of units, if they have as many cells.
    """
    lines = _head(content)
    for separator in (mark for mark in SEPARATORS if any(mark in line for line in lines)):
        rows = [[cell.strip() for cell in line.strip().split(separator)] for line in lines]
        numbers = (i for i, row in enumerate(rows) if len(row) > 1 and all(map(_is_decimal, row)))
        first = next(numbers, 0)
        names = first - 2 if first > 1 and _stated_units(rows[first - 2 : first + 1]) else first - 1
        own = rows[names] if names > 0 else []
        if len(set(own)) < len(own) == len(rows[names - 1]):  # X, Y, X, Y below the names
            return names - 1
        if len(own) == len(rows[first]) and all(own) and not any(map(_is_decimal, own)):
            return names
    return 0


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _with_decimal_points(table: pd.DataFrame, separator: str) -> pd.DataFrame:
    """The table with numbers in place of texts such as '0,25' and '1.234,5', and a note that names their columns."""
    read: dict[str, list[str]] = {"a decimal comma": [], "thousands separators": []}
    for name in table.columns:
        if not (pd.api.types.is_object_dtype(table[name].dtype) or pd.api.types.is_string_dtype(table[name].dtype)):
            continue
        cells = table[name].to_numpy(dtype=object)
        if any(not isinstance(cell, str) and not pd.isna(cell) for cell in cells):
            continue
        filled = np.array([isinstance(cell, str) and not MISSING.fullmatch(cell.strip()) for cell in cells])
        found = _numbers_of([str(cell) for cell in cells[filled]], separator)
        if found is not None:
            values, kind = found
            numbers = np.full(cells.size, np.nan)
            numbers[filled] = values
            table[name] = numbers
            read[kind].append(str(name))
    for kind, names in read.items():
        if names:
            note = f"The numbers of {', '.join(map(repr, names))} were read with {kind}."
            table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table


def _numbers_of(texts: Sequence[str], separator: str) -> tuple[list[float], str] | None:
    """The numbers of a column with commas, and what its texts have; None where they have none or do not agree.

    A text with both marks tells by the last one which is the decimal sign, and one that repeats a mark that this is the
    separator of thousands. A comma alone is a decimal sign, unless commas are between the cells.
    """
    if not any("," in text for text in texts):
        return None
    told = {"," if text.rfind(",") > text.rfind(".") else "." for text in texts if "," in text and "." in text}
    told |= {other for text in texts for mark, other in ((",", "."), (".", ",")) if text.count(mark) > 1}
    if len(told) > 1 or (not told and separator == ","):
        return None
    decimal = told.pop() if told else ","
    thousands = "." if decimal == "," else ","
    form = re.compile(rf"\s*[+-]?(\d+|\d{{1,3}}(\{thousands}\d{{3}})+)?(\{decimal}\d*)?(e[+-]?\d+)?\s*", re.IGNORECASE)
    if not all(map(form.fullmatch, texts)):
        return None
    grouped = any(thousands in text for text in texts)
    values = [float(text.replace(thousands, "").replace(decimal, ".")) for text in texts]
    return values, "thousands separators" if grouped else "a decimal comma"


_IN_BRACKETS = re.compile(r".*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*")
FIRST_ROWS = 20
"""Lines in which a layout shows."""
X_NAMES = ("x", "t", "time")
"""Small letters of what a line below the names calls the times."""


class _Pairs(NamedTuple):
    """Where the channels of such a file are.

    Attributes:
        time: Name of the time.
        channels: By channel, its name, the place of its times, and its own place.
        lines: Lines above the first row of data.
        units: By channel, what a line below the names states.
    """

    time: str
    channels: tuple[tuple[str, int, int], ...]
    lines: int
    units: Mapping[str, str] = MappingProxyType({})


def _pairs_of(rows: Sequence[Sequence[str]]) -> _Pairs | None:
    """Where the channels are, if each has times of its own; None for other files."""
    if not rows:
        return None
    return _with_a_line_of_axes(rows) or _with_repeated_times(rows[0]) or _with_named_times(rows)


def _with_a_line_of_axes(rows: Sequence[Sequence[str]]) -> _Pairs | None:
    """Names over every second column, and below them `X, Y, X, Y`."""
    if len(rows) < 2:
        return None
    below = [cell.strip("[]() ") for cell in rows[1]]
    while below and not below[-1]:
        below.pop()
    axes = [cell.lower() for cell in below]
    x, others = axes[0] if axes else "", set(axes[1::2])
    of_times = (x in X_NAMES and len(others) == 1) or (
        _is_time_unit(x) and all(each and not _is_time_unit(each) for each in others)
    )
    if len(axes) < 2 or len(axes) % 2 or set(axes[::2]) != {x} or x in others or not of_times:
        return None
    names = [*rows[0], *[""] * (len(axes) - len(rows[0]))]
    named = [(names[i], names[i + 1]) for i in range(0, len(axes), 2)]
    if _is_time_unit(x) and all(time and name for time, name in named):
        return None  # a name over each column: a line of units, which `_with_named_times` reads
    channels = tuple((name or time, 2 * i, 2 * i + 1) for i, (time, name) in enumerate(named) if time or name)
    units = {name: below[at] for name, _, at in channels} if _is_time_unit(x) else {}
    time = f"time [{x}]" if _is_time_unit(x) else "time"
    return _Pairs(time, channels, 2, units) if channels else None


def _is_time_unit(text: str) -> bool:
    return bool(unit_named(text, "time"))


def _with_named_times(rows: Sequence[Sequence[str]]) -> _Pairs | None:
    """Names of all columns, each second one of which states that it is a time: `t_pos [s],pos,t_cur [s],current`.

    The unit of all times is the same, and all of them increase in the first rows.
    """
    names, units = list(rows[0]), _stated_units(rows)
    stated = [_IN_BRACKETS.fullmatch(name) for name in names]
    told = [found[1] if found else units.get(name, "") for name, found in zip(names, stated, strict=True)]
    times, others = told[::2], told[1::2]
    if len(names) < 4 or len(names) % 2 or len(set(times)) != 1 or not _is_time_unit(times[0]):
        return None
    if any(map(_is_time_unit, others)) or not all(names):
        return None
    lines = 2 if units else 1
    data = [row[: len(names) : 2] for row in rows[lines:] if len(row) >= len(names)]
    known = all(_is_decimal(cell) for row in data for cell in row)
    increase = known and np.diff([[float(cell.replace(",", ".")) for cell in row] for row in data], axis=0) > 0.0
    if len(data) < 2 or not np.all(increase):
        return None
    channels = tuple((names[at], at - 1, at) for at in range(1, len(names), 2))
    return _Pairs(f"time [{times[0]}]", channels, lines, {name: units[name] for name, *_ in channels if name in units})


def _with_repeated_times(names: Sequence[str]) -> _Pairs | None:
    """One name that is called like a time stands before each channel, or before several of one clock."""
    repeated = {name for name, count in Counter(names).items() if name and count > 1}
    if len(repeated) != 1 or names[0] not in repeated:
        return None
    (time,) = repeated
    told = meaning(time)
    if time.lower() not in X_NAMES and (told is None or told.quantity != "time"):
        return None
    at, channels = 0, []
    for place, name in enumerate(names):
        if name == time:
            at = place
        elif name:
            channels.append((name, at, place))
    return _Pairs(time, tuple(channels), 1)


def _of_pairs(cells: pd.DataFrame, pairs: _Pairs) -> pd.DataFrame:
    """One row for each time of any channel."""
    series = []
    for name, x, y in pairs.channels:
        times = pd.to_numeric(cells.iloc[:, x], errors="coerce").to_numpy(dtype=np.float64)
        own = pd.Series(cells.iloc[:, y].to_numpy(), index=times, name=name)
        series.append(own[np.isfinite(times)])
    table = of_series(series, pairs.time)
    if pairs.units:
        table.attrs["units"] = dict(pairs.units)
    table.attrs["notes"] = [
        f"Each of the {len(series)} channels has its own time column; the rows are the times of all channels."
    ]
    return table


class _Content(NamedTuple):
    """The content of a CSV file from the names of its columns on.

    Attributes:
        text: In UTF-8, with a character between the cells.
        above: Lines above the names.
        notes: What was not read.
        skipped: The texts of the comments and of the lines above the names.
    """

    text: bytes
    above: int
    notes: tuple[str, ...]
    skipped: tuple[str, ...]


def _content(path: Path) -> _Content:
    """The content without comments, and without lines above the names that are empty or say something else.

    Where the last comment above the numbers holds the names, it is the header.
    """
    text, notes, names = _text_of(path), list[str](), ""
    above, within = _comments_above(text), list[bytes]()
    text = text[sum(map(len, above)) :]
    if any(b"\n" + mark in text for mark in COMMENT_MARKS):
        within = [line for line in io.BytesIO(text) if _is_comment(line)]
        text = b"".join(line for line in io.BytesIO(text) if not line.strip() or not _is_comment(line))
    if above or within:
        names = _commented_names(above, _head(text, 1)[0])
        text = names.encode() + b"\n" + text if names else text
    if left_out := len(above) - bool(names) + sum(1 for line in within if line.strip()):
        notes.append(f"{left_out} comment lines or empty lines were skipped.")
    lines = _lines_above_names(text)
    if lines:
        which = f"{lines} lines above the names of the columns were" if lines > 1 else "The line above the names was"
        notes.append(f"{which} skipped.")
    skipped = (*map(_decoded, (*above, *within)), *_head(text, lines))
    rest = _without_lines(text, 0, lines)
    return _Content(rest, len(above) - bool(names) + lines, tuple(notes), tuple(line.strip() for line in skipped))


def _units_above(skipped: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """By column, the units that comments and lines above the names state: one a column, or `tau: mNm` and `q [deg]`."""
    found: dict[str, str] = {}
    known = "|".join(map(re.escape, sorted(filter(None, names), key=len, reverse=True)))
    of_one = re.compile(rf"(?<![\w/.])({known})\s*(?::|=|\bin\b|[\[(])\s*([^,;:\[\]()]+?)\s*(?=[,;\])]|$)")
    for line in skipped:
        text = re.sub(r"^(#|%|//|;)*\s*(units?\s*[:=])?\s*", "", line, flags=re.IGNORECASE)
        units = [cell.strip().strip("[]()") for cell in re.split("[,;\t]", text)]
        filled = [unit for unit in units if unit]
        if len(units) == len(names) and 2 * sum(is_unit(each) or is_known(each) for each in filled) > len(filled) > 1:
            return dict(zip(names, units, strict=True))
        found |= {name: unit for name, unit in of_one.findall(text) if is_unit(unit) or is_known(unit)}
    return found


def first_line(path: Path) -> int:
    """The line of the first row of data in a text file: 2, or further down below comments and a line of units."""
    content = _content(path)
    rows = _first_cells(content.text)
    pairs = _pairs_of(rows)
    return content.above + (pairs.lines + 1 if pairs else 3 if _stated_units(rows) else 2)


def refuse_repeated(path: Path, names: list[str]) -> None:
    """Refuse a name that stands twice.

    Raises:
        LogError: names the column.
    """
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise LogError(f"{path}: column {quoted(twice)} stands more than once; give each column a name of its own")


def _check_cells(path: Path, content: bytes, separator: str, width: int) -> None:
    """Refuse single rows with more cells than the others and than the header has names; empty cells do not count.

    Where every row has a cell more than the header, the last column has no name, and is not read.
    """
    lengths: Counter[int] = Counter()
    first: dict[int, int] = {}
    text = io.TextIOWrapper(io.BytesIO(content), encoding="utf-8", errors="replace", newline="")
    for row in (rows := csv.reader(text, delimiter=separator)):
        filled = max((i + 1 for i, cell in enumerate(row) if cell.strip()), default=0)
        lengths[filled] += 1
        first.setdefault(filled, rows.line_num)
    expected = max(width, lengths.most_common(1)[0][0])
    longer = [first[length] for length in lengths if length > expected]
    if longer:
        line = min(longer)
        count = next(length for length, at in first.items() if at == line)
        raise LogError(
            f"{path}: line {line} has {count} cells, and the header {width} names; expected one cell a column"
            " (a decimal comma, or a separator inside a text, makes two of one)"
        )


def _text_of(path: Path) -> bytes:
    """The content of a file in UTF-8, unpacked where it is packed, with a character between the cells.

    Raises:
        LogError: A zero among the first bytes: UTF-32, UTF-16 without a byte-order mark, or binary data.
    """
    content = unpacked_gzip(path) if path.name.lower().endswith(".gz") else path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        content = content.decode("utf-16", errors="replace").encode()
    if b"\x00" in content[:4]:
        raise LogError(
            f"{path}: expected text in UTF-8, or in UTF-16 with a byte-order mark, got another encoding or binary data;"
            " save it as CSV in UTF-8"
        )
    return _with_commas(path, content.removeprefix(codecs.BOM_UTF8))


def read_csv(path: Path) -> pd.DataFrame:
    """The columns of a CSV file by the names of its first line, and in `attrs["units"]` those that a line below states.

    Raises:
        LogError: no text, no names, or rows of uneven length.
    """
    text, above, notes, skipped = _content(path)
    separator = _separator("".join(_head(text, 1)))
    pairs = _pairs_of(_first_cells(text))
    if pairs is None:
        table = _with_decimal_points(_cells(path, text, separator, above), separator)
    else:
        cells = pd.read_csv(io.BytesIO(_without_lines(text, 0, pairs.lines)), sep=separator, header=None)
        table = _of_pairs(_with_decimal_points(cells, separator), pairs)
    if "units" not in table.attrs and (units := _units_above(skipped, [str(name) for name in table.columns])):
        table.attrs |= {"units": units, "units_by": "a line above the names"}
    if notes:
        table.attrs["notes"] = [*notes, *table.attrs.get("notes", ())]
    return table


def _cells(path: Path, content: bytes, separator: str, above: int) -> pd.DataFrame:
    """The cells below the header as they are, with names in the encoding of the file.

    Refused are a header of numbers, and one with a name that stands twice, which pandas would rename in silence.
    """
    _check_header_is_first(path, content)
    rows = _first_cells(content)
    names, units = rows[0] if rows else [], _stated_units(rows)
    _check_names_are_words(path, names)
    refuse_repeated(path, [name for name in names if name])
    table = _rows(path, _without_lines(content, 1, 2) if units else content, separator)
    own = [names[i] if "\ufffd" in str(name) and i < len(names) else name for i, name in enumerate(table.columns)]
    table.columns = pd.Index(own)
    if units:
        table.attrs["units"] = units
        note = f"Line {above + 2} of the file states units and was not read as a sample."
        table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table


def _without_lines(content: bytes, first: int, end: int) -> bytes:
    """The content without the lines from `first` up to, and without, `end`."""
    lines = content.split(b"\n", end)
    return b"\n".join(lines[:first] + lines[end:])


def _rows(path: Path, content: bytes, separator: str) -> pd.DataFrame:
    try:
        return with_texts(pd.read_csv(io.BytesIO(content), sep=separator, engine="pyarrow"))
    except (pd.errors.ParserError, ValueError):
        # rows of uneven length, or bytes that are not UTF-8: the C parser drops what lies beyond the header
        header = pd.read_csv(io.BytesIO(content), sep=separator, nrows=0, index_col=False, encoding_errors="replace")
        _check_cells(path, content, separator, header.shape[1])
        return pd.read_csv(
            io.BytesIO(content),
            sep=separator,
            skipinitialspace=True,
            index_col=False,
            usecols=list(range(header.shape[1])),
            low_memory=False,
            encoding_errors="replace",
        )


def with_texts(table: pd.DataFrame) -> pd.DataFrame:
    """The table with texts in place of bytes, which Arrow keeps where they are not UTF-8.

    Raises:
        ArrowException: Texts that are declared as UTF-8 and are not.
    """
    for name in table.columns[[pd.api.types.is_string_dtype(kind) for kind in table.dtypes]]:
        table[name] = table[name].to_numpy(dtype=object)
    for name in table.columns[[pd.api.types.is_object_dtype(kind) for kind in table.dtypes]]:
        table[name] = [c.decode("utf-8", errors="replace") if isinstance(c, bytes) else c for c in table[name]]
    return table
