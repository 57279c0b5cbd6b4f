"""What the beginning of a CSV file must be: text in UTF-8, and a line of names."""

from collections.abc import Sequence
from pathlib import Path

from drake_tc.config.quoted import quoted
from drake_tc.errors import LogError


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


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
