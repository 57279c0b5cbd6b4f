"""A figure of a benchmark, as `bench --json` prints it."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class BenchRow:
    """One figure: median and 99th percentile of n values.

    Attributes:
        name: What was measured.
        unit: Of both.
        median, p99: In that unit.
        n: Values.
    """

    name: str
    unit: str
    median: float
    p99: float
    n: int

    def to_json(self) -> dict[str, Any]:
        """As `bench --json` prints it."""
        return asdict(self)


def timing_row(name: str, seconds: Sequence[float]) -> BenchRow:
    """A row of times [us]."""
    median, p99 = np.percentile(1e6 * np.asarray(seconds), [50, 99]).tolist()
    return BenchRow(name, "us", median, p99, len(seconds))
