"""Values with units in input files: a number in SI, or a text such as `0.1 deg`."""

import math
from collections.abc import Mapping

from drake_tc.config.quoted import quoted

RATIO: Mapping[str, float] = {"": 1.0, "%": 0.01}
"""Units of a relative quantity."""


def quantity(units: Mapping[str, float], value: object) -> float:
    """A value in SI, from a number (SI) or a text such as "0.1 deg".

    Args:
        units: Those that the text may have, with their factors to SI; `RATIO` for a relative quantity.
        value: Number or text.

    Raises:
        ValueError: Neither; the message lists the possible units.
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    number, _, unit = value.strip().partition(" ") if isinstance(value, str) else ("", "", "")
    try:
        size = float(number)
    except ValueError:
        size = math.nan
    if not math.isfinite(size) or unit.strip() not in units:
        listed = ", ".join(unit for unit in units if unit)
        raise ValueError(
            f"expected a number or a text such as '0.1 {listed.split(',')[0]}', got {quoted(value)}; units: {listed}"
        )
    return size * units[unit.strip()]
