"""The base estimator and its baseline over a log: a file as the arrays that it takes, and how far the result is off.

The rig file says what the columns of the file are. What cannot be in SI units is refused, with the unit that would fit.
The errors are those from a measured truth, where there is one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drake_tc.config.files import is_file
from drake_tc.errors import LogError, ParamsError, RigError
from drake_tc.estimation.base_estimator import CopEstimator, FootCentreEstimator, OnKinematics
from drake_tc.estimation.base_kinematics import CONTACT_FLAGS, FLAGS, Sample
from drake_tc.estimation.base_rig import BaseRig
from drake_tc.logs.checks.plausible import DEGREES, derivative
from drake_tc.logs.files.array_files import read_arrays
from drake_tc.logs.files.readers import read_table
from drake_tc.robot.robot import position_range
from drake_tc.robot.urdf_tree import read_urdf
from drake_tc.types import GRAVITY, FloatArray


@dataclass(frozen=True, eq=False)
class SensorLog:
    """T samples at a constant period; NaN where a reading is missing.

    Attributes:
        time: (T,) [s].
        q, qd: (T, n) [rad, rad/s]. gyro, accel: (T, 3) [rad/s, m/s^2]. tilt: (T, 2) [rad], NaN without.
        wrench: (T, k, 6) [N, N m]. switch: (T, k).
    """

    time: FloatArray
    q: FloatArray
    qd: FloatArray
    gyro: FloatArray
    accel: FloatArray
    tilt: FloatArray
    wrench: FloatArray
    switch: FloatArray

    def sample(self, i: int) -> Sample:
        """Sample i, as a tick takes it."""
        imu, wrench = np.concatenate((self.gyro[i], self.accel[i])), np.ravel(self.wrench[i])
        parts = (self.q[i], self.qd[i], imu, self.tilt[i], wrench, self.switch[i])
        return Sample(*(np.ascontiguousarray(part, dtype=float) for part in parts))


@dataclass(frozen=True, eq=False)
class BaseTrack:
    """A base over time: estimated, or the truth.

    Attributes:
        time: (T,) [s]. position: (T, 3) p_WB [m]. rpy: (T, 3) roll, pitch, yaw [rad]; yaw is continuous.
        velocity: (T, 3) of B's origin in W [m/s]; NaN where unknown.
        flags: (T, 9). contact_flags: (T, k, 5). pressure: (T, k, 2) [m]; empty of a truth.
    """

    time: FloatArray
    position: FloatArray
    rpy: FloatArray
    velocity: FloatArray
    flags: FloatArray
    contact_flags: FloatArray
    pressure: FloatArray


def rpy_of(R: FloatArray) -> FloatArray:
    """(3,) roll, pitch, yaw [rad] of a rotation (3, 3)."""
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def run_log(
    estimator: OnKinematics,
    log: SensorLog,
    position: FloatArray,
    yaw: float,
    progress: Callable[[float], None] = lambda share: None,
) -> BaseTrack:
    """The estimate over a log.

    Args:
        estimator: Whose period is the log's.
        log: T samples.
        position: (3,) where the base starts [m].
        yaw: Its yaw there [rad].
        progress: Told the share done, now and then.
    """
    state = estimator.initial_state(position, yaw)
    positions, angles, velocities, flags, contact_flags, pressures = [], [], [], [], [], []
    for i in range(len(log.time)):
        state = estimator.step(state, log.sample(i))
        positions.append(state.position)
        angles.append(rpy_of(state.rotation))
        velocities.append(state.rotation @ state.velocity)
        flags.append(state.flags)
        contact_flags.append(state.contact_flags)
        pressures.append(state.pressure)
        if i % 500 == 0:
            progress(i / len(log.time))
    rpy = np.array(angles)
    rpy[:, 2] = np.unwrap(rpy[:, 2])
    return BaseTrack(
        log.time,
        np.array(positions),
        rpy,
        np.array(velocities),
        np.array(flags),
        np.array(contact_flags),
        np.array(pressures),
    )


@dataclass(frozen=True)
class TrackError:
    """RMS over the samples where both are known.

    Attributes:
        position: x, y, z [m]. angle: roll, pitch, yaw [rad]. velocity: x, y, z [m/s].
        samples: Of how many samples each of the three is.
    """

    position: FloatArray
    angle: FloatArray
    velocity: FloatArray
    samples: tuple[int, int, int]


def track_error(track: BaseTrack, truth: BaseTrack) -> TrackError:
    """How far an estimate is from the truth, sample by sample, nothing aligned."""
    position = track.position - truth.position
    angle = (track.rpy - truth.rpy + np.pi) % (2.0 * np.pi) - np.pi
    velocity = track.velocity - truth.velocity
    counts = [int(np.isfinite(error).all(axis=1).sum()) for error in (position, angle, velocity)]
    return TrackError(_rms(position), _rms(angle), _rms(velocity), (counts[0], counts[1], counts[2]))


def _rms(error: FloatArray) -> FloatArray:
    known = np.isfinite(error).all(axis=1)
    out: FloatArray = np.sqrt(np.mean(error[known] ** 2, axis=0)) if known.any() else np.full(error.shape[1], np.nan)
    return out


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


_AXES = ("x", "y", "z")
_WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
_LONGEST_GAP = 5.0
"""Periods without a sample that are still no gap."""
_UNEVEN = 0.2
"""A step between times that is off the mean period by this share is told."""


class _Source:
    """Arrays of a file by name: those of an NPZ as they are, else columns of a table."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: int | None = None  # as many as times, once these are known
        self._arrays: dict[str, np.ndarray] = {}
        if path.suffix.lower() == ".npz":
            if not is_file(path):
                raise LogError(f"{path}: no such log file")
            self._arrays = read_arrays(path)
        else:
            table = read_table(path)
            self._arrays = {str(name): table[name].to_numpy() for name in table.columns}

    def __contains__(self, name: str) -> bool:
        return name in self._arrays

    def names(self, name: str) -> list[str]:
        """An array of texts."""
        return [str(item) for item in self._found(name).ravel()]

    def numbers(self, what: str, name: str | Sequence[str], width: int) -> FloatArray:
        """(T, width) numbers: an array of that width or more, or one column each."""
        if not isinstance(name, str):
            if len(name) != width:
                raise LogError(f"{self.path}: {what}: expected {width} columns; the rig file names {len(name)}")
            return np.column_stack([self._column(what, item) for item in name])
        if name not in self._arrays and f"{name}_0" in self._arrays:
            return np.column_stack([self._column(what, f"{name}_{i}") for i in range(width)])
        array = self._found(name)
        array = array[:, None] if array.ndim == 1 else array
        if array.ndim != 2 or array.shape[1] < width:
            raise LogError(f"{self.path}: {what}: expected {width} columns in {name!r}; its shape is {array.shape}")
        return self._floats(what, array[:, :width])

    def _column(self, what: str, name: str) -> FloatArray:
        array = self._found(name)
        if array.ndim != 1:
            raise LogError(f"{self.path}: {what}: expected one column in {name!r}; its shape is {array.shape}")
        return self._floats(what, array)

    def _floats(self, what: str, array: np.ndarray) -> FloatArray:
        if self.rows is not None and len(array) != self.rows:
            raise LogError(f"{self.path}: {what}: expected {self.rows} rows, as many as times, got {len(array)}")
        if np.iscomplexobj(array):
            raise LogError(f"{self.path}: {what}: expected numbers, got {array.dtype}")
        try:
            return np.asarray(array, dtype=float)
        except (TypeError, ValueError):
            raise LogError(f"{self.path}: {what}: expected numbers, got {array.dtype}") from None

    def _found(self, name: str) -> np.ndarray:
        if name not in self._arrays:
            here = ", ".join(list(self._arrays)[:40]) or "none"
            raise LogError(f"{self.path}: no column {name!r}; columns here: {here}")
        return self._arrays[name]


def read_base_log(rig: BaseRig, path: Path | str) -> tuple[SensorLog, BaseTrack | None, float]:
    """(samples, truth where the rig names one, period [s]) of a log.

    The period is the mean one; the samples are taken as they come, at that period (`timing_notes` tells where that is
    rough). Velocities by differences take the real steps. Readings that are missing stay NaN, which the estimator knows
    how to bridge.

    Raises:
        LogError: a file that cannot be read, a column that is not there or of another length, times that do not
            increase, a gap, or numbers that cannot be in SI units.
    """
    source = _Source(Path(path))
    columns, joints = rig.columns, list(rig.robot.joints)
    time = source.numbers("time", columns.get("time", "time"), 1)[:, 0]
    period = _period(source.path, time)
    source.rows = len(time)

    def of_joints(what: str) -> FloatArray:
        if what in columns:
            order = columns.get("joint_order", tuple(joints))
            listed = source.names(order) if isinstance(order, str) else list(order)
            missing = [name for name in joints if name not in listed]
            if missing:
                raise LogError(
                    f"{source.path}: joint_order: no joint {missing[0]!r}; joints there: {', '.join(listed)}"
                )
            return source.numbers(what, columns[what], len(listed))[:, [listed.index(name) for name in joints]]
        names = [f"{joint}/{what}" for joint in joints]
        if what == "velocity" and names[0] not in source:
            return np.zeros((0, 0))
        return source.numbers(what, names, len(names))

    imu = rig.robot.imu[0].name if rig.robot.imu else "base"
    q, velocity = of_joints("position"), of_joints("velocity")
    wrenches = [
        source.numbers(
            f"wrench of {contact.mount.name}", given or [f"ft_{contact.sensor}/{axis}" for axis in _WRENCH], 6
        )
        for contact, given in zip(rig.contacts, rig.wrench, strict=True)
    ]
    tilt = np.full((len(time), 2), np.nan)
    if "roll_pitch" in columns:
        tilt = source.numbers("roll_pitch", columns["roll_pitch"], 2)
    log = SensorLog(
        time=time - time[0],
        q=q,
        qd=_differences(time, q) if velocity.size == 0 else velocity,
        gyro=source.numbers("gyro", columns.get("gyro", [f"imu_{imu}/gyro_{axis}" for axis in _AXES]), 3),
        accel=source.numbers("accel", columns.get("accel", [f"imu_{imu}/accel_{axis}" for axis in _AXES]), 3),
        tilt=tilt,
        wrench=np.stack(wrenches, axis=1),
        switch=np.zeros((len(time), len(rig.contacts))),
    )
    check_log(source.path, rig, log, has_tilt="roll_pitch" in columns)
    return log, _truth(source, rig, log.time), period


def timing_notes(time: FloatArray) -> tuple[str, ...]:
    """A sentence where the steps between times (T,) [s] are not even."""
    steps = np.diff(time)
    mean = float(steps.mean())
    off = int(np.sum(np.abs(steps - mean) > _UNEVEN * mean))
    if not off:
        return ()
    return (
        f"time steps of {1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms, {off} of {steps.size} off the mean by"
        f" more than {100 * _UNEVEN:.0f} %: all samples are taken {1e3 * mean:.3g} ms apart",
    )


def _differences(time: FloatArray, q: FloatArray) -> FloatArray:
    """(T, n) backward differences; 0 in the first row."""
    return np.concatenate([np.zeros((1, q.shape[1])), np.diff(q, axis=0) / np.diff(time)[:, None]])


def _period(path: Path, time: FloatArray) -> float:
    if len(time) < 10:
        raise LogError(f"{path}: time: expected at least ten samples, got {len(time)}")
    if not np.isfinite(time).all():
        row = int(np.argmin(np.isfinite(time))) + 1
        raise LogError(f"{path}: time: expected numbers; row {row} has none; leave such rows out")
    steps = np.diff(time)
    if not (steps > 0.0).all():
        row = int(np.argmin(steps > 0.0)) + 2
        raise LogError(f"{path}: time does not increase at row {row}; sort the rows and leave repeats out")
    mean = float(time[-1] - time[0]) / (len(time) - 1)
    if steps.max() > _LONGEST_GAP * mean:
        row = int(np.argmax(steps)) + 2
        raise LogError(f"{path}: a gap of {steps.max():.3g} s before row {row}; cut the log there")
    check_period(path, mean)
    return mean


def _truth(source: _Source, rig: BaseRig, time: FloatArray) -> BaseTrack | None:
    """What the rig file names of it; the rest is NaN."""
    if not {"truth_position", "truth_rpy"} & set(rig.columns):
        return None
    position, rpy = np.full((len(time), 3), np.nan), np.full((len(time), 3), np.nan)
    if "truth_position" in rig.columns:
        position = source.numbers("truth_position", rig.columns["truth_position"], 3)
    if "truth_rpy" in rig.columns:
        rpy = source.numbers("truth_rpy", rig.columns["truth_rpy"], 3).copy()
        for angle in rpy.T:  # a view: a marker that is lost leaves a hole, and nothing else
            known = np.isfinite(angle)
            angle[known] = np.unwrap(angle[known])
    nothing = np.zeros((len(time), 0))
    return BaseTrack(time, position, rpy, np.gradient(position, time, axis=0), nothing, nothing, nothing)


_ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class BaseResult:
    """What came out of a log.

    Attributes:
        estimate, baseline: Of `CopEstimator` and `FootCentreEstimator`.
        truth: As measured, or None.
        contacts: Names, in order.
        notes: Sentences on the log.
    """

    estimate: BaseTrack
    baseline: BaseTrack
    truth: BaseTrack | None
    contacts: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def errors(self) -> tuple[TrackError, TrackError] | None:
        """(estimate's, baseline's), or None without a truth."""
        if self.truth is None:
            return None
        return track_error(self.estimate, self.truth), track_error(self.baseline, self.truth)

    def flag_shares(self) -> dict[str, float]:
        """Share of the samples with each flag up; those of contacts as `<contact>/<flag>`."""
        shares = dict(zip(FLAGS, self.estimate.flags.mean(axis=0).tolist(), strict=True))
        for name, row in zip(self.contacts, self.estimate.contact_flags.mean(axis=0).tolist(), strict=True):
            shares |= {f"{name}/{flag}": share for flag, share in zip(CONTACT_FLAGS, row, strict=True)}
        return shares

    def to_json(self) -> dict[str, Any]:
        """As `drake-tc estimate-base --json` prints it: RMSE in SI units, angles in degrees."""
        rows: list[dict[str, Any]] = []
        if self.errors is not None:
            for which, error in zip(("estimate", "foot_centre"), self.errors, strict=True):
                groups = (
                    ("position", "m", _AXES, error.position),
                    ("angle", "deg", _ANGLES, np.degrees(error.angle)),
                    ("velocity", "m/s", _AXES, error.velocity),
                )
                for (kind, unit, names, values), count in zip(groups, error.samples, strict=True):
                    for name, value in zip(names, values.tolist(), strict=True):
                        shown = value if np.isfinite(value) else None
                        name = f"{which}/{kind}_{name}"
                        rows.append({"name": name, "unit": unit, "value": shown, "samples": count})
        return {
            "samples": len(self.estimate.time),
            "seconds": float(self.estimate.time[-1]),
            "final_position": self.estimate.position[-1].tolist(),
            "final_yaw_deg": float(np.degrees(self.estimate.rpy[-1, 2])),
            "notes": list(self.notes),
            "rows": rows,
            "flags": {name: share for name, share in self.flag_shares().items() if share > 0.0},
        }

    def table(self) -> pd.DataFrame:
        """One row a sample: estimate, baseline, truth, centres of pressure and flags."""
        columns: dict[str, FloatArray] = {"time": self.estimate.time}
        for which, track in (("base", self.estimate), ("foot_centre", self.baseline), ("truth", self.truth)):
            if track is not None:
                columns |= {f"{which}/{axis}": track.position[:, i] for i, axis in enumerate(_AXES)}
                columns |= {f"{which}/{angle}": track.rpy[:, i] for i, angle in enumerate(_ANGLES)}
                columns |= {f"{which}/v{axis}": track.velocity[:, i] for i, axis in enumerate(_AXES)}
        for i, name in enumerate(self.contacts):
            columns |= {f"{name}/cop_{axis}": self.estimate.pressure[:, i, j] for j, axis in enumerate("xy")}
            columns |= {f"{name}/{flag}": self.estimate.contact_flags[:, i, j] for j, flag in enumerate(CONTACT_FLAGS)}
        columns |= {f"flag/{flag}": self.estimate.flags[:, j] for j, flag in enumerate(FLAGS)}
        return pd.DataFrame(columns)


def evaluate_log(
    rig: BaseRig, log: Path | str, progress: Callable[[str, float], None] = lambda text, share: None
) -> BaseResult:
    """Both estimates over a log, from the rig's start, else the truth's first sample, else the robot file's pose.

    Raises:
        LogError, ParamsError, RigError: input that cannot be used.
    """
    samples, truth, period = read_base_log(rig, log)
    pose = rig.robot.base_pose
    position, yaw = np.array(pose.xyz), pose.rpy[2]
    if rig.start is not None:
        position, yaw = rig.start
    elif truth is not None:
        position = truth.position[0] if np.isfinite(truth.position[0]).all() else position
        yaw = float(truth.rpy[0, 2]) if np.isfinite(truth.rpy[0, 2]) else yaw
    tracks = [
        run_log(estimator, samples, position, yaw, lambda share, name=name: progress(name, share))  # type: ignore[misc]
        for name, estimator in _estimators(rig, period).items()
    ]
    names = tuple(contact.mount.name for contact in rig.contacts)
    return BaseResult(tracks[0], tracks[1], truth, names, timing_notes(samples.time))


def _estimators(rig: BaseRig, period: float) -> dict[str, CopEstimator | FootCentreEstimator]:
    """The estimator and its baseline, by name."""
    spec = rig.spec(period)
    try:
        return {
            "centre of pressure": CopEstimator(rig.robot, spec),
            "foot centre": FootCentreEstimator(rig.robot, spec),
        }
    except ParamsError as error:
        raise RigError(f"{rig.source}: {error}") from None
