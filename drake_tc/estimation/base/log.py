"""The estimator over a log: arrays in, arrays out; and how far the result is from a measured truth."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from drake_tc.estimation.base.state import BaseState, Readings
from drake_tc.types import FloatArray


class Estimator(Protocol):
    """`CopEstimator` or `FootCentreEstimator`."""

    num_joints: int
    num_contacts: int

    def initial_state(self, position: FloatArray, yaw: float) -> BaseState:
        """Before the first tick."""
        ...

    def step(self, state: BaseState, readings: Readings) -> BaseState:
        """After one sample."""
        ...


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

    def readings(self, i: int) -> Readings:
        """Sample i."""
        return Readings(
            self.q[i], self.qd[i], self.gyro[i], self.accel[i], self.tilt[i], self.wrench[i], self.switch[i]
        )


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
    estimator: Estimator,
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
        state = estimator.step(state, log.readings(i))
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
