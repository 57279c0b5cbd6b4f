"""The growing sinusoid beside a design, and motions from rest into a motion and out of it, within the limits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits
from drake_tc.identification.excitation import MotionLimits, growing_sinusoid
from drake_tc.types import FloatArray

LENGTHS = (0.5, 1.0, 2.0, 3.0, 5.0)
"""Lengths that are tried [s]."""
PLACES = 41
"""Positions of rest that are tried."""
TURNED = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
"""Signs of position and derivatives backwards in time."""


def quintic(start: FloatArray, end: FloatArray, length: float, time: FloatArray) -> FloatArray:
    """(4, T) position, velocity, acceleration, jerk of the polynomial between two states (3,) in `length` [s]."""
    spline = BPoly.from_derivatives([0.0, length], [start, end])
    return np.stack([spline(time, order) for order in range(4)])


def lead_in(
    state: FloatArray,
    limits: JointLimits,
    joint: str,
    torque: Callable[[FloatArray], FloatArray] | None = None,
) -> tuple[float, float]:
    """(position of rest [rad], length [s]) of the shortest polynomial from rest to a state (3,) within the limits.

    Run backwards with the velocity turned it leads from that state to rest.

    Args:
        state: Position, velocity and acceleration at its end.
        limits: That it keeps.
        joint: For the message.
        torque: (4, T) motion to the motor's torque (T,) [N m]; None where the torque has no limit.

    Raises:
        ParamsError: None of the lengths keeps the limits.
    """
    low, high = limits.position
    bounds = np.array([limits.velocity, limits.acceleration, limits.jerk])[:, None]
    for length in LENGTHS:
        time = np.linspace(0.0, length, 101)
        for rest in sorted(np.linspace(low, high, PLACES), key=lambda q: abs(q - state[0])):
            made = quintic(np.array([rest, 0.0, 0.0]), state, length, time)
            inside = low - 1e-9 <= made[0].min() and made[0].max() <= high + 1e-9
            if not inside or (np.abs(made[1:]) > bounds * (1.0 + 1e-9)).any():
                continue
            if torque is None or float(np.abs(torque(made)).max()) <= limits.torque * (1.0 + 1e-9):
                return float(rest), length
    raise ParamsError(
        f"joint {joint}: no lead-in of up to {LENGTHS[-1]:g} s from rest keeps the limits; raise the limit of the jerk "
        "or of the torque"
    )


@dataclass(frozen=True, eq=False)
class Experiment:
    """A motion of some joints from rest to rest.

    Attributes:
        joints: Names. limits: That lead-in and lead-out of each keep.
        motion: (4, T, n) position and its three derivatives: one period, or the whole motion.
        step: Between samples [s]. periods: Of the motion; 0 for one that is made once, as it is.
        torque: (4, T) motion to the motor's torque (T,) [N m] of a single joint; None where torques have no limit.
    """

    joints: Sequence[str]
    limits: Sequence[JointLimits]
    motion: FloatArray
    step: float
    periods: int
    torque: Callable[[FloatArray], FloatArray] | None = None

    def sampled(self, rate_hz: float) -> tuple[FloatArray, dict[str, FloatArray]]:
        """(time (T,), joint to motion (4, T)) at a rate [Hz]: all lead in and out together, and rest before and after.

        A lead-out is a lead-in backwards in time.

        Raises:
            ParamsError: No lead-in keeps the limits.
        """
        motion = np.concatenate([self.motion, self.motion[:, : min(self.periods, 1)]], axis=1)
        starts, ends = motion[:3, 0], TURNED[:3] * motion[:3, -1]
        back = None if self.torque is None else lambda made: self.torque(TURNED * made)  # type: ignore[misc]
        into, out = (
            [
                lead_in(state, limits, joint, torque)
                for state, limits, joint in zip(states.T, self.limits, self.joints, strict=True)
            ]
            for states, torque in ((starts, self.torque), (ends, back))
        )
        before, after = (max(length for _, length in leads) for leads in (into, out))
        period = (motion.shape[1] - 1) * self.step
        end = before + max(self.periods, 1) * period
        time = np.arange(int(np.ceil((end + after) * rate_hz - 1e-6)) + 1) / rate_hz
        leading, leaving, made = time < before, time > end, {}
        for i, (joint, (start, first), (stop, last)) in enumerate(zip(self.joints, into, out, strict=True)):
            spline = BPoly.from_derivatives(np.arange(motion.shape[1]) * self.step, motion[:3, :, i].T)
            rows = np.stack([spline(np.mod(time - before, period), order) for order in range(4)])
            at, ago = time[leading] - (before - first), end + last - time[leaving]
            rows[:, leading] = quintic(np.array([start, 0.0, 0.0]), starts[:, i], first, np.maximum(at, 0.0))
            rows[:, leaving] = TURNED * quintic(np.array([stop, 0.0, 0.0]), ends[:, i], last, np.maximum(ago, 0.0))
            rows[1:, (time < before - first) | (time > end + last)] = 0.0
            made[joint] = rows
        return time, made


DEFAULT_HZ, APART = 0.4, 0.1
"""Frequency of the growing sinusoid with which a design is compared [Hz], and by which share of it the next joint's is
higher."""
SMALLER, LEAST_DEFAULT = 0.95, 1e-3
"""Factor by which these sinusoids are made smaller until they are allowed, and their least share of the span."""


def growing_sinusoids(
    limits: Sequence[JointLimits],
    duration: float,
    step: float,
    allowed: Callable[[FloatArray], bool],
    centre: FloatArray | None = None,
) -> FloatArray:
    """(4, T, n) growing sinusoids of a length and within limits, which they fill at their end.

    Args:
        limits: Of each joint; the torques are not looked at.
        duration: Of the motion [s].
        step: Time between its samples [s].
        allowed: Of a motion (4, T, n).
        centre: (n,) middle positions; None takes those of the limits.
    """
    time: FloatArray = np.asarray(np.arange(round(duration / step)) * step, dtype=np.float64)
    share = 1.0
    while True:
        made = []
        for i, each in enumerate(limits):
            low, high = each.position
            half, edge = 0.5 * share * (high - low), 0.05 * (high - low)
            middle = 0.5 * (low + high) if centre is None else float(np.clip(centre[i], low + edge, high - edge))
            bounds = MotionLimits(each.position, each.velocity, each.acceleration)
            hz = DEFAULT_HZ * (1.0 + APART * i)
            own = growing_sinusoid(time, hz, 0.05 * half, 0.95 * half / duration, bounds, middle)
            made.append(np.stack([own.position, own.velocity, own.acceleration, np.gradient(own.acceleration, step)]))
        motion = np.stack(made, axis=-1)
        smooth = (np.abs(motion[3]).max(axis=0) <= [each.jerk for each in limits]).all()
        if (smooth and allowed(motion)) or share < LEAST_DEFAULT:
            return motion
        share *= SMALLER


def default_motion(joint: DesignJoint, limits: JointLimits, duration: float, step: float) -> FloatArray:
    """(4, T) growing sinusoid of one joint within its limits, that of the motor's torque too."""
    made = growing_sinusoids(
        (limits,), duration, step, lambda motion: joint.keeps_torque(motion[:, :, 0], step, limits.torque)
    )
    return np.asarray(made[:, :, 0])
