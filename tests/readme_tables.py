"""Tables in the README files: cells by the beginning of their row, and the numbers in a cell."""

import re
from pathlib import Path

from numpy.testing import assert_allclose

ROOT = Path(__file__).resolve().parents[1]
NUMBER = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e-?\d+)?|\b(?:none|never)\b")
"""A number, or a word that says zero."""


def row(file: str, begin: str) -> list[str]:
    """Cells of the one table row of that file which begins so."""
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    found = [line for line in lines if line.startswith(f"| {begin}")]
    assert len(found) == 1, f"{file}: {len(found)} rows begin with {begin!r}"
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", found[0].strip("|"))]


def numbers(cell: str) -> list[str]:
    """As they are written; `none` and `never` count as 0."""
    return ["0" if found.isalpha() else found.replace("−", "-") for found in NUMBER.findall(cell)]


def assert_quoted(cell: str, values: list[float | None], what: str) -> None:
    """The numbers of a cell, in order, are the values rounded to the digits that it shows; None: not compared."""
    written = numbers(cell)
    assert len(written) == len(values), f"{what}: {len(values)} values for the numbers in {cell!r}"
    for number, value in zip(written, values, strict=True):
        if value is not None:
            assert_allclose(float(number), value, rtol=0.0, atol=_half_a_digit(number), err_msg=f"{what}: {cell}")


def _half_a_digit(number: str) -> float:
    """Half of what the last digit counts, and what rounding to four digits adds to it."""
    mantissa, _, exponent = number.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return 0.5001 * unit + 5e-5 * abs(float(number))
