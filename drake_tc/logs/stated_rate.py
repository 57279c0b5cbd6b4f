"""The sampling period that a file states as a single number beside its arrays: `hz: 50`, `dt: 0.02`."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from drake_tc.logs.inspection.names import meaning, words

RATES = ("hz", "fps", "rate", "frequency", "freq", "fs")
PERIODS = ("dt", "period", "timestep")
"""Words of the names of a rate [Hz] and of a period [s]."""


def stated_period(numbers: Mapping[str, float]) -> float | None:
    """The period [s] that single numbers of a file state; None where there is none, or two that differ.

    Args:
        numbers: By name.

    Example:
        >>> stated_period({"config/action_hz": 50.0, "mass": 0.5})
        0.02
    """
    found = set()
    for name, value in numbers.items():
        said = [word.lower() for word in words(name.rpartition("/")[2])]
        if not np.isfinite(value) or value <= 0.0 or not said:
            continue
        if said[-1] in RATES or any(word in ("hz", "fps") for word in said):
            found.add(1.0 / value)
        elif said[-1] in PERIODS:
            found.add(float(value))
    return found.pop() if len(found) == 1 else None


def with_times(table: pd.DataFrame, period: float | None) -> pd.DataFrame:
    """The table with a column `time` of multiples of a stated period [s], where none is called like a time."""
    told = (meaning(str(name)) for name in table.columns)
    if period is None or any(each is not None and each.quantity == "time" for each in told):
        return table
    table.insert(0, "time", period * np.arange(len(table)))
    note = f"The file has no times but states a rate of {1.0 / period:.6g} Hz, so its rows are {period:.6g} s apart."
    table.attrs["notes"] = [*table.attrs.get("notes", ()), note]
    return table
