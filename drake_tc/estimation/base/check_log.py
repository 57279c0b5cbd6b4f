"""Does a log make sense in SI units? What cannot be is refused, with the unit that would fit."""

from pathlib import Path

import numpy as np

from drake_tc.errors import LogError
from drake_tc.estimation.base.log import SensorLog
from drake_tc.estimation.base.rig import BaseRig
from drake_tc.gravity import GRAVITY
from drake_tc.logs.plausible import DEGREES, derivative
from drake_tc.robot.robot import position_range
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.types import FloatArray

SHORTEST, LONGEST = 1e-4, 0.1
"""Periods that a base can be estimated with [s]."""
OFF = 0.3
"""Share by which the median of |accel| may be off gravity: nobody falls or jumps half of the time."""
BEYOND = 1.0
"""A joint may be beyond its limits by this [rad]."""
TWO_TURNS = 4.0 * np.pi
WINDOW = 0.2
"""Over which the change of gravity's direction is held against the gyro [s]."""
FAST = 1.0
"""Below this a gyro is not evaluated [rad/s]."""
CERTAIN = 4.0
"""Deviations."""


def check_period(path: Path, period: float) -> None:
    """Refuse a period that is none.

    Raises:
        LogError: names the unit that fits.
    """
    if SHORTEST < period < LONGEST:
        return
    fits = [unit for unit, scale in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)) if SHORTEST < period * scale < LONGEST]
    looks = f"; it looks like {fits[0]}: convert it to s" if fits else ""
    raise LogError(f"{path}: time: expected a period of {SHORTEST:g} to {LONGEST:g} s, got {period:.4g} s{looks}")


def check_log(path: Path, rig: BaseRig, log: SensorLog, *, has_tilt: bool) -> None:
    """Refuse readings that cannot be in SI units, and columns without any.

    Args:
        path: Of the log, for the message.
        rig: Whose log.
        log: As read.
        has_tilt: Whether the log has roll and pitch.

    Raises:
        LogError: one line: what was expected, what came, which unit fits.
    """
    groups = {f"position of {name}": log.q[:, i] for i, name in enumerate(rig.robot.joints)}
    groups |= {"gyro": log.gyro, "accel": log.accel} | ({"roll_pitch": log.tilt} if has_tilt else {})
    groups |= {f"wrench of {contact.mount.name}": log.wrench[:, k] for k, contact in enumerate(rig.contacts)}
    for what, values in groups.items():
        columns = values.reshape(len(values), -1)
        if not np.isfinite(columns).any(axis=0).all():
            raise LogError(f"{path}: {what}: expected numbers; a column has none in all {len(columns)} rows")
    _check_accel(path, log.accel)
    _check_positions(path, rig, log.q)
    if has_tilt and np.nanmax(np.abs(log.tilt)) > 1.01 * np.pi:
        raise LogError(f"{path}: roll_pitch: expected angles within pi rad; it looks like degrees")
    period = float(log.time[-1]) / (len(log.time) - 1)
    _check_velocities(path, rig, log, period)
    _check_gyro(path, log, period)


def _check_accel(path: Path, accel: FloatArray) -> None:
    size = float(np.nanmedian(np.linalg.norm(accel, axis=1)))
    if abs(size / GRAVITY - 1.0) <= OFF:
        return
    units = (("g", GRAVITY), ("mg", 1e-3 * GRAVITY), ("mm/s^2", 1e-3), ("cm/s^2", 1e-2))
    fits = [unit for unit, scale in units if abs(size * scale / GRAVITY - 1.0) <= OFF]
    looks = f"; it looks like {fits[0]}" if fits else "; gravity must be in it"
    raise LogError(f"{path}: accel: expected a median size near {GRAVITY} m/s^2, got {size:.3g}{looks}")


def _check_positions(path: Path, rig: BaseRig, q: FloatArray) -> None:
    tree = read_urdf(rig.robot.urdf, rig.robot.splits)
    for i, name in enumerate(rig.robot.joints):
        lower, upper = position_range(name, tree, rig.robot.limits)
        least = lower - BEYOND if np.isfinite(lower) else -TWO_TURNS
        most = upper + BEYOND if np.isfinite(upper) else TWO_TURNS
        known = q[np.isfinite(q[:, i]), i]
        far = (known < least) | (known > most)
        if np.mean(far) > 0.01:
            came = float(known[far][0])
            looks = "; it looks like degrees" if least <= came / DEGREES <= most else ""
            raise LogError(
                f"{path}: position of {name}: expected rad within its limits {lower:.3g} to {upper:.3g},"
                f" got {came:.4g}{looks}"
            )


def _check_velocities(path: Path, rig: BaseRig, log: SensorLog, period: float) -> None:
    for i, name in enumerate(rig.robot.joints):
        known = np.isfinite(log.q[:, i]) & np.isfinite(log.qd[:, i])
        if not known.all():
            continue
        rate, given = derivative(log.q[:, i], period), log.qd[:, i]
        if min(float(rate.std()), float(given.std())) < 1e-6 or float(np.corrcoef(rate, given)[0, 1]) < 0.8:
            continue
        ratio = float(given.std() / rate.std())
        for unit, factor in (("deg/s", DEGREES), ("rpm", 30.0 / np.pi)):
            if 0.7 * factor < ratio < 1.4 * factor:
                raise LogError(
                    f"{path}: velocity of {name}: expected rad/s, got {ratio:.3g} times the position's rate;"
                    f" it looks like {unit}"
                )


def _check_gyro(path: Path, log: SensorLog, period: float) -> None:
    """Gravity's direction n in the body turns by n x omega: over windows its change tells the gyro's scale."""
    known = np.isfinite(log.gyro).all(axis=1) & np.isfinite(log.accel).all(axis=1)
    size = np.linalg.norm(log.gyro[known], axis=1)
    width = max(2, round(WINDOW / period))
    if not known.all() or len(size) < 6 * width or np.percentile(size, 99) < FAST:
        return
    kernel = np.full(max(1, width // 4), 1.0 / max(1, width // 4))
    smooth = np.column_stack([np.convolve(column, kernel, mode="same") for column in log.accel.T])
    n = smooth / np.linalg.norm(smooth, axis=1, keepdims=True)
    way = np.cumsum(np.cross(n, log.gyro) * period, axis=0)
    edges = np.arange(width, len(n) - width, width)
    turned, predicted = np.diff(n[edges], axis=0).ravel(), np.diff(way[edges], axis=0).ravel()
    power = float(predicted @ predicted)
    scale = float(turned @ predicted) / power
    spread = float(np.sqrt(np.mean((turned - scale * predicted) ** 2) / power))
    if CERTAIN * spread < scale < 0.2 - CERTAIN * spread:
        raise LogError(
            f"{path}: gyro: expected rad/s; gravity turns by {scale:.3g} of what it says; it looks like deg/s"
        )
