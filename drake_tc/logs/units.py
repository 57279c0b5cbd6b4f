"""Units that a rig file may name, and the factor that takes each to SI.

A channel's quantity follows from the last part of its canonical name (`knee/position` is an angle), so a unit of the
wrong kind ("A" for a position) is an error here and not a strange fit later.
Names of columns state units too, in the spellings of spreadsheets, data sheets and drivers.
"""

import math
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from drake_tc.config.joint_units import JointType
from drake_tc.config.quoted import quoted

_ANGLE = {
    "rad": 1.0,
    "mrad": 1e-3,
    "deg": math.pi / 180.0,
    "rev": 2.0 * math.pi,
    "turn": 2.0 * math.pi,
}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
_ANGULAR_SPEED = {
    "rad/s": 1.0,
    "mrad/s": 1e-3,
    "deg/s": math.pi / 180.0,
    "rpm": 2.0 * math.pi / 60.0,
    "rev/s": 2.0 * math.pi,
}
_SPEED = {"m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0, "mm/min": 1e-3 / 60.0}
_TORQUE = {
    "N*m": 1.0,
    "Nm": 1.0,
    "N·m": 1.0,
    "mN*m": 1e-3,
    "mNm": 1e-3,
    "kN*m": 1e3,
    "N*cm": 1e-2,
    "N*mm": 1e-3,
    "kgf*m": 9.80665,
    "kgf*cm": 0.0980665,
    "lbf*ft": 1.3558179483314,
    "lbf*in": 0.1129848290276,
    "ozf*in": 0.00706155181423,
}
_FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time; minutes and hours are none, as no servo's log counts in them."""
_CURRENT = {"A": 1.0, "mA": 1e-3}
_VOLTAGE = {"V": 1.0, "mV": 1e-3}
_LOOP_GAIN = {"V/rad": 1.0, "A/rad": 1.0}
_LINEAR_LOOP_GAIN = {"V/m": 1.0, "A/m": 1.0}
_TEMPERATURE = {"degC": 1.0, "K": 1.0, "degF": 5.0 / 9.0}
_OFFSET = {"K": -273.15, "degF": -160.0 / 9.0}
_ACCELERATION = {"m/s^2": 1.0, "g": 9.80665}

JOINT_SUFFIXES: Mapping[str, Mapping[str, float]] = {
    "position": _ANGLE | _LENGTH,
    "position_command": _ANGLE | _LENGTH,
    "motor_position": _ANGLE | _LENGTH,
    "velocity": _ANGULAR_SPEED | _SPEED,
    "current": _CURRENT,
    "voltage": _VOLTAGE,
    "torque": _TORQUE | _FORCE,
    "torque_command": _TORQUE | _FORCE,
    "temperature": _TEMPERATURE,
    "supply_voltage": _VOLTAGE,
    "position_gain": _LOOP_GAIN | _LINEAR_LOOP_GAIN,
}
"""What may follow `<joint>/`, with the units that each may be in."""
_TURNS = {*_ANGLE, *_ANGULAR_SPEED, *_TORQUE, *_LOOP_GAIN}
_SLIDES = {*_LENGTH, *_SPEED, *_FORCE, *_LINEAR_LOOP_GAIN}

SENSOR_SUFFIXES: Mapping[str, Mapping[str, float]] = {
    **{f"gyro_{axis}": _ANGULAR_SPEED for axis in "xyz"},
    **{f"accel_{axis}": _ACCELERATION for axis in "xyz"},
    **{f"f{axis}": _FORCE for axis in "xyz"},
    **{f"t{axis}": _TORQUE for axis in "xyz"},
}
"""What may follow `imu_<name>/` and `ft_<name>/`."""

COLUMN_MEANING: Mapping[str, str] = {
    "time": "Time of the sample.",
    "position": "Joint position, by the encoder.",
    "position_command": "Commanded position of the servo.",
    "motor_position": "Position of the motor, divided by the gear ratio.",
    "velocity": "Joint velocity.",
    "current": "Motor current.",
    "voltage": "Motor voltage.",
    "torque_command": "Commanded torque of a torque drive, on the link's side of the gear.",
    "torque": "Torque on the link's side of the gear, measured or estimated.",
    "temperature": "Temperature of the motor or the gear.",
    "supply_voltage": "Voltage that feeds the drive.",
    "position_gain": "Gain of a position loop around a voltage or current drive: effort = gain · (position_command − "
    "position), up to `saturation`. With it, position_command drives the free runs.",
    "enabled": "0 or false while the drive is off.",
    "gyro_x": "Angular rates of an IMU.",
    "accel_x": "Proper accelerations: at rest, the axis that points upwards reads +9.81 m/s².",
    "fx": "Forces of the distal part (the foot) on the proximal one. A robot that stands reads +fz with z upwards.",
    "tx": "Torques, likewise, about the sensor's origin.",
}
"""What a canonical column holds, by its last part; the axes y and z as x."""

_FAMILY = {"position_command": "position", "motor_position": "position"}


@dataclass(frozen=True)
class Scale:
    """SI = factor * value + offset.

    Attributes:
        factor: Multiplies the number in the file; negative flips a sign.
        offset: Added afterwards [SI unit].
        stated: Whether the rig file states the unit (an assumed unit is checked more sharply).
    """

    factor: float = 1.0
    offset: float = 0.0
    stated: bool = False


def allowed_units(canonical: str) -> Mapping[str, float]:
    """Units that the channel `canonical` (or a bare suffix) may be in, with their factors to SI; empty if unknown."""
    suffix = canonical.rsplit("/", 1)[-1]
    if suffix == "time":
        return TIME
    return JOINT_SUFFIXES.get(suffix) or SENSOR_SUFFIXES.get(suffix) or {}


def parse_unit(canonical: str, unit: str | float) -> Scale:
    """The scale that `unit` means for the channel `canonical`.

    A number is a scale factor; a name may carry a leading "-" that flips the sign.

    Raises:
        ValueError: Not a unit of that quantity; the message lists the possible ones.
    """
    if isinstance(unit, (int, float)) and not isinstance(unit, bool):
        if not math.isfinite(unit) or unit == 0:
            raise ValueError(f"a scale factor is a finite number other than 0, got {quoted(unit)}")
        return Scale(float(unit), 0.0, stated=True)
    known = allowed_units(canonical)
    name = str(unit).strip()
    sign = -1.0 if name.startswith("-") else 1.0
    name = name.removeprefix("-").strip()
    if name not in known:
        raise ValueError(
            f"{quoted(unit)} is not a unit of this quantity; possible: {', '.join(known)}, with a leading '-' to flip "
            "the sign, or a number (scale factor)"
        )
    return Scale(sign * known[name], sign * _OFFSET.get(name, 0.0), stated=True)


def joint_type_of_unit(unit: str | float) -> JointType | None:
    """Whether a unit of a joint's channel is one of joints that turn or of joints that slide; None of either."""
    name = str(unit).strip().removeprefix("-").strip()
    return "revolute" if name in _TURNS else "prismatic" if name in _SLIDES else None


def scale_of(canonical: str, units: Mapping[str, str | float]) -> Scale:
    """The scale of one channel: its own entry in `units`, its suffix's, or for a second angle that of `position`.

    `position: deg` speaks for `position_command` and `motor_position` too unless they have an entry of their own; a
    sign or a plain number does not carry over, for it belongs to one sensor.
    """
    suffix = canonical.rsplit("/", 1)[-1]
    for key in (canonical, suffix):
        if key in units:
            return parse_unit(canonical, units[key])
    family = _FAMILY.get(suffix)
    if family is not None:
        joint = canonical.rsplit("/", 1)[0]
        for key in (f"{joint}/{family}", family):
            unit = units.get(key)
            if isinstance(unit, str) and not unit.strip().startswith("-"):
                return parse_unit(canonical, unit)
    return Scale()


SPELLINGS: Mapping[str, str] = MappingProxyType(
    {
        "deg": "degs degree degrees ° grad",
        "rad": "rads radian radians",
        "rev": "revs revolution revolutions rot rotations",
        "turn": "turns",
        "deg/s": "degs deg_s degs_s deg_per_s dps °/s deg/sec",
        "rad/s": "rads rad_s rads_s rad_per_s rad/sec",
        "mrad/s": "mrad_s mrad_per_s",
        "rpm": "1/min min-1 rev/min u/min r/min",
        "rev/s": "rev_s revs_s rev_per_s rps 1/s hz",
        "N*m": "nm n_m newtonmeter newtonmeters newton_meter newton_meters",
        "mN*m": "mnm millinewtonmeter millinewtonmeters millinewton_meters",
        "N*mm": "nmm n_mm",
        "N*cm": "ncm n_cm",
        "kgf*cm": "kgfcm kgcm kgf_cm kg_cm",
        "kgf*m": "kgfm kgm kgf_m kg_m",
        "lbf*ft": "lbfft lbft ftlb ftlbs ftlbf lbf_ft lb_ft ft_lb ft_lbs",
        "lbf*in": "lbfin lbin inlb inlbs inlbf lbf_in lb_in in_lb in_lbs",
        "ozf*in": "ozfin ozin inoz ozf_in oz_in",
        "mm/s": "mm_s mm_per_s",
        "m/s": "m_s m_per_s",
        "A": "amp amps ampere amperes",
        "mA": "milliamp milliamps mamp mamps milliampere milliamperes",
        "V": "volt volts",
        "s": "sec secs seconds",
        "ms": "msec msecs millis milliseconds",
        "us": "usec usecs micros microseconds",
        "ns": "nsec nsecs nanos nanosec nanoseconds",
        "in": "inch inches",
        "lbf": "lb lbs",
        "degC": "°c c celsius",
        "degF": "°f f fahrenheit",
    }
)
"""Units of rig files to how others write them, between blanks, in small letters without the signs of products."""
COUNTS = (
    *("inc", "incs", "increment", "increments", "tick", "ticks", "count", "counts", "cnt", "cnts", "qc"),
    *("pulse", "pulses", "step", "steps", "lsb", "digit", "digits", "raw", "adc"),
)
"""What files state in place of a unit: numbers of a register, whose unit they do not say."""
_ONLY_IN_BRACKETS = (
    *(
        "grad",
        "m",
        "in",
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
    ),
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
    spellings = ((text, unit) for unit in possible for text in SPELLINGS.get(unit, "").split())
    told = [*zip(possible, possible, strict=True), *spellings]
    return {_plain(text): unit for text, unit in reversed(told)}  # the first of two that are spelled alike counts


_SOME_OF = re.compile(r"(?:\d+(?:[.,]\d+)?(?:e-?\d+)?|1/\d+)\s*[*x]?\s*([^\W\d].*|[°%µ].*)", re.IGNORECASE)
"""A number of units, as a register counts them: `0.1 deg`, `1/100 A`."""


def is_unit(text: str) -> bool:
    """Whether a text looks like a unit of any quantity. A single letter may as well be the name of an axis."""
    if found := _SOME_OF.fullmatch(text.strip()):
        return is_known(found[1]) or is_unit(found[1])
    if re.search(r"[\^°%²³*·µ]|^[nucdkM](A|V|N|Nm|rad)$", text) or text.lower() in COUNTS:
        return True
    whole, *per = re.split(r"[/]", text.strip())
    return (not per and len(whole) > 1 and is_known(whole)) or (bool(per) and all(map(is_known, per)))


def is_known(text: str) -> bool:
    """Whether a rig file may name the unit for some quantity."""
    return any(unit_named(text, quantity) for quantity in (*JOINT_SUFFIXES, *SENSOR_SUFFIXES, "time"))


def spelled_in_names() -> str:
    """The units that names of columns state without brackets, as the alternatives of a pattern, longer ones first."""
    known = {each for units in (*JOINT_SUFFIXES.values(), *SENSOR_SUFFIXES.values()) for each in units}
    spelled = {*known, *(each for unit in known for each in SPELLINGS.get(unit, "").split())} - set(TIME)
    ends = [each for each in spelled if each.lower() not in _ONLY_IN_BRACKETS]
    return "|".join(map(re.escape, sorted(ends, key=len, reverse=True)))
