"""Types shared by every module: arrays, calls and tables for people. SI units; samples come first, then joints."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
Call: TypeAlias = Callable[[float], object]
"""A function of the time [s] that reads and writes the arrays to which it is bound."""


GRAVITY = 9.81
"""Drake's own [m/s^2]."""


@dataclass(frozen=True)
class TextTable:
    """A table for people.

    Attributes:
        title: One line; empty for none.
        headings: One a column; the first column has names, the others numbers.
        rows: Texts.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def text_rows(
    names: Sequence[str], columns: Sequence[Sequence[float]], digits: str = ".3f"
) -> tuple[tuple[str, ...], ...]:
    """Rows of a TextTable: a name, then one number of each column."""
    return tuple((name, *(format(column[i], digits) for column in columns)) for i, name in enumerate(names))
