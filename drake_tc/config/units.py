"""Values with units in input files: a number in SI, or a text such as `0.1 deg`."""

import math
from collections.abc import Mapping

from drake_tc.config.quoted import located, quoted

RATIO: Mapping[str, float] = {"": 1.0, "%": 0.01}
"""Units of a relative quantity."""


SMALLEST, LARGEST = 1e-20, 1e12
"""Range of the sizes of physical values in SI; their powers and quotients are then finite numbers."""


def check_sizes(document: object, place: tuple[str | int, ...] = ()) -> None:
    """Refuse numbers of plain data that are no physical values: finite, not zero, and outside `SMALLEST` to `LARGEST`.

    Args:
        document: Mappings, lists and values, at any depth.
        place: Of the document in its file, for the message.

    Raises:
        ValueError: Names the place of the first such number.
    """
    if isinstance(document, Mapping):
        for key, value in document.items():
            check_sizes(value, (*place, key))
    elif isinstance(document, list):
        for index, value in enumerate(document):
            check_sizes(value, (*place, index))
    elif isinstance(document, (int, float)) and not isinstance(document, bool) and not _has_size(document):
        raise ValueError(f"{located(place)}: {_expected_size(document)}")


def _has_size(value: float) -> bool:
    return value == 0 or not abs(value) < math.inf or SMALLEST <= abs(value) <= LARGEST


def _expected_size(value: object) -> str:
    return f"expected 0 or a number of size {SMALLEST:g} to {LARGEST:g}, got {quoted(value)}"


def quantity(units: Mapping[str, float], value: object) -> float:
    """A value in SI, from a number (SI) or a text such as "0.1 deg".

    Args:
        units: Those that the text may have, with their factors to SI; `RATIO` for a relative quantity.
        value: Number or text.

    Raises:
        ValueError: Neither, and the message lists the possible units; or a text of a size that nothing has.
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
    if not _has_size(size * units[unit.strip()]):
        raise ValueError(_expected_size(value))
    return size * units[unit.strip()]
