"""Joint torques from a recorded log: Algorithm 1 without the delay of the filters.

Source: Del Prete et al., 2016, Algorithm 1.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from drake_tc.errors import LogError
from drake_tc.estimation.torque_model import MeasuredMotion, TorqueModel
from drake_tc.filtering.savitzky_golay import Window, choose_window, smooth
from drake_tc.types import FloatArray


@dataclass(frozen=True)
class OffLineFilter:
    """Savitzky–Golay windows around each sample; odd, so that each sample lies in the middle of its own.

    Attributes:
        encoder, inertial, wrench: Of the encoders', the IMU's and the F/T sensors' readings.
    """

    encoder: Window
    inertial: Window
    wrench: Window

    @classmethod
    def of(cls, window: int = 81) -> Self:
        """All windows of `window` samples, of order 2 for encoders, 1 for the others (Del Prete et al., 2016)."""
        return cls(Window(window, 2), Window(window, 1), Window(window, 1))

    @property
    def longest(self) -> int:
        """Samples of the longest window."""
        return max(self.encoder.samples, self.inertial.samples, self.wrench.samples)


@dataclass(frozen=True)
class TorqueLog:
    """What the estimator makes of a log, every signal at its own time.

    Attributes:
        torque: (T, n) link side [N m].
        unknown_wrench: (T, 6) [N, N m].
        contact_wrench: (T, 6k) [N, N m].
    """

    torque: FloatArray
    unknown_wrench: FloatArray
    contact_wrench: FloatArray


@dataclass(frozen=True)
class SensorLog:
    """Raw readings of one run on a uniform clock.

    Attributes:
        position: (T, n) encoders [rad].
        imu: (T, 6) of the IMU; None for a model with a fixed base.
        wrench: (T, 6k) of the F/T sensors [N, N m].
        dt: Sampling period [s].
    """

    position: FloatArray
    imu: FloatArray | None
    wrench: FloatArray
    dt: float


def chosen_filter(log: SensorLog) -> OffLineFilter:
    """The windows with the least expected error, one for the joints' accelerations, one for the IMU's readings and the
    derivative of its gyro, one for the wrenches.

    Every joint counts alike, whatever its accelerations; the axes of a force, a torque, a rate or an acceleration count
    by their errors.

    Args:
        log: Readings of at least 20 samples, finite.
    """
    encoder = choose_window([(joint[:, None], 2) for joint in log.position.T], log.dt)
    inertial = wrench = encoder
    if log.imu is not None:
        gyro, accel = log.imu[:, :3], log.imu[:, 3:]
        inertial = choose_window([(gyro, 0), (gyro, 1), (accel, 0)], log.dt)
    if log.wrench.size:
        forces = np.arange(log.wrench.shape[1]) % 6 < 3
        wrench = choose_window([(log.wrench[:, forces], 0), (log.wrench[:, ~forces], 0)], log.dt)
    return OffLineFilter(encoder, inertial, wrench)


Row = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""A MeasuredMotion's five arrays and the wrenches at one instant, or with a first axis of T instants."""


def estimate_log(
    model: TorqueModel, log: SensorLog, filters: OffLineFilter | None = None, bias: FloatArray | None = None
) -> TorqueLog:
    """Torques and wrenches at every sample; half a window at each end is one-sided, as `smooth` has it.

    Args:
        model: The kernel, for one robot.
        log: Readings.
        filters: Windows; None: 81 samples.
        bias: (6k,) of the F/T sensors, to be taken off [N, N m]; None: nil (see `wrench_bias`).

    Raises:
        LogError: a reading that is not finite, sizes that do not fit the robot, a log shorter than the window, or one
            without the IMU that the model needs.
        ParamsError: a window or an order that is not possible.

    Source: Del Prete et al., 2016, section 3.4: identification uses every signal at t - t_d, so that the filters' delay
    cancels.
    """
    found, n = model.estimate_log(*smoothed(model, log, filters, bias)), model.size
    return TorqueLog(found[:, :n], found[:, n : n + 6], found[:, n + 6 :])


def torques_of_motion(model: TorqueModel, q: FloatArray, v: FloatArray, vdot: FloatArray) -> FloatArray:
    """(T, n) torques [N m] that the motion (T, n) of a robot at rest on the ground needs where no sensor says more.

    They are those of `TorqueModel.estimate` without F/T sensors and IMU, by Drake's recursion: nobody waits for the
    import of Numba and for compilation.
    """
    context, nothing = model.create_context(), np.zeros(6)
    rows = (MeasuredMotion(*row, nothing, nothing[:3]) for row in zip(q, v, vdot, strict=True))
    forces = [model.motion_forces(context, row) for row in rows]
    return model.joint_torques(np.array(forces))


def wrench_bias(
    model: TorqueModel, log: SensorLog, untouched: slice, filters: OffLineFilter | None = None
) -> FloatArray:
    """(6k,) what the F/T sensors show of a robot that nothing touches beyond what its motion needs, on average.

    Args:
        model: The kernel.
        log: Readings.
        untouched: Samples during which nothing touches the robot beyond the sensors.
        filters: Windows; None: 81 samples.

    Raises:
        LogError: no sample is named; otherwise as `estimate_log`.
        ParamsError: as `estimate_log`.
    """
    rows = list(zip(*smoothed(model, log, filters, None), strict=True))[untouched]
    if not rows:
        raise LogError(f"wrench bias: expected samples within 0 to {len(log.position)}, got {untouched}")
    context = model.create_context()
    return np.asarray(np.mean([model.reading_error(context, MeasuredMotion(*row[:5]), row[5]) for row in rows], axis=0))


def smoothed(model: TorqueModel, log: SensorLog, filters: OffLineFilter | None, bias: FloatArray | None) -> Row:
    """The six arrays of `Row` at all samples; arguments and errors as `estimate_log`."""
    spec = OffLineFilter.of() if filters is None else filters
    samples = log.position.shape[0]
    if samples < spec.longest:
        raise LogError(f"expected at least {spec.longest} samples, one window; the log has {samples}")
    if log.imu is None and _reads_imu(model):
        raise LogError(f"imu: expected readings, as the model of {model.robot.name} takes the base's motion from them")
    inertial = np.zeros((samples, 6)) if log.imu is None else log.imu
    for name, values, width in (
        ("position", log.position, model.size),
        ("imu", inertial, 6),
        ("wrench", log.wrench, 6 * model.num_sensors),
    ):
        if values.shape != (samples, width):
            raise LogError(f"{name}: expected shape {(samples, width)} for {model.robot.name}, got {values.shape}")
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values).all(axis=1)))
            raise LogError(f"{name}: expected finite readings; sample {row} is not")
    joint = smooth(log.position, spec.encoder.samples, spec.encoder.order, log.dt)
    base = smooth(inertial, spec.inertial.samples, spec.inertial.order, log.dt)
    felt = smooth(log.wrench, spec.wrench.samples, spec.wrench.order, log.dt).value
    if bias is not None:
        if bias.shape != felt.shape[1:]:
            raise LogError(f"bias: expected shape {felt.shape[1:]} for {model.robot.name}, got {bias.shape}")
        felt = felt - bias
    rate = base.first_derivative[:, :3]
    motion = (joint.value, joint.first_derivative, joint.second_derivative)
    return (*motion, base.value, rate, felt)


def _reads_imu(model: TorqueModel) -> bool:
    """Whether what the motion needs depends on the accelerometer."""
    context, rest, turning = model.create_context(), np.zeros(model.size), np.zeros(3)
    moves = (MeasuredMotion(rest, rest, rest, np.full(6, a), turning) for a in (1.0, 0.0))
    still, falling = (model.motion_forces(context, motion) for motion in moves)
    return not np.array_equal(still, falling)
