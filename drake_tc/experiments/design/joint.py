"""A joint as a design needs it: the torque balance of a motion that has not been recorded yet.

    y = K (tau + J qddot + F_v qdot + F_c d + tau_effects),  tau = J_l qddot + m g l sin(q - zero) + c

d: direction of motion. The motor's torque, which has a limit, is that of friction that turns over smoothly.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.diagnosis.model import RunSpread
from drake_tc.diagnosis.noise import NoiseModel
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, JointNumbers, Signals, TorqueEffect, plain_signals
from drake_tc.effects.library import effect
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

TURN_SPEED = 0.04
"""Speed over which the direction turns over, as a share of the largest speed."""
PER_SECOND = 20.0
"""Independent samples a second, where no log tells them."""


@dataclass(frozen=True)
class DesignJoint:
    """What is known of a joint before the next experiment.

    Attributes:
        name: Of the joint.
        numbers: Its declared model.
        context: What its logs offer to effects; the next run offers the same.
        rotor_inertia: J [kg m^2] in the declared model.
        link_inertia, gravity, zero, constant: Of the load: J_l [kg m^2], m g l [N m], angle at which it hangs [rad], c
            [N m].
        declared: Terms of the declared model that every fit has.
        noise: What noise leaves of the balance [N m].
        independent_per_second: Independent samples in it [1/s].
        slowest: Speed below which samples take no part [rad/s].
        present: Effects of the model besides the declared ones, with their parameters.
        floor: Noise floor: part of `noise` due to sensor noise and encoder steps [N m].
        resolution: Of the sensors; None where it is not known from a log.
        gain_held: Whether every fit holds the drive gain at its value, so that it is no parameter.
        servo_damping: Part of the viscous friction that is the declared damping of the position servo [N m s/rad].
        left: Noise model of what the most probable model of the logs leaves.
        spread: What differs from run to run of the logs.
        rig: Of the logs; None where there is none.
    """

    name: str
    numbers: JointNumbers
    context: Context
    rotor_inertia: float
    link_inertia: float
    gravity: float
    zero: float
    constant: float
    declared: tuple[Term, ...]
    noise: float
    independent_per_second: float
    slowest: float
    present: tuple[tuple[str, dict[str, float]], ...] = field(default=())
    floor: float = 0.0
    resolution: Resolution | None = None
    gain_held: bool = False
    servo_damping: float = 0.0
    left: NoiseModel = field(default_factory=NoiseModel)
    spread: RunSpread = field(default_factory=RunSpread)
    rig: Rig | None = None

    def load(self, position: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Load torque (T,) [N m]."""
        return np.asarray(
            self.link_inertia * acceleration + self.gravity * np.sin(position - self.zero) + self.constant
        )

    def largest_load(self, low: float, high: float) -> float:
        """Largest load torque at rest between two positions [N m]."""
        grid = np.linspace(low, high, 181)
        return float(np.max(np.abs(self.load(grid, np.zeros_like(grid)))))

    def least_torque(self, low: float, high: float) -> float:
        """Torque of the motor that holds the load anywhere between two positions and overcomes friction [N m]."""
        return self.largest_load(low, high) + self.numbers.coulomb

    def motor_torque(self, motion: FloatArray, step: float) -> FloatArray:
        """Torque of the motor (T,) [N m] that must keep its limit,  y/K - D qdot, with D the `servo_damping`."""
        return np.asarray(self.signals(motion, step).effort / self.numbers.gain - self.servo_damping * motion[1])

    def keeps_torque(self, motion: FloatArray, step: float, limit: float) -> bool:
        """Whether the motor's torque is within a limit [N m] in a motion (4, T)."""
        return float(np.abs(self.motor_torque(motion, step)).max()) <= limit * (1.0 + 1e-9)

    def signals(self, motion: FloatArray, step: float, *, sharp: bool = False) -> Signals:
        """What the next log would show, free of noise, for a motion (4, T); the direction turns at once if `sharp`."""
        q, v, a, _ = motion
        n, servo = self.numbers, self.context.drive == "position_servo"
        tau = self.load(q, a)
        direction = np.sign(v) if sharp else np.tanh(v / (TURN_SPEED * max(n.speed, 1e-9)))
        pendulum = self.context.load == "pendulum"
        known = {
            "time": np.arange(q.size) * step,
            "position": q,
            "velocity": v,
            "acceleration": a,
            "load_torque": tau,
            "expected_torque": tau,
            "slow_torque": tau,
            "direction": direction,
            "travel": _travel(q, v, a),
            "load_slope": self.gravity * np.cos(q - self.zero) if pendulum else np.zeros_like(q),
            "temperature": np.full_like(q, np.nan),
            "motor_position": np.full_like(q, np.nan),
            "supply_voltage": np.full_like(q, np.nan),
        }
        signals = replace(
            plain_signals(q.size, known),
            rotor_inertia=self.rotor_inertia,
            link_inertia=self.link_inertia if pendulum else 0.0,
            viscous=n.viscous,
            stiffness=1.0 / n.gain if servo else 0.0,
            period=step,
        )
        torque = tau + self.rotor_inertia * a + n.viscous * v + n.coulomb * direction
        for key, parameters in self.present:
            member = effect(key)
            if isinstance(member, TorqueEffect):
                torque = torque + member.torque(signals, parameters)
        effort = n.gain * torque
        return replace(signals, effort=effort, command=q + effort if servo else effort)


def _travel(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Distance since the last reversal (T,), whose place between two samples is q - v^2/(2 a) of the next sample."""
    turned = np.concatenate([[0], np.flatnonzero(np.diff(np.sign(v)) != 0.0) + 1])
    start = turned[np.searchsorted(turned, np.arange(q.size), side="right") - 1]
    back = np.where(np.abs(a) > 1e-9, 0.5 * v**2 / np.where(np.abs(a) > 1e-9, a, 1.0), 0.0)
    return np.asarray(np.abs(q - (q - back)[start]))
