"""The units that names of columns state, in the spellings of spreadsheets, data sheets and drivers."""

import re
import unicodedata
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from drake_tc.logs.units import JOINT_SUFFIXES, SENSOR_SUFFIXES, TIME, allowed_units

SPELLINGS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "deg": ("degs", "degree", "degrees", "°"),
        "rad": ("rads", "radian", "radians"),
        "rev": ("revs", "revolution", "revolutions", "rot", "rotations"),
        "turn": ("turns",),
        "deg/s": ("degs", "deg_s", "degs_s", "deg_per_s", "dps", "°/s", "deg/sec"),
        "rad/s": ("rads", "rad_s", "rads_s", "rad_per_s", "rad/sec"),
        "rpm": ("1/min", "min-1", "rev/min", "u/min", "r/min"),
        "rev/s": ("rev_s", "revs_s", "rev_per_s", "rps", "1/s", "hz"),
        "N*m": ("nm", "n_m"),
        "mN*m": ("mnm",),
        "N*mm": ("nmm", "n_mm"),
        "N*cm": ("ncm", "n_cm"),
        "kgf*cm": ("kgfcm", "kgcm", "kgf_cm", "kg_cm"),
        "kgf*m": ("kgfm", "kgm", "kgf_m", "kg_m"),
        "lbf*ft": ("lbfft", "lbft", "ftlb", "ftlbf", "lbf_ft", "lb_ft", "ft_lb"),
        "lbf*in": ("lbfin", "lbin", "inlb", "inlbf", "lbf_in", "lb_in", "in_lb"),
        "ozf*in": ("ozfin", "ozin", "inoz", "ozf_in", "oz_in"),
        "mm/s": ("mm_s", "mm_per_s"),
        "m/s": ("m_s", "m_per_s"),
        "A": ("amp", "amps", "ampere"),
        "mA": ("milliamp", "milliamps"),
        "V": ("volt", "volts"),
        "degC": ("°c", "c", "celsius"),
        "degF": ("°f", "f", "fahrenheit"),
    }
)
"""Units of rig files to how others write them; small letters, and without the dots and stars of products."""
_ONLY_IN_BRACKETS = (
    "m",
    "a",
    "v",
    "k",
    "g",
    "c",
    "f",
    "s",
    "amp",
    "amps",
    "volt",
    "volts",
    "rot",
    "1/s",
    "ampere",
    "hz",
)
"""At the end of a name without brackets these are parts of names: `theta_m` is the angle of a motor."""


def _plain(text: str) -> str:
    """Small letters, without spaces and the signs of products; `°` is deg, and the micro sign a u."""
    text = unicodedata.normalize("NFKC", text.replace("º", "°")).lower().replace("\u03bc", "u")
    return re.sub(r"[\s*·⋅•.]+|(?<=[a-z])-(?=[a-z])", "", text)


def unit_named(text: str, quantity: str) -> str:
    """The unit of `quantity` that `text` states, as rig files write it; empty if it states none of this quantity.

    Example:
        >>> unit_named("°/s", "velocity"), unit_named("N mm", "torque"), unit_named("A", "position")
        ('deg/s', 'N*mm', '')
    """
    return _spelled(quantity).get(_plain(text), "")


@cache
def _spelled(quantity: str) -> Mapping[str, str]:
    """Spellings of the units of a quantity, as `_plain` leaves them, to the units."""
    possible = allowed_units(quantity)
    named = {_plain(unit): unit for unit in reversed(list(possible))}
    for unit in possible:
        named |= {_plain(spelling): unit for spelling in SPELLINGS.get(unit, ()) if _plain(spelling) not in named}
    return named


def is_unit(text: str) -> bool:
    """Whether a text looks like a unit of any quantity. A single letter may as well be the name of an axis."""
    if re.search(r"[\^°%²³*·µ]", text):
        return True
    whole, *per = re.split(r"[/]", text.strip())
    return (not per and len(whole) > 1 and is_known(whole)) or (bool(per) and all(map(is_known, per)))


def is_known(text: str) -> bool:
    """Whether a rig file may name the unit for some quantity."""
    return any(unit_named(text, quantity) for quantity in (*JOINT_SUFFIXES, *SENSOR_SUFFIXES, "time"))


def at_the_end() -> "re.Pattern[str]":
    """A name that ends with a unit after a separator: the name before it, and the unit."""
    known = {each for units in (*JOINT_SUFFIXES.values(), *SENSOR_SUFFIXES.values()) for each in units}
    spelled = {*known, *(each for unit in known for each in SPELLINGS.get(unit, ()))} - set(TIME)
    ends = [each for each in spelled if each.lower() not in _ONLY_IN_BRACKETS]
    ends.sort(key=len, reverse=True)
    return re.compile(rf"(.+?)[\s_.\-]+({'|'.join(map(re.escape, ends))})", re.IGNORECASE)
