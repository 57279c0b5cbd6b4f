"""What an effect may look at: the signals of one joint's log, or of several joints at one instant."""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from functools import cache
from typing import Any

import numpy as np

from drake_tc.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Signals:
    """What an effect may look at; every array (T,): samples of one joint's log, or joints at one instant.

    Attributes:
        time: Since the start of the run [s].
        position, velocity, acceleration: q, qdot, qddot [rad, rad/s, rad/s^2].
        load_torque: tau on the link side [N m].
        expected_torque: tau as the model so far expects it [N m], without the errors of sensors that it tells.
        slow_torque: tau low-passed three times as hard [N m], for effects that differentiate it: the sensor's noise,
            differentiated, would explain itself. The same as `load_torque` where nothing was filtered.
        effort: y, the commanded effort of the drive [rad | A | V | N m].
        command: The recorded command itself: q_d [rad], i [A], V [V] or tau_d [N m].
        direction: sign of the last resolved motion, in [-1, 1]; between them while it turns over.
        travel: distance moved since the last reversal [rad], >= 0.
        load_slope: d tau / d q of a load that is computed from the position (m g l cos q) [N m/rad], or 0.
        supply_voltage: Voltage that feeds the drive [V], NaN where not recorded; 0 counts as not known.
        known_torque: Torque of effects whose values the owner declares [N m].
        temperature: [deg C], NaN where it was not recorded.
        motor_position: Motor-side position over the gear ratio [rad], NaN where not recorded.
        rotor_inertia: The declared J [kg m^2], 0 where none was declared.
        link_inertia: Of a load that is computed from the position (a pendulum's, about the axis) [kg m^2], or 0.
        viscous: The current model's viscous coefficient [N m s/rad], for sensor errors that act through it.
        stiffness: The current model's 1/K of a position servo [N m/rad]; 0 for other drives.
        period: Sampling period [s]; 0 for an instant.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    load_torque: FloatArray
    expected_torque: FloatArray
    slow_torque: FloatArray
    effort: FloatArray
    command: FloatArray
    direction: FloatArray
    travel: FloatArray
    load_slope: FloatArray
    temperature: FloatArray
    motor_position: FloatArray
    supply_voltage: FloatArray
    known_torque: FloatArray
    rotor_inertia: float = 0.0
    link_inertia: float = 0.0
    viscous: float = 0.0
    stiffness: float = 0.0
    period: float = 0.0

    def __len__(self) -> int:
        return int(self.position.size)

    def has(self, name: str) -> bool:
        """Whether the signal `name` was recorded at all (an unrecorded one is all NaN)."""
        return bool(np.isfinite(getattr(self, name)).any())

    def take(self, index: BoolArray | IntArray | slice) -> "Signals":
        """The same signals at the samples `index`."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        changed: dict[str, Any] = {name: v[index] for name, v in values.items() if isinstance(v, np.ndarray)}
        return replace(self, **changed)

    def lazily(self, change: Callable[[FloatArray], FloatArray]) -> "Signals":
        """The signals with every array changed. An array is computed when it is first read: most effects read few.

        Args:
            change: (T,) to (S,); S is the same for all arrays.
        """
        made = object.__new__(Signals)
        made.__dict__.update({name: getattr(self, name) for name in _numbers()})
        made.__dict__["_unread"] = (self, change)
        return made

    def __getattr__(self, name: str) -> FloatArray:
        """An array of `lazily` that has not been read."""
        if name.startswith("_") or "_unread" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        whole, change = self.__dict__["_unread"]
        return self.__dict__.setdefault(name, change(getattr(whole, name)))  # type: ignore[no-any-return]


@cache
def _numbers() -> tuple[str, ...]:
    """The fields that are no arrays."""
    return tuple(f.name for f in fields(Signals) if f.default is not MISSING)


def plain_signals(size: int, known: Mapping[str, FloatArray]) -> Signals:
    """Signals (size,) of which only some are known; all others are 0."""
    nil: dict[str, Any] = {f.name: np.zeros(size) for f in fields(Signals) if f.default is MISSING}
    return Signals(**(nil | dict(known)))
