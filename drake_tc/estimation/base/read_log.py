"""A log file as the arrays that the base estimator takes, by what its rig file says."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drake_tc.config.files import is_file
from drake_tc.errors import LogError
from drake_tc.estimation.base.check_log import check_log, check_period
from drake_tc.estimation.base.log import BaseTrack, SensorLog
from drake_tc.estimation.base.rig import BaseRig
from drake_tc.logs.array_files import read_arrays
from drake_tc.logs.readers import read_table
from drake_tc.types import FloatArray

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
