"""Which samples of a log may be used: the conditions of a rig file's key `valid`."""

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from drake_tc.types import BoolArray, FloatArray

COMPARISONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_CONDITION = re.compile(r"(?P<column>.*\S)\s*(?P<sign>[<>=!]=|[<>])\s*(?P<limit>\S+)")


@dataclass(frozen=True)
class Condition:
    """A column, and what its values are compared with.

    Attributes:
        column: Name in the log.
        sign: One of `COMPARISONS`.
        limit: In the unit of the column in the log.
    """

    column: str
    sign: str = "!="
    limit: float = 0.0

    @staticmethod
    def of(text: str) -> "Condition":
        """From `COLUMN`, whose samples are valid where it is neither 0 nor missing, or `COLUMN < NUMBER`.

        Raises:
            ValueError: No number follows the comparison; says what was expected.
        """
        found = _CONDITION.fullmatch(text.strip())
        if found is None:
            return Condition(text.strip())
        try:
            limit = float(found["limit"])
        except ValueError:
            signs = ", ".join(COMPARISONS)
            raise ValueError(f"expected a column, or a column, one of {signs}, and a number, got {text!r}") from None
        return Condition(found["column"], found["sign"], limit)

    @property
    def text(self) -> str:
        """As a rig file says it."""
        return self.column if (self.sign, self.limit) == ("!=", 0.0) else f"{self.column} {self.sign} {self.limit!r}"

    def holds(self, values: FloatArray) -> BoolArray:
        """(T,) where the condition holds; it does not where a value is missing."""
        return np.asarray(COMPARISONS[self.sign](values, self.limit) & np.isfinite(values), dtype=np.bool_)
