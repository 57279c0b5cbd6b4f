"""What goes into a tick, what is remembered between ticks, and what comes out; all arrays, all of a fixed size."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.math import RotationMatrix

from drake_tc.kernels.base_state import (
    CONTACT_FLAGS,
    CONTACT_MEMORY,
    FLAGS,
    GROUND,
    SCALARS,
    YAW,
    Memory,
    memory_of,
    size_of,
)
from drake_tc.types import FloatArray

__all__ = [
    "CONTACT_FLAGS",
    "CONTACT_MEMORY",
    "FLAGS",
    "SCALARS",
    "BaseState",
    "Readings",
    "Sample",
    "initial_state",
    "packed",
    "place_of",
    "unpacked",
]


class Sample(NamedTuple):
    """One sample of all sensors as a tick takes it; n joints, k contacts. NaN marks what is missing.

    Attributes:
        q: (n,) encoders [rad].
        qd: (n,) their speeds [rad/s].
        imu: (6,) [gyro; accel] in the IMU's axes [rad/s, m/s^2 (specific force)].
        tilt: (2,) roll and pitch of the IMU's frame [rad]; NaN where the IMU gives none.
        wrench: (6k,) [f; t] of each contact's sensor, its axes [N, N m].
        switch: (k,) 0 by the load's thresholds, 1 held on, -1 held off.
    """

    q: FloatArray
    qd: FloatArray
    imu: FloatArray
    tilt: FloatArray
    wrench: FloatArray
    switch: FloatArray


@dataclass(frozen=True, eq=False)
class Readings:
    """A `Sample` of a log, with gyro (3,) and accel (3,) apart, and wrench (k, 6)."""

    q: FloatArray
    qd: FloatArray
    gyro: FloatArray
    accel: FloatArray
    tilt: FloatArray
    wrench: FloatArray
    switch: FloatArray

    def sample(self) -> Sample:
        """The same as a tick takes it."""
        imu, wrench = np.concatenate((self.gyro, self.accel)), np.ravel(self.wrench)
        parts = (self.q, self.qd, imu, self.tilt, wrench, self.switch)
        return Sample(*(np.ascontiguousarray(part, dtype=float) for part in parts))


class BaseState(Memory):
    """Between two ticks; its attributes are those of `Memory`."""

    __slots__ = ()

    def scalar(self, name: str) -> float:
        """One of `SCALARS`."""
        return float(self.scalars[SCALARS.index(name)])

    def flag(self, name: str) -> bool:
        """Whether a flag of `FLAGS` is up."""
        return bool(self.flags[FLAGS.index(name)])


def place_of(name: str, n: int, k: int) -> slice:
    """Where an array stands in a packed state, for n joints and k contacts."""
    places = np.ravel(getattr(memory_of(np.arange(float(size_of(n, k))), n, k), name))
    return slice(int(places[0]), int(places[-1]) + 1)


def packed(state: BaseState) -> FloatArray:
    """All of a state in one vector."""
    return np.concatenate([part.ravel() for part in state], dtype=float)


def unpacked(vector: FloatArray, n: int, k: int) -> BaseState:
    """The state in a vector, for n joints and k contacts, as views."""
    return BaseState(*memory_of(vector, n, k))


def initial_state(q: FloatArray, k: int, position: FloatArray, yaw: float) -> BaseState:
    """Before the first tick.

    Args:
        q: (n,) what the joints are taken to be until then [rad].
        k: Contacts.
        position: (3,) where the base starts [m].
        yaw: Its yaw there [rad].
    """
    state = unpacked(np.zeros(size_of(len(q), k)), len(q), k)
    state.scalars[YAW], state.scalars[GROUND] = yaw, np.nan
    state.position[:], state.rotation[:] = position, RotationMatrix.MakeZRotation(yaw).matrix()
    state.foot[:], state.q[:] = np.eye(3), q
    return state
