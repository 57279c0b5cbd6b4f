"""Numbers as a person reads them: sensible digits, SI prefixes, real minus signs, a dash for what is not known."""

import math
from dataclasses import dataclass

NOT_IDENTIFIED = "not identified"
"""In place of an interval, of a parameter that acts as others together do."""
UNKNOWN = "–"
SPACE = "\u00a0"
"""Between a number and its unit: never broken across lines."""
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_PREFIXED = ("rad", "m", "A", "V", "N·m", "N", "rad/s", "m/s", "s")


def pretty_unit(unit: str) -> str:
    """A unit as model files write it, for people: "N*m" becomes "N·m", "s^2" becomes "s²", "-" nothing."""
    if unit == "-":
        return ""
    return unit.replace("*", "·").replace("^2", "²").replace("^3", "³")


def significant(value: float | None, digits: int = 3) -> str:
    """`value` with `digits` significant digits; beyond [1e-4, 1e6) as a power of ten.

    Args:
        value: The number, or None.
        digits: Significant digits, at least 1.

    Returns:
        Text such as "0.0142", "1230", "1.83·10⁻⁵", "−3.2"; "–" for None and NaN, "∞" for infinity.
    """
    if value is None or math.isnan(value):
        return UNKNOWN
    sign = "−" if value < 0.0 else ""
    size = abs(value)
    if math.isinf(size):
        return f"{sign}∞"
    if size == 0.0:
        return "0"
    exponent = int(f"{size:.{digits - 1}e}".split("e")[1])
    if not -4 <= exponent < 6:
        mantissa = f"{size / 10.0**exponent:.{digits - 1}f}"
        return f"{sign}{mantissa}·10{str(exponent).translate(_SUPERSCRIPT)}"
    return f"{sign}{size:.{max(digits - 1 - exponent, 0)}f}"


def percent(fraction: float | None) -> str:
    """A share as per cent: "34 %", "1.2 %", "−3.4 %", "< 0.1 %"."""
    if fraction is None or not math.isfinite(fraction):
        return UNKNOWN
    value = 100.0 * fraction
    if value == 0.0:
        text = "0"
    elif abs(value) < 0.1:
        text = "< 0.1" if value > 0.0 else "> −0.1"
    elif value < -1000.0:
        text = "< −1000"
    else:
        text = significant(value, 2 if abs(value) < 99.5 else 3)
    return text.replace(" ", SPACE) + f"{SPACE}%"


def fold(before: float, after: float) -> str:
    """How many times smaller `after` is: "46 ×"; "–" where the ratio says nothing."""
    if not (math.isfinite(before) and math.isfinite(after)) or before <= 0.0 or after <= 0.0:
        return UNKNOWN
    return f"{significant(before / after, 2 if before / after < 99.5 else 3)}{SPACE}×"


def times(before: float, after: float) -> str:
    """`fold` for a sentence: "46 times smaller", "1.3 times larger", or why there is no ratio."""
    if not (math.isfinite(before) and math.isfinite(after)):
        return "no ratio, because one of them could not be computed"
    if before <= 0.0 or after <= 0.0:
        return "no ratio, because one of them is zero"
    ratio, word = (before / after, "smaller") if after <= before else (after / before, "larger")
    return f"{significant(ratio, 2 if ratio < 99.5 else 3)} times {word}"


@dataclass(frozen=True)
class Scale:
    """One prefix for numbers that are read together: `factor` times a number in SI is a number in `unit`."""

    factor: float
    unit: str

    def text(self, value: float | None, digits: int = 3) -> str:
        """The number alone, in the scale's unit."""
        return significant(None if value is None else value * self.factor, digits)

    def quantity(self, value: float | None, digits: int = 3) -> str:
        """Number and unit."""
        number = self.text(value, digits)
        return number if number == UNKNOWN or not self.unit else f"{number}{SPACE}{self.unit}"


def scale_for(largest: float | None, unit: str) -> Scale:
    """The SI prefix that brings `largest` into [1, 1000); none for units that do not take one (°C, 1/turn).

    Args:
        largest: The largest of the numbers that are read together [unit]; None, 0 and NaN take no prefix.
        unit: As model files write it.
    """
    name = pretty_unit(unit)
    if largest is None or not math.isfinite(largest) or largest == 0.0 or name not in _PREFIXED:
        return Scale(1.0, name)
    size = float(f"{abs(largest):.2e}")
    for power, prefix in _PREFIXES:
        if size >= power and not (name == "s" and power > 1.0):
            return Scale(1.0 / power, f"{prefix}{name}")
    return Scale(1e9, f"n{name}")


def interval(value: float, low: float, high: float) -> tuple[str, str]:
    """A value and its interval to the digits that the interval's width supports.

    Args:
        value: The estimate.
        low: Lower end of its 95 % interval; infinite or NaN where there is none.
        high: Upper end.

    Returns:
        ("0.1832", "[0.1829, 0.1835]"); ("0.183", "") without a usable interval.
    """
    if not (math.isfinite(value) and math.isfinite(low) and math.isfinite(high)) or high <= low:
        return significant(value, 4), ""
    largest = max(abs(value), abs(low), abs(high))
    digits = 1 + math.floor(math.log10(largest)) - math.floor(math.log10((high - low) / 2.0)) + 1
    digits = min(max(digits, 2), 7)
    exponent = math.floor(math.log10(largest))
    if -4 <= exponent < 6:
        places = max(digits - 1 - exponent, 0)
        shown = [_signed(f"{v:.{places}f}") for v in (value, low, high)]
    else:
        power = str(exponent).translate(_SUPERSCRIPT)
        shown = [_signed(f"{v / 10.0**exponent:.{digits - 1}f}") for v in (value, low, high)]
        return f"{shown[0]}·10{power}", f"[{shown[1]}, {shown[2]}]·10{power}"
    return shown[0], f"[{shown[1]}, {shown[2]}]"


def _signed(digits: str) -> str:
    """A real minus sign, but none before zeros."""
    return digits.replace("-", "−" if digits.strip("-0.") else "")
