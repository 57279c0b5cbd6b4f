"""The few terms in which simulators describe an actuator.

    kp u - (F(v) sign(v) + damping v + quadratic v |v|) - tau_load = armature vdot
    F(v) = frictionloss + load_friction |tau_load| + height exp(-|v / velocity|^exponent)

with u = q_d - q of a position servo, or the command of another drive; kp = 1/K.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

Drive = Literal["position_servo", "current", "voltage", "torque"]


@dataclass(frozen=True)
class StribeckPeak:
    """Dry friction that falls with the speed.

    Attributes:
        height: Above the dry friction, at rest [N m].
        velocity: At which it has fallen to 1/e of that [rad/s].
        exponent: Of the speed over `velocity`.
    """

    height: float
    velocity: float
    exponent: float


@dataclass(frozen=True)
class Terms:
    """What simulators know of an actuator, at the joint.

    Attributes:
        drive: What the command is.
        kp: Torque for one unit of effort [N m/rad, N m/A, N m/V or 1].
        armature: Reflected rotor inertia [kg m^2].
        damping: [N m s/rad].
        quadratic: [N m s^2/rad^2].
        frictionloss: Dry friction [N m].
        stribeck: Its peak at rest; None: none.
        load_friction: Share of the load by which it grows [-].
        delay: Of the command [s].
        torque_limit: Largest torque of the drive [N m]; None: none known.
        backlash: Play of the gear [rad].
        torque_constant: Of a drive on a voltage [N m/A]; kp is this over the resistance. None: not known.
    """

    drive: Drive
    kp: float
    armature: float = 0.0
    damping: float = 0.0
    quadratic: float = 0.0
    frictionloss: float = 0.0
    stribeck: StribeckPeak | None = None
    load_friction: float = 0.0
    delay: float = 0.0
    torque_limit: float | None = None
    backlash: float = 0.0
    torque_constant: float | None = None


@dataclass(frozen=True)
class ReadJoint:
    """What a file says of one joint.

    Attributes:
        terms: Its terms; those that the file does not have are 0 or None.
        driven: Whether the file has an actuator of the joint, so that `terms.drive` and `terms.kp` are its own.
        derivative_gain: Damping of a position servo [N m s/rad]; 0 where the file has none.
        effects: Parameters of effects that are no terms, by id; None for a value that cannot be taken over.
        unused: What the file has beside these and is not used, in words.
    """

    terms: Terms
    driven: bool = False
    derivative_gain: float = 0.0
    effects: Mapping[str, Mapping[str, float] | None] = field(default_factory=dict)
    unused: tuple[str, ...] = ()

    def with_servo_damping(self) -> Terms:
        """The terms with the servo's damping as a part of the joint's."""
        return replace(self.terms, damping=self.terms.damping + self.derivative_gain)
