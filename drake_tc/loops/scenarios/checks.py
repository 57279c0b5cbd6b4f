"""What every scenario's fields must be, whatever it runs."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from drake_tc.errors import ParamsError

SEEDS = 2**64
"""How many seeds there are: what the counter-based generators take as a key."""


def check_run(scenario: Any, choices: Mapping[str, Sequence[str]], times: Sequence[str]) -> None:
    """Fields of choice, times [s], the seed and the factors of the links' masses.

    Args:
        scenario: With `seed`, `masses` and the fields named.
        choices: Field to what it may be.
        times: Fields that are positive times.

    Raises:
        ParamsError: a value that is not possible; names the field.
    """
    for name, possible in choices.items():
        if getattr(scenario, name) not in possible:
            raise ParamsError(f"{name}: wanted one of {', '.join(possible)}; got {getattr(scenario, name)!r}")
    for name in times:
        if not 0.0 < getattr(scenario, name) < math.inf:
            raise ParamsError(f"{name}: wanted a positive number [s]; got {getattr(scenario, name)!r}")
    if not 0 <= scenario.seed < SEEDS:
        raise ParamsError(f"seed: wanted a whole number from 0 to 2^64 - 1; got {scenario.seed}")
    for link, factor in scenario.masses.items():
        if not 0.0 < factor < math.inf:
            raise ParamsError(f"masses.{link}: wanted a positive factor; got {factor}")
