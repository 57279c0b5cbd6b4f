"""Does a log make physical sense? Units that cannot be, channels that disagree, channels that lag each other."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from drake_tc.config.joint_units import JointType
from drake_tc.errors import LogError
from drake_tc.logs.rig import Rig
from drake_tc.logs.units import scale_of
from drake_tc.types import BoolArray, FloatArray

DEGREES = 180.0 / np.pi
OTHER_SPEEDS: Mapping[JointType, tuple[tuple[str, float], ...]] = {
    "revolute": (("deg/s", DEGREES), ("rpm", 60.0 / (2.0 * np.pi))),
    "prismatic": (("mm/s", 1e3), ("m/min", 60.0), ("mm/min", 6e4)),
}
"""Units in which a velocity may be without a word, with their numbers for 1 rad/s or 1 m/s."""
ITS_RATE, NOT_ITS_RATE = 0.9, 0.5
"""Correlation above which a column is the rate of another one, and below which it is not."""
SMOOTHING_SECONDS = 0.04
FASTEST_UNSTATED = 50.0
"""Speed [rad/s] above which a velocity is believed only with a stated unit."""
TWO_TURNS = 4.0 * np.pi
LONGEST_AXIS, FASTEST_AXIS = 30.0, 20.0
"""Travel [m] and speed [m/s] that no joint which slides reaches: numbers in m above are rather mm."""


def derivative(values: FloatArray, period: float, order: int = 1) -> FloatArray:
    """Derivative (T,) of a uniformly sampled channel by a centred cubic Savitzky-Golay filter of about 40 ms."""
    window = max(7, 2 * round(0.5 * SMOOTHING_SECONDS / period) + 1)
    window = min(window, values.size - (values.size + 1) % 2)
    if window <= 3:
        return np.zeros_like(values)
    return np.asarray(savgol_filter(values, window, 3, deriv=order, delta=period))


def _top_speed(position: FloatArray, period: float, usable: BoolArray) -> float:
    """Speed that one sample in a thousand exceeds, by differences over 20 ms [unit of position/s]."""
    rows = np.flatnonzero(usable)
    w = min(max(1, round(0.02 / period)), rows.size - 1)
    together = rows[w:] - rows[:-w] == w
    if not together.any():
        return 0.0
    return float(np.percentile(np.abs(position[rows[w:]] - position[rows[:-w]])[together], 99.9) / (w * period))


def _looks_like_degrees(span: float, speed: float, *, servo: bool) -> bool:
    """Whether numbers of an angle without a stated unit, which are taken for radians, are more likely degrees.

    A joint of a position servo that turns more than twice around, or any geared joint that turns many times around
    fast, is rarer than a forgotten unit. A stated unit is believed.
    """
    if servo:
        return span > TWO_TURNS or speed > 50.0
    return speed > 100.0 or (span > 50.0 and speed > 15.0) or (span > TWO_TURNS and speed > 25.0)


def check_angles(columns: Mapping[str, FloatArray], usable: BoolArray, rig: Rig, period: float, path: Path) -> None:
    """Refuse angles that make no sense in radians, and angle channels whose units disagree.

    Raises:
        LogError: Names the file, the column, what was seen, and the unit to set.
    """
    for joint in rig.joints:
        servo = rig.drive[joint] == "position_servo"
        for suffix in ("position", "position_command", "motor_position"):
            name = f"{joint}/{suffix}"
            if name not in columns:
                continue
            values = columns[name]
            span = float(np.ptp(values[usable]))
            speed = _top_speed(values, period, usable) if suffix == "position" else 0.0
            slides, unit = rig.units_of(joint).slides, rig.units_of(joint).position
            what = f"spans {span:.4g} {unit}" + (f" at up to {speed:.4g} {unit}/s" if speed else "")
            if slides and (span > LONGEST_AXIS or speed > FASTEST_AXIS):
                _refuse_unstated(name, rig, path, f"{what}, more than a prismatic joint does", ("mm", "m"))
            elif not slides and _looks_like_degrees(span, speed, servo=servo):
                what += ", which the joints of robots do not"
                _refuse_unstated(name, rig, path, what, ("deg", "rad"), "degrees", ", as for a wheel")
        if servo:
            _check_command_scale(columns, usable, rig, joint, path)
        if {f"{joint}/position", f"{joint}/motor_position"} <= set(columns):
            _check_motor_scale(columns, usable, rig, joint, path)


def turns_of_motor(position: FloatArray, motor: FloatArray) -> float:
    """How far the motor moves per motion of the joint, by least squares; 1 where they move alike or not together.

    Args:
        position: (T,) of the joint.
        motor: (T,) in the same unit; NaN is left out of both.
    """
    known = np.isfinite(position) & np.isfinite(motor)
    q, m = position[known] - np.mean(position[known]), motor[known] - np.mean(motor[known])
    if q @ q == 0.0 or m @ m == 0.0 or (q @ m) ** 2 < TOGETHER * (q @ q) * (m @ m):
        return 1.0
    ratio = float(q @ m / (q @ q))
    return 1.0 if 1.0 / GEARED < ratio < GEARED else ratio


TOGETHER, GEARED = 0.95, 2.0
"""Share of the motor's motion that goes with the joint's, and their ratio from which on a gear lies between them: play
and elasticity of a gear change neither as much."""


def _check_motor_scale(columns: Mapping[str, FloatArray], usable: BoolArray, rig: Rig, joint: str, path: Path) -> None:
    """Refuse positions of a motor that are not divided by the gear ratio, or turn the other way."""
    name = f"{joint}/motor_position"
    ratio = turns_of_motor(columns[f"{joint}/position"][usable], columns[name][usable])
    if ratio != 1.0:
        factor = scale_of(name, rig.units).factor / ratio
        raise LogError(
            f"{path}: column {rig.columns.get(name, name)!r} ({name}) moves {ratio:.4g} times as far as"
            f" {joint}/position, and is expected to be divided by the gear ratio; set units: {{{name}: {factor:.6g}}}"
            " in the rig file"
        )


def _refuse_unstated(
    name: str, rig: Rig, path: Path, what: str, units: tuple[str, str], looks: str = "", wheel: str = ""
) -> None:
    """Refuse a column whose numbers in the second unit are rather ones in the first, unless the rig file states one."""
    if scale_of(name, rig.units).stated:
        return
    (other, own), suffix = units, name.rpartition("/")[2]
    raise LogError(
        f"{path}: column {rig.columns.get(name, name)!r} {what}: it looks like {looks or other}; set units: {{{suffix}:"
        f" {other}}} in the rig file (or {suffix}: {own} if it is right{wheel})"
    )


def check_speed(velocity: FloatArray, rig: Rig, joint: str, path: Path) -> None:
    """Refuse a velocity (T,) [rad/s] without a position to compare it with whose unit was forgotten.

    Raises:
        LogError: It is faster than geared joints are, and the rig file states no unit.
    """
    name, fastest = f"{joint}/velocity", float(np.percentile(np.abs(velocity), 99.9))
    if rig.units_of(joint).slides and fastest > FASTEST_AXIS:
        what = f"reaches {fastest:.4g} m/s, more than a prismatic joint does"
        _refuse_unstated(name, rig, path, what, ("mm/s", "m/s"))
    elif not rig.units_of(joint).slides and fastest > FASTEST_UNSTATED:
        what = f"reaches {fastest:.4g} rad/s, which no geared joint does"
        _refuse_unstated(name, rig, path, what, ("rpm", "rad/s"), "rpm or deg/s")


def _check_command_scale(
    columns: Mapping[str, FloatArray], usable: BoolArray, rig: Rig, joint: str, path: Path
) -> None:
    """Refuse a command and a position that follow each other at the ratio of degrees to radians."""
    command, position = columns[f"{joint}/position_command"][usable], columns[f"{joint}/position"][usable]
    spread = float(position.std())
    if spread == 0.0 or command.std() == 0.0 or abs(float(np.corrcoef(command, position)[0, 1])) < 0.9:
        return
    ratio = float(command.std()) / spread
    slides = rig.units_of(joint).slides
    kind, factor, unit = ("position", 1e3, "mm") if slides else ("angle", DEGREES, "deg")
    for suffix, scale in (("position_command", ratio), ("position", 1.0 / ratio)):
        if 0.7 * factor < scale < 1.4 * factor:
            name = f"{joint}/{suffix}"
            raise LogError(
                f"{path}: column {rig.columns.get(name, name)!r} is {scale:.3g} times as large as the other {kind} of "
                f"{joint}: it looks like {'mm' if slides else 'degrees'}; set units: {{{name}: {unit}}} in the rig file"
            )


def check_velocity(
    columns: dict[str, FloatArray], usable: BoolArray, rig: Rig, period: float, path: Path
) -> tuple[str, ...]:
    """Compare a velocity column with the derivative of the position; turn it round where its sign is wrong.

    Changes `columns` in place when the sign is wrong.

    Raises:
        LogError: A velocity that is degrees or turns a minute to the position's radians, or one whose rate is the
            position.
    """
    notes: tuple[str, ...] = ()
    for joint in rig.joints:
        name = f"{joint}/velocity"
        if name not in columns or np.ptp(columns[name][usable]) == 0.0:
            continue
        rate = derivative(columns[f"{joint}/position"], period)[usable]
        velocity = columns[name][usable]
        if rate.std() == 0.0:
            continue
        correlation = float(np.corrcoef(rate, velocity)[0, 1])
        if correlation < NOT_ITS_RATE and _is_rate_of(columns[f"{joint}/position"], columns[name], usable, period):
            position = rig.columns.get(f"{joint}/position", f"{joint}/position")
            raise LogError(
                f"{path}: column {position!r} (position) is the rate of column {rig.columns.get(name, name)!r} "
                "(velocity): the two are exchanged; exchange them under columns: in the rig file"
            )
        ratio = float(velocity.std() / rate.std())
        if abs(correlation) < 0.8:
            continue
        for unit, factor in OTHER_SPEEDS[rig.joint_type(joint)]:
            if 0.85 * factor < ratio < 1.15 * factor:
                raise LogError(
                    f"{path}: column {rig.columns.get(name, name)!r} is {ratio:.3g} times the rate of the position: "
                    f"it looks like {unit}; set units: {{velocity: {unit}}} in the rig file"
                )
        if correlation < 0:
            columns[name] = -columns[name]
            notes += (f"Column {name} has the opposite sign of the rate of the position: its sign was changed.",)
        if not 0.8 < ratio < 1.25:
            notes += (f"Column {name} is {ratio:.3g} times the rate of the position.",)
    return notes


def _is_rate_of(values: FloatArray, other: FloatArray, usable: BoolArray, period: float) -> bool:
    """Whether values (T,) follow the rate of other ones.

    A bounded motion and its own acceleration have opposite signs, so a position never follows the rate of its velocity.
    """
    rate = derivative(other, period)[usable]
    return bool(rate.std() > 0.0 and np.corrcoef(rate, values[usable])[0, 1] > ITS_RATE)


def lag_notes(columns: Mapping[str, FloatArray], usable: BoolArray, rig: Rig, period: float) -> tuple[str, ...]:
    """Note a velocity column that comes two samples or more before or after the position's rate; nothing is moved."""
    notes: tuple[str, ...] = ()
    for joint in rig.joints:
        name = f"{joint}/velocity"
        if name not in columns:
            continue
        part = slice(0, min(usable.size, 200_000))
        rate = derivative(columns[f"{joint}/position"][part], period) * usable[part]
        velocity = columns[name][part] * usable[part]
        shifts = np.arange(-20, 21)
        if rate.size < 200 or rate.std() == 0.0 or velocity.std() == 0.0:
            continue
        inner = slice(20, -20)
        score = np.array([np.corrcoef(rate[inner], np.roll(velocity, -int(s))[inner])[0, 1] for s in shifts])
        best = int(shifts[score.argmax()])
        # the share of the velocity that the rate leaves unexplained must fall clearly by the shift
        if 2 <= abs(best) < 20 and 1.0 - score.max() ** 2 < 0.6 * (1.0 - score[20] ** 2):
            side = "after" if best > 0 else "before"
            notes += (f"Column {name} comes about {abs(best) * period * 1e3:.3g} ms {side} the rate of the position.",)
    return notes
