"""A joint as a design needs it: the torque balance of a motion that has not been recorded yet.

    y = K (tau + J qddot + F_v qdot + F_c d + tau_effects),  tau = J_l qddot + m g l sin(q - zero) + c

d: direction of motion. A solver sees it smoothed over a small speed, so that the criterion is differentiable; motions
are compared, and what they bring is stated, with the sharp direction and the rows that a diagnosis takes.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from drake_tc.diagnosis.data.resolution import Resolution
from drake_tc.diagnosis.data.sliding import LEAST_TRAVEL
from drake_tc.diagnosis.model import RunSpread
from drake_tc.diagnosis.noise import NoiseModel
from drake_tc.diagnosis.problem.columns import Term
from drake_tc.effects.base import Context, DriveEffect, JointNumbers, Signals, TorqueEffect, plain_signals
from drake_tc.effects.library import effect
from drake_tc.filtering.common_kernel import CommonKernel
from drake_tc.logs.rig import Rig
from drake_tc.types import FloatArray

REACH = 0.6
"""Half of the filter's window that must lie in motion, over the filter's width."""
EDGE = 0.5
"""Time at both ends of a motion that is not periodic, in which nothing is counted [s]."""
SLOW = 0.02
"""Speed over which the weight of a sample vanishes, at least, as a share of the largest speed: a passage that is longer
than a sample keeps the criterion differentiable."""
TURN_SPEED = 0.04
"""Speed over which the direction turns over, as a share of the largest speed."""


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
        kernel_width: Of the first filter that a diagnosis applies [s]. final_width: of the second one.
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
    kernel_width: float
    final_width: float
    present: tuple[tuple[str, dict[str, float]], ...] = field(default=())
    floor: float = 0.0
    resolution: Resolution | None = None
    gain_held: bool = False
    servo_damping: float = 0.0
    left: NoiseModel = field(default_factory=NoiseModel)
    spread: RunSpread = field(default_factory=RunSpread)
    rig: Rig | None = None

    @property
    def inertia(self) -> float:
        """Rotor and link together [kg m^2]."""
        return self.rotor_inertia + self.link_inertia

    def load(self, position: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Load torque (T,) [N m]."""
        return np.asarray(
            self.link_inertia * acceleration + self.gravity * np.sin(position - self.zero) + self.constant
        )

    def largest_load(self, low: float, high: float) -> float:
        """Largest load torque at rest between two positions [N m]."""
        grid = np.linspace(low, high, 181)
        return float(np.max(np.abs(self.load(grid, np.zeros_like(grid)))))

    def motor_torque(self, motion: FloatArray, step: float) -> FloatArray:
        """Torque of the motor (T,) [N m] that must keep its limit,  y/K - D qdot, with D the `servo_damping`."""
        return np.asarray(self.signals(motion, step).effort / self.numbers.gain - self.servo_damping * motion[1])

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


def _sliding(joint: DesignJoint, signals: Signals, step: float, *, sharp: bool) -> FloatArray:
    """(T,) weight: 1 where a diagnosis takes the sample, 0 near reversals, with a smooth passage unless `sharp`."""
    least = LEAST_TRAVEL[joint.context.joint_type]
    if sharp:
        moving = ((np.abs(signals.velocity) > joint.slowest) & (signals.travel > least)).astype(float)
    else:
        slow = max(joint.slowest, SLOW * joint.numbers.speed)
        speed, travel = signals.velocity**2, signals.travel**2
        moving = speed / (speed + slow**2) * travel / (travel + least**2)
    reach = max(1, round(REACH * joint.final_width / step))
    return np.asarray(minimum_filter1d(moving, 2 * reach + 1, mode="nearest"))


@lru_cache(maxsize=8)
def _filter_gain(light: float, final: float, step: float, size: int) -> FloatArray:
    """Gain of both kernels of a diagnosis at the frequencies of a real Fourier transform of `size` samples."""
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(size, step), dtype=np.float64)
    first, second = (CommonKernel(max(width, 1.01 * step), step) for width in (light, final))
    return np.asarray(first.gain(frequency) * second.gain(frequency))


LATE_RESPONSES: Mapping[str, Callable[[NDArray[np.complex128], float], NDArray[np.complex128]]] = {
    "delay.loop": lambda turn, delay: np.exp(-turn * delay),
    "delay.command": lambda turn, delay: np.exp(-turn * delay),
    "current_lag": lambda turn, lag: 1.0 / (1.0 + turn * lag),
}
"""Frequency responses of delays, exp(-i w d), and of a lag, 1/(1 + i w T), by effect key."""


class BalanceColumns(ABC):
    """Columns of the balance, of one designed motion or of several, all filtered alike.

    Attributes:
        joint: The joint.
        weight: (T,) of the rows, 0 where the joint does not slide.
    """

    joint: DesignJoint
    weight: FloatArray

    @abstractmethod
    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (T,) after the drive effects among the terms."""

    @abstractmethod
    def changes(self, terms: Sequence[Term]) -> FloatArray:
        """(T, g) change of y* by each of several drive effects alone."""

    @abstractmethod
    def of_each(self, terms: Sequence[Term]) -> list[FloatArray]:
        """Phi (T, k) of each of several terms."""

    def of(self, term: Term) -> FloatArray:
        """Phi (T, k) of one term."""
        return self.of_each([term])[0]

    def design(self, terms: Sequence[Term]) -> FloatArray:
        """[y*, -phi ...] (T, 1 + sum k)."""
        fitted = [t for t in terms if t.effect.coefficients]
        return np.concatenate([self.effort(terms)[:, None], *(-phi for phi in self.of_each(fitted))], axis=1)


def _key(terms: Sequence[Term]) -> Hashable:
    return tuple((t.effect.key, tuple(sorted(t.shape.items()))) for t in terms)


class MotionColumns(BalanceColumns):
    """Columns of the balance over one period of a designed motion, filtered as a diagnosis filters a log.

    Of a periodic motion two periods are computed and the second is kept, so that filters and hysteresis are settled; of
    another one the first and the last half second take no part. Each column is computed once.
    """

    def __init__(
        self, joint: DesignJoint, motion: FloatArray, step: float, *, periodic: bool = True, sharp: bool = False
    ) -> None:
        """Columns of the motion (4, T) sampled every `step` [s]; rows and friction as in a diagnosis if `sharp`."""
        self.joint, self.step, self._periodic = joint, step, periodic
        self._size = motion.shape[1]
        self._signals = joint.signals(np.tile(motion, (1, 2)) if periodic else motion, step, sharp=sharp)
        self._gain = _filter_gain(joint.kernel_width, joint.final_width, step, self._size)
        self.weight = _sliding(joint, self._signals, step, sharp=sharp)[-self._size :]
        if not periodic:
            edge = round(EDGE / step)
            self.weight[:edge] = self.weight[-edge:] = 0.0
        self._known: dict[Hashable, FloatArray] = {}

    @property
    def signals(self) -> Signals:
        """Two periods."""
        return self._signals

    def _reduce(self, values: FloatArray) -> FloatArray:
        kept = values[-self._size :]
        kept = np.where(np.isfinite(kept).all(axis=0), kept, np.nan)
        return np.asarray(np.fft.irfft(np.fft.rfft(kept.T) * self._gain, self._size).T)

    def effort(self, terms: Sequence[Term]) -> FloatArray:
        """y* (T,) after the drive effects among the terms."""
        key = ("effort", _key(terms))
        if key not in self._known:
            values = self._signals.effort
            for term in terms:
                if isinstance(term.effect, DriveEffect) and term.effect.shapes:
                    values = term.effect.transform(values, self._signals, term.shape)
            self._known[key] = self._reduce(values)
        return self._known[key]

    def changes(self, terms: Sequence[Term]) -> FloatArray:
        """(T, g) change of y* by each of several drive effects alone.

        A delay and a lag of a few milliseconds differ by less than what a linear interpolation between the samples of a
        design loses; of a periodic motion they are computed exactly, by their frequency response.
        """
        key = ("changes", _key(terms))
        if key not in self._known:
            self._known[key] = self._changes(terms)
        return self._known[key]

    def _changes(self, terms: Sequence[Term]) -> FloatArray:
        first = terms[0].effect.key
        if not self._periodic or first not in LATE_RESPONSES or any(t.effect.key != first for t in terms):
            before = self.effort(())
            return np.stack([self.effort([term]) - before for term in terms], axis=-1)
        moved = (self._signals.command if first == "delay.command" else self._signals.effort)[-self._size :]
        turn: NDArray[np.complex128] = np.asarray(2j * np.pi * np.fft.rfftfreq(self._size, self.step), np.complex128)
        late = np.stack([LATE_RESPONSES[first](turn, *term.shape.values()) for term in terms])
        changed = np.fft.irfft(np.fft.rfft(moved) * self._gain * (late - 1.0), self._size)
        return np.asarray(changed.T)

    def of_each(self, terms: Sequence[Term]) -> list[FloatArray]:
        """Phi (T, k) of each of several terms; those that are not known yet are filtered together."""
        keys: list[Hashable] = [("of", _key([term])) for term in terms]
        missing = {key: term for key, term in zip(keys, terms, strict=True) if key not in self._known}
        if missing:
            blocks = [t.effect.columns(self._signals, t.shape)[-self._size :] for t in missing.values()]
            ends = np.cumsum([block.shape[1] for block in blocks])
            reduced = np.split(self._reduce(np.concatenate(blocks, axis=1)), ends[:-1], axis=1)
            self._known |= zip(missing, reduced, strict=True)
        return [self._known[key] for key in keys]
