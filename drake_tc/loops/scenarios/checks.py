"""What every scenario's fields must be, whatever it runs."""

import math
from collections.abc import Sequence
from typing import Any

from drake_tc.config.records import check_choices
from drake_tc.errors import ParamsError

SEEDS = 2**64
"""How many seeds there are: what the counter-based generators take as a key."""


def check_run(scenario: Any, times: Sequence[str]) -> None:
    """Fields of choice by their `Literal`s, times [s], the seed and the factors of the links' masses.

    Args:
        scenario: With `seed` and `masses`.
        times: Fields that are positive times.

    Raises:
        ParamsError: a value that is not possible; names the field.
    """
    check_choices(scenario)
    for name in times:
        if not 0.0 < getattr(scenario, name) < math.inf:
            raise ParamsError(f"{name}: expected a positive number [s], got {getattr(scenario, name)!r}")
    if not 0 <= scenario.seed < SEEDS:
        raise ParamsError(f"seed: expected a whole number from 0 to 2^64 - 1, got {scenario.seed}")
    for link, factor in scenario.masses.items():
        if not 0.0 < factor < math.inf:
            raise ParamsError(f"masses.{link}: expected a positive factor, got {factor}")
