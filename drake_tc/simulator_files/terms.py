"""The few terms in which simulators describe an actuator.

    kp u - (F(v) sign(v) + damping v + quadratic v |v|) - stiffness q - preload - tau_load = armature vdot
    F(v) = frictionloss + load_friction |tau_load| + height exp(-|v / velocity|^exponent)

with u = q_d - q of a position servo, or the command of another drive; kp = 1/K. The command is delayed, and passes a
first-order filter of time constant `lag`. The limit of the torque is that of kp u - derivative_gain v as a whole.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from drake_tc.config.joint_units import JointType

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
class Ripple:
    """A torque over the position: cosine cos(cycles q) + sine sin(cycles q).

    Attributes:
        cosine: [N m].
        sine: [N m].
        cycles: Per turn of the joint.
    """

    cosine: float
    sine: float
    cycles: float


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
        stiffness: Of a spring along the joint [N m/rad].
        preload: Torque of that spring at position 0 [N m].
        lag: Time constant of a first-order filter of the command [s].
        integral_rate: Integral gain of a position servo over kp [1/s].
        derivative_gain: Part of `damping` that the limit of the torque acts on too [N m s/rad].
        ripple: Torque over the position; None: none.
        compliance: Angle between motor and link for 1 N m [rad/(N m)].
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
    stiffness: float = 0.0
    preload: float = 0.0
    lag: float = 0.0
    integral_rate: float = 0.0
    derivative_gain: float = 0.0
    ripple: Ripple | None = None
    compliance: float = 0.0


@dataclass(frozen=True)
class ReadJoint:
    """What a file says of one joint.

    Attributes:
        terms: Its terms; those that the file does not have are 0 or None. A servo's own damping is not part of
            `terms.damping`.
        driven: Whether the file has an actuator of the joint, so that `terms.drive` and `terms.kp` are its own.
        derivative_gain: Damping of a position servo [N m s/rad]; 0 where the file has none.
        effects: Parameters of effects that are no terms, by id; None for a value that cannot be taken over.
        unused: What the file has beside these and is not used, in words.
        joint_type: Whether the joint turns or slides; None: the file does not say.
    """

    terms: Terms
    driven: bool = False
    derivative_gain: float = 0.0
    effects: Mapping[str, Mapping[str, float] | None] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    joint_type: JointType | None = None

    def with_servo_damping(self) -> Terms:
        """The terms with the servo's damping as a part of the joint's."""
        return replace(
            self.terms, damping=self.terms.damping + self.derivative_gain, derivative_gain=self.derivative_gain
        )

    def with_terms(self, **changes: Any) -> "ReadJoint":
        """The joint with other values of some fields of its terms."""
        return replace(self, terms=replace(self.terms, **changes))

    def also_unused(self, *what: str) -> "ReadJoint":
        """The joint with more that is not used."""
        return replace(self, unused=(*self.unused, *what)) if what else self
