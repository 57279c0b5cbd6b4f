"""CSV files to tables: separators, decimal commas, encodings, comments, and a line of units below the names."""

import csv
import io
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import IO, NamedTuple

import pandas as pd

from drake_tc.config.quoted import quoted
from drake_tc.errors import LogError
from drake_tc.logs.csv_header import (
    COMMENT_MARKS,
    LONGEST_LINE,
    SEPARATORS,
    cells,
    check_encoding,
    check_header_is_first,
    check_names_are_words,
    commented_names,
    comments_above,
    decoded,
    is_comment,
    stated_units,
)
from drake_tc.logs.csv_pairs import of_pairs, pairs_of
from drake_tc.logs.decimal_comma import with_decimal_points
from drake_tc.logs.sizes import unpacked_gzip

Opener = Callable[[], IO[bytes]]
ENDINGS = (".csv", ".csv.gz", ".tsv")


class _Content(NamedTuple):
    """The content of a CSV file from the names of its columns on.

    Attributes:
        opened: Opens it.
        above: Lines above the names.
        notes: What was not read.
    """

    opened: Opener
    above: int
    notes: tuple[str, ...]


def _content(path: Path) -> _Content:
    """The content without comments and without empty lines above the names.

    Where the last comment above the numbers holds the names, it is the header.
    """
    opened = _opener(path)
    with opened() as file:
        content = file.read()
    check_encoding(path, content[:4])
    above = comments_above(opened)
    below = content[sum(map(len, above)) :]
    within = [line for line in below.splitlines(keepends=True) if is_comment(line)] if _may_hold_comments(below) else []
    if not above and not within:
        return _Content(opened, 0, ())
    if within:
        below = b"".join(line for line in below.splitlines(keepends=True) if not is_comment(line) or not line.strip())
    names = commented_names(above, below[:LONGEST_LINE].splitlines()[0])
    whole = names.encode() + b"\n" + below if names else below
    left_out = len(above) - bool(names) + sum(1 for line in within if line.strip())
    notes = (f"{left_out} comment lines or empty lines were skipped.",) if left_out else ()
    return _Content(lambda: io.BytesIO(whole), len(above) - bool(names), notes)


def _may_hold_comments(content: bytes) -> bool:
    return any(b"\n" + mark in content for mark in COMMENT_MARKS)


def first_line(path: Path) -> int:
    """The line of the first row of data in a text file: 2, or further down below comments and a line of units."""
    content = _content(path)
    separator = _separator(content.opened)
    with content.opened() as file:
        rows = cells(file, separator, 3)
    pairs = pairs_of(rows)
    return content.above + (pairs.lines + 1 if pairs else 3 if stated_units(rows) else 2)


def _separator(opened: Opener) -> str:
    """The character that splits the header: a comma unless there is none but a semicolon or a tab."""
    with opened() as file:
        header = decoded(file.readline(LONGEST_LINE))
    return next((mark for mark in SEPARATORS if mark in header), ",")


def _header(path: Path, opened: Opener, separator: str) -> tuple[list[str], dict[str, str]]:
    """The names of the columns, and the units that a line below states.

    Refused are a header of numbers, and one with a name that stands twice, which pandas would rename in silence.

    Raises:
        LogError: names the column, or the number.
    """
    check_header_is_first(path, opened)
    with opened() as file:
        rows = cells(file, separator, 3)
    names = rows[0] if rows else []
    check_names_are_words(path, names)
    refuse_repeated(path, [name for name in names if name])
    return names, stated_units(rows)


def refuse_repeated(path: Path, names: list[str]) -> None:
    """Refuse a name that stands twice.

    Raises:
        LogError: names the column.
    """
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise LogError(f"{path}: column {quoted(twice)} stands more than once; give each column a name of its own")


def _check_cells(path: Path, opened: Opener, separator: str, width: int) -> None:
    """Refuse single rows with more cells than the others and than the header has names; empty cells do not count.

    Where every row has a cell more than the header, the last column has no name, and is not read.

    Raises:
        LogError: names the line.
    """
    lengths: Counter[int] = Counter()
    first: dict[int, int] = {}
    with opened() as file:
        for row in (rows := csv.reader(_lines(file), delimiter=separator)):
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


def _lines(file: IO[bytes]) -> IO[str]:
    return io.TextIOWrapper(file, encoding="utf-8", errors="replace", newline="")


def _opener(path: Path) -> Opener:
    """Opens the content of a file, unpacked where it is packed."""
    if not path.name.lower().endswith(".gz"):
        return lambda: path.open("rb")
    content = unpacked_gzip(path)
    return lambda: io.BytesIO(content)


def read_csv(path: Path) -> pd.DataFrame:
    """The columns of a CSV file by the names of its first line, and in `attrs["units"]` those that a line below states.

    Raises:
        LogError: no text, no names, or rows of uneven length.
    """
    opened, above, notes = _content(path)
    separator = _separator(opened)
    with opened() as file:
        pairs = pairs_of(cells(file, separator, 3))
    if pairs is None:
        table = with_decimal_points(_cells(path, opened, separator, above), separator)
    else:
        body = _without_lines(opened, pairs.lines)
        with body() as file:
            table = of_pairs(with_decimal_points(pd.read_csv(file, sep=separator, header=None), separator), pairs)
    if notes:
        table.attrs["notes"] = [*notes, *table.attrs.get("notes", ())]
    return table


def _cells(path: Path, opened: Opener, separator: str, above: int) -> pd.DataFrame:
    """The cells below the header as they are, with names in the encoding of the file."""
    names, units = _header(path, opened, separator)
    table = _rows(path, _without_second_line(opened) if units else opened, separator)
    own = [names[i] if "\ufffd" in str(name) and i < len(names) else name for i, name in enumerate(table.columns)]
    table.columns = pd.Index(own)
    if units:
        table.attrs["units"] = units
        note = f"Line {above + 2} of the file states units and was not read as a sample."
        table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table


def _without_lines(opened: Opener, lines: int) -> Opener:
    with opened() as file:
        for _ in range(lines):
            file.readline(LONGEST_LINE)
        rest = file.read()
    return lambda: io.BytesIO(rest)


def _without_second_line(opened: Opener) -> Opener:
    with opened() as file:
        first, _, rest = file.readline(), file.readline(), file.read()
    return lambda: io.BytesIO(first + rest)


def _rows(path: Path, opened: Opener, separator: str) -> pd.DataFrame:
    try:
        with opened() as file:
            return with_texts(pd.read_csv(file, sep=separator, engine="pyarrow"))
    except (pd.errors.ParserError, ValueError):
        # rows of uneven length, or bytes that are not UTF-8: the C parser drops what lies beyond the header
        with opened() as file:
            width = pd.read_csv(file, sep=separator, nrows=0, index_col=False, encoding_errors="replace").shape[1]
        _check_cells(path, opened, separator, width)
        columns = list(range(width))
        with opened() as file:
            return pd.read_csv(
                file,
                sep=separator,
                skipinitialspace=True,
                index_col=False,
                usecols=columns,
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
