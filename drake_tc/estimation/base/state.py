"""What goes into a tick, what is remembered between ticks, and what comes out; all arrays, all of a fixed size."""

from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np
from pydrake.math import RotationMatrix

from drake_tc.types import FloatArray

FLAGS = (
    "no_contact",
    "encoder_missing",
    "encoder_spike",
    "imu_missing",
    "wrench_missing",
    "yaw_drift",
    "load_mismatch",
    "inconsistent",
    "failed",
)
"""Flags of the whole: nothing carries load, so the IMU alone carries the estimate; readings that are not finite (three
kinds of sensors); an encoder step that was not believed; the gyro turns against the contacts; loads and weight differ;
contacts were too far from their references, which were taken anew; a tick gave no numbers."""
CONTACT_FLAGS = ("on", "limited", "slip", "tilt", "force_offset")
"""Flags of each contact: carries load; its centre of pressure is at the sole's edge; slips and is left out; its foot is
tilted against the touch-down; its sensor shows load in the air."""


@dataclass(frozen=True, eq=False)
class Readings:
    """One sample of all sensors; n joints, k contacts. NaN marks what is missing.

    Attributes:
        q, qd: (n,) encoders [rad, rad/s].
        gyro, accel: (3,) of the IMU, its axes [rad/s, m/s^2 (specific force)].
        tilt: (2,) roll and pitch of the IMU's frame [rad]; NaN where the IMU gives none.
        wrench: (k, 6) [f; t] of each contact's sensor, its axes [N, N m].
        switch: (k,) 0 by the load's thresholds, 1 held on, -1 held off.
    """

    q: FloatArray
    qd: FloatArray
    gyro: FloatArray
    accel: FloatArray
    tilt: FloatArray
    wrench: FloatArray
    switch: FloatArray


CONTACT_MEMORY = ("on", "load", "dropped", "airborne", "sink", "shape", "held_for", "air_load")
"""Columns of `BaseState.contacts`: carries load (0 or 1); load [N]; ticks until a contact that slipped counts again;
ticks in the air; how far its sole gives way [m], and the shape of that [-] (`soft_sole`); ticks since its reference
was taken; mean load in the air [N]."""
SCALARS = ("started", "yaw", "rested", "quiet", "stood", "paired", "mismatch", "ground")


@dataclass(frozen=True, eq=False)
class BaseState:
    """Between two ticks. World W: z up, where the base started; base B; n joints, k contacts.

    Attributes:
        started: 1 after the first tick. yaw: Of the base [rad]. rested: Ticks that the robot has rested so far.
        quiet: Ticks since something moved. stood: Ticks in which contacts told the velocity, 0 while none does.
        paired: Ticks in which two of them told yaw.
        mismatch: Mean of loads less weight [N].
        ground: Height of a level ground [m]; NaN before the first contact.
        position: (3,) p_WB [m]. rotation: (3, 3) R_WB; its last row is the vertical in B.
        velocity: (3,) ydot, of B's origin in its axes [m/s]. rate: (3,) omega_WB in B [rad/s].
        lever: (3,) velocity of the IMU against B's origin, in B [m/s].
        bias: (3,) of the gyro, its axes [rad/s].
        trail: (6,) low-passed [gyro; accel] (`imu_age`).
        velocity_innovation: (3,) by how much the contacts overruled the accelerometer's velocity, in B [m/s].
        usual: (k, 2) low-passed centre of pressure in C [m].
        held: (k, 3) where the centre of pressure is held, in W [m].
        foot: (k, 3, 3) R_WC with which the reference moves. foot_up: (k, 3) the vertical in C at touch-down.
        pressure: (k, 2) centre of pressure in C [m].
        drift: (k, 3) averaged velocity against the others, in B [m/s].
        contacts: (k, 8) `CONTACT_MEMORY`.
        q, qd: (n,) last believed [rad, rad/s]. doubt: (n,) ticks for which an encoder was not believed.
        flags: (9,) `FLAGS`. contact_flags: (k, 5) `CONTACT_FLAGS`.
    """

    started: float
    yaw: float
    rested: float
    quiet: float
    stood: float
    paired: float
    mismatch: float
    ground: float
    position: FloatArray
    rotation: FloatArray
    velocity: FloatArray
    rate: FloatArray
    lever: FloatArray
    bias: FloatArray
    trail: FloatArray
    velocity_innovation: FloatArray
    usual: FloatArray
    held: FloatArray
    foot: FloatArray
    foot_up: FloatArray
    pressure: FloatArray
    drift: FloatArray
    contacts: FloatArray
    q: FloatArray
    qd: FloatArray
    doubt: FloatArray
    flags: FloatArray
    contact_flags: FloatArray

    def flag(self, name: str) -> bool:
        """Whether a flag of `FLAGS` is up."""
        return bool(self.flags[FLAGS.index(name)])


ARRAYS = tuple(item.name for item in fields(BaseState))[len(SCALARS) :]
_scalars, _arrays = attrgetter(*SCALARS), attrgetter(*ARRAYS)


@lru_cache(maxsize=32)
def _layout(n: int, k: int) -> tuple[tuple[str, slice, tuple[int, ...]], ...]:
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(
        ("position", "velocity", "rate", "lever", "bias", "velocity_innovation"), (3,)
    )
    shapes |= dict.fromkeys(("held", "foot_up", "drift"), (k, 3))
    shapes |= dict.fromkeys(("q", "qd", "doubt"), (n,))
    shapes |= {
        "rotation": (3, 3),
        "foot": (k, 3, 3),
        "pressure": (k, 2),
        "usual": (k, 2),
        "trail": (6,),
        "contacts": (k, len(CONTACT_MEMORY)),
    }
    shapes |= {"flags": (len(FLAGS),), "contact_flags": (k, len(CONTACT_FLAGS))}
    sizes = [int(np.prod(shapes[name])) for name in ARRAYS]
    ends = np.cumsum([len(SCALARS), *sizes]).tolist()
    return tuple((name, slice(a, b), shapes[name]) for name, (a, b) in zip(ARRAYS, pairwise(ends), strict=True))


def place_of(name: str, n: int, k: int) -> slice:
    """Where an array stands in a packed state, for n joints and k contacts."""
    return next(part for other, part, _ in _layout(n, k) if other == name)


def packed(state: BaseState) -> FloatArray:
    """All of a state in one vector: scalars first, then the arrays."""
    return np.concatenate([_scalars(state), *[array.ravel() for array in _arrays(state)]], dtype=float)


def unpacked(vector: FloatArray, n: int, k: int) -> BaseState:
    """The state in a vector, for n joints and k contacts."""
    held: dict[str, Any] = dict(zip(SCALARS, vector[: len(SCALARS)].tolist(), strict=True))
    for name, part, shape in _layout(n, k):
        held[name] = vector[part].reshape(shape) if len(shape) > 1 else vector[part]
    state = object.__new__(BaseState)  # its own way through 28 fields takes four times as long
    state.__dict__.update(held)
    return state


def initial_state(q: FloatArray, k: int, position: FloatArray, yaw: float) -> BaseState:
    """Before the first tick.

    Args:
        q: (n,) what the joints are taken to be until then [rad].
        k: Contacts.
        position: (3,) where the base starts [m].
        yaw: Its yaw there [rad].
    """
    arrays = {name: np.zeros(shape) for name, _, shape in _layout(len(q), k)}
    arrays |= {
        "position": np.array(position, dtype=float),
        "rotation": np.asarray(RotationMatrix.MakeZRotation(yaw).matrix()),
        "q": np.array(q),
    }
    arrays["foot"] = np.tile(np.eye(3), (k, 1, 1))
    return BaseState(0.0, float(yaw), 0.0, 0.0, 0.0, 0.0, 0.0, float("nan"), **arrays)
