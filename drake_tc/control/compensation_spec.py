"""`CompensationSpec`: the signals from which a torque controller computes friction and rotor inertia."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from drake_tc.errors import ParamsError

Source = Literal["estimate", "reference"]
AccelerationSource = Literal["none", "estimate", "reference"]


@dataclass(frozen=True)
class CompensationSpec:
    """Which motion the actuators' effects are compensated for.

    Estimates are delayed, and compensating friction with them feeds back; references are neither.

    Attributes:
        velocity: Velocity for viscous friction and similar effects; Del Prete et al. (2016) use the estimate.
        direction: Direction for dry friction and for drives whose gain depends on the direction,
            tanh(v/direction_speed).
        acceleration: Acceleration for the rotor inertia; `none`: not compensated.
        direction_speed: Speed v_s > 0 [rad/s] at which 76 % of the dry friction are compensated.
        smoothing: Smoothing of the inverse of dead zones and play, one number or one per joint [effort]
            (`Compensator`).

    Raises:
        ParamsError: an unknown key or a number that is not possible.

    Example:
        >>> CompensationSpec(velocity="reference").needs_reference
        True
    """

    velocity: Source = "estimate"
    direction: Source = "reference"
    acceleration: AccelerationSource = "reference"
    direction_speed: float = 0.01
    smoothing: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        for key, possible in (
            ("velocity", get_args(Source)),
            ("direction", get_args(Source)),
            ("acceleration", get_args(AccelerationSource)),
        ):
            if getattr(self, key) not in possible:
                raise ParamsError(
                    f"compensation.{key}: expected one of {', '.join(possible)}, got {getattr(self, key)!r}"
                )
        if not (math.isfinite(self.direction_speed) and self.direction_speed > 0.0):
            raise ParamsError(
                f"compensation.direction_speed: expected a positive speed [rad/s], got {self.direction_speed!r}"
            )

    @property
    def needs_reference(self) -> bool:
        """Whether the `reference` port is needed."""
        return "reference" in (self.velocity, self.direction, self.acceleration)
