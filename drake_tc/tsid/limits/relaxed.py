"""Rows of limits that contradict each other at a state, so that some had to give way before any program saw them."""

from collections.abc import Iterable
from dataclasses import dataclass

from drake_tc.tsid.rows import LimitRows


@dataclass(frozen=True, eq=False)
class RelaxedRows(LimitRows):
    """Rows, and for how many of them a limit gave way.

    Attributes:
        relaxed: 0 where the rows are all that the limit asks for.
    """

    relaxed: int = 0


def relaxed_rows(limits: Iterable[LimitRows]) -> int:
    """How many rows of all limits had to be relaxed."""
    return sum(rows.relaxed for rows in limits if isinstance(rows, RelaxedRows))
