"""What a designed motion may do, and whether that is possible at all."""

import math
from dataclasses import dataclass

from drake_tc.config.joint_units import TORQUE, TURNING, JointUnits
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint's motion.

    Attributes:
        position: (lowest, highest) [rad].
        velocity: Largest speed [rad/s].
        acceleration: Largest acceleration [rad/s^2].
        jerk: Largest rate of the acceleration [rad/s^3]; infinite where it does not matter.
        torque: Largest torque of the motor [N m]; infinite where it does not matter.
        bandwidth_hz: Highest frequency of the motion that the drive follows [Hz].
        units: Of the joint; of one that slides the limits are in m and N.

    Raises:
        ParamsError: Limits that are not positive, or that contradict each other; one line.
    """

    position: tuple[float, float]
    velocity: float
    acceleration: float
    jerk: float = math.inf
    torque: float = math.inf
    bandwidth_hz: float = 4.0
    units: JointUnits = TURNING

    def __post_init__(self) -> None:
        low, high = self.position
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ParamsError(f"position limits: expected LOW < HIGH [{self.units.position}], got {low:g} and {high:g}")
        for name in ("velocity", "acceleration", "jerk", "torque", "bandwidth_hz"):
            value = getattr(self, name)
            if not value > 0.0:
                raise ParamsError(f"{name}: expected a positive limit, got {value:g}")
        if not (math.isfinite(self.velocity) and math.isfinite(self.acceleration)):
            raise ParamsError("velocity and acceleration: expected finite limits")

    def require(self, gravity: float, friction: float, joint: str) -> None:
        """Refuse a torque limit that cannot even move the joint slowly.

        Args:
            gravity: Largest torque of the load at rest inside the position limits [N m].
            friction: Of the joint at low speed [N m].
            joint: For the message.

        Raises:
            ParamsError: The limits contradict each other.
        """
        needed, at, unit = gravity + friction, self.units.position, self.units.text(TORQUE)
        if self.torque < needed:
            raise ParamsError(
                f"joint {joint}: the limits contradict each other: holding the load within {self.position[0]:.3g} to "
                f"{self.position[1]:.3g} {at} and overcoming friction needs {needed:.3g} {unit}, and the torque limit "
                f"is {self.torque:.3g} {unit}; raise the torque limit or narrow the position limits"
            )

    def require_resolved(self, slowest: float, joint: str) -> None:
        """Refuse a velocity limit at which no sample would take part in a diagnosis.

        Args:
            slowest: Speed that the encoder resolves [rad/s].
            joint: For the message.

        Raises:
            ParamsError: The limit is not above this speed.
        """
        unit = f"{self.units.position}/s"
        if self.velocity <= slowest:
            raise ParamsError(
                f"joint {joint}: a velocity limit of {self.velocity:.3g} {unit} is too small: a diagnosis leaves out "
                f"speeds below {slowest:.3g} {unit}, which the encoder does not resolve"
            )

    def with_margin(self, share: float) -> "JointLimits":
        """The same limits a share narrower, so that a motion between samples keeps the true ones."""
        low, high = self.position
        middle, half = 0.5 * (low + high), 0.5 * (high - low) * (1.0 - share)
        rest = (1.0 - share) * self.velocity, (1.0 - share) * self.acceleration, (1.0 - share) * self.jerk
        torque = (1.0 - share) * self.torque
        return JointLimits((middle - half, middle + half), *rest, torque, self.bandwidth_hz, self.units)
