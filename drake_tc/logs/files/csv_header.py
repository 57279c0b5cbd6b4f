"""What the beginning of a CSV file must be: text, a line of names, and perhaps a line of their units."""

import codecs
import csv
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO

from drake_tc.config.quoted import quoted
from drake_tc.errors import LogError
from drake_tc.logs.units import is_known, is_unit

LONGEST_LINE = 2**24
"""Of the first lines of a CSV file [bytes]."""
SEPARATORS = (",", ";", "\t")
"""Of cells; the first of them that the header has."""
LINES_ABOVE = 50
"""Lines among which a header is looked for that is not the first line."""
COMMENT_MARKS = (b"#", b"%", b"//")
"""What a line of a comment begins with."""


def is_comment(line: bytes) -> bool:
    """Whether a line of a CSV file is a comment or empty."""
    text = line.strip().lstrip(b'"')
    return not text or text.startswith(COMMENT_MARKS)


def comments_above(opened: Callable[[], IO[bytes]]) -> list[bytes]:
    """The comments and empty lines above the names and the data."""
    found: list[bytes] = []
    with opened() as file:
        while (line := file.readline(LONGEST_LINE)) and is_comment(line.removeprefix(codecs.BOM_UTF8)):
            found.append(line)
    return found if line else []


def commented_names(comments: Sequence[bytes], below: bytes) -> str:
    """The names of the columns that the last comment above a row of numbers holds; empty where it holds none.

    `numpy.savetxt` writes its header so: `# time,position` above `0.0,0.1`.

    Args:
        comments: The lines above the first row.
        below: The first row.
    """
    cells = _cells_of(decoded(below))
    if not comments or not all(_is_number(cell) for cell in cells if cell):
        return ""
    text = decoded(comments[-1]).strip().strip('"').lstrip("#%/ ")
    names = _cells_of(text)
    return text if len(names) == len(cells) > 1 and not any(map(_is_number, names)) else ""


def _cells_of(line: str) -> list[str]:
    separator = next((mark for mark in SEPARATORS if mark in line), ",")
    return [cell.strip() for cell in next(csv.reader([line.strip()], delimiter=separator), [])]


def check_encoding(path: Path, beginning: bytes) -> None:
    """Refuse UTF-16 and UTF-32, in which every second byte of plain text is zero and which spreadsheets offer.

    Args:
        path: Of the file, for the message.
        beginning: The first four bytes of the file.

    Raises:
        LogError: The text is not one of UTF-8.
    """
    if beginning.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\x00" in beginning:
        raise LogError(f"{path}: expected text in UTF-8, got UTF-16, UTF-32 or binary data; save it as CSV in UTF-8")


def decoded(line: bytes) -> str:
    """The text of a line: UTF-8, or else Windows-1252, which spreadsheets write where a name has a degree sign."""
    try:
        return line.decode("utf-8-sig")
    except UnicodeDecodeError:
        return line.decode("cp1252", errors="replace")


def cells(file: IO[bytes], separator: str, lines: int) -> list[list[str]]:
    """The cells of the first `lines` lines; fewer rows where the file ends before."""
    text = "".join(decoded(file.readline(LONGEST_LINE)) for _ in range(lines))
    return [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text), delimiter=separator)]


def stated_units(rows: Sequence[Sequence[str]]) -> dict[str, str]:
    """By column, the units that the second line of a CSV file states; empty where it is a row of data.

    It states units if none of its cells is a number, at least half of the filled ones are units, and the next line has
    a number.

    Args:
        rows: The cells of the first three lines, which are names, units or data, and data.
    """
    if len(rows) < 3:
        return {}
    names, second, third = rows[:3]
    filled = {name: cell.strip("[]()") for name, cell in zip(names, second, strict=False) if cell}
    if not filled or any(map(_is_number, filled.values())) or not any(map(_is_decimal, third)):
        return {}
    known = sum(is_unit(cell) or is_known(cell) for cell in filled.values())
    return filled if 2 * known >= len(filled) else {}


def check_header_is_first(path: Path, opened: Callable[[], IO[bytes]]) -> None:
    """Refuse lines of text above the names: a first line of one cell where lines below have several.

    Args:
        path: Of the file, for the message.
        opened: Opens its content.

    Raises:
        LogError: names the first line that has as many cells as any.
    """
    with opened() as file:
        lines = [decoded(file.readline(LONGEST_LINE)) for _ in range(LINES_ABOVE)]
    widths = [max(line.count(mark) for mark in SEPARATORS) + 1 for line in lines]
    if widths[0] > 1 or max(widths) < 2:
        return
    header = widths.index(max(widths))
    above = "line 1" if header == 1 else f"lines 1 to {header}"
    raise LogError(
        f"{path}: expected the names of the columns in line 1, got {quoted(lines[0].strip())}; line {header + 1} has"
        f" {widths[header]} cells: remove {above}, so that the names come first"
    )


def check_names_are_words(path: Path, names: Sequence[str]) -> None:
    """Refuse a first line of numbers alone: a file without a header.

    Raises:
        LogError: Every filled cell of the first line is a number.
    """
    filled = [name for name in names if name]
    if filled and all(map(_is_number, filled)):
        raise LogError(
            f"{path}: expected the names of the columns in line 1, got numbers ({quoted(filled[0])} first);"
            " add a header line, such as time,<joint>/position"
        )


def _is_decimal(text: str) -> bool:
    """Whether a cell is a number, its decimal sign a point or a comma."""
    return _is_number(text.replace(",", ".", 1))


def lines_above_names(opened: Callable[[], IO[bytes]]) -> int:
    """How many lines above the names say something else, such as the date and the device.

    The names are the line above the first row of numbers, or above a line of units, if they have as many cells.
    """
    with opened() as file:
        lines = [decoded(file.readline(LONGEST_LINE)) for _ in range(LINES_ABOVE)]
    for separator in (mark for mark in SEPARATORS if any(mark in line for line in lines)):
        rows = [[cell.strip() for cell in line.strip().split(separator)] for line in lines]
        numbers = (i for i, row in enumerate(rows) if len(row) > 1 and all(map(_is_decimal, row)))
        first = next(numbers, 0)
        names = first - 2 if first > 1 and stated_units(rows[first - 2 : first + 1]) else first - 1
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
