"""Why a design may not hold: a servo that does not follow it, and limits that keep two effects close.

A position servo of stiffness 1/K that is commanded to q_d moves the joint, but for dry friction and gravity, as

    J q'' + F_v q' = (q_d - q)/K,   H(w) = 1/(1 - K J w^2 + i K F_v w)                              (following)

with the rotor's and the load's inertia J. The motion that the joint then makes is H applied to the designed one.

Which limit stands in the way of a goal shows in the worth of rough motions, each limit in turn twice as wide.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from drake_tc.errors import ParamsError
from drake_tc.experiments.design.joint import DesignJoint
from drake_tc.experiments.design.motions import JointLimits, motion_basis, scaled
from drake_tc.experiments.design.search import MotionSearch, random_start, single_waves
from drake_tc.types import FloatArray

FOLLOWED = 1.05
"""Largest |H| up to which the servo is said to follow, and largest speed and acceleration over their limits."""


def followed_up_to(joint: DesignJoint) -> float:
    """Frequency [Hz] up to which |H| <= `FOLLOWED`; infinite where the servo does not resonate, or is none."""
    n = joint.numbers
    if joint.context.drive != "position_servo" or not n.inertia > 0.0:
        return math.inf
    # |H|^-2 = (1 - x)^2 + d x with x = K J w^2 and d = K F_v^2/J
    damping = n.gain * n.viscous**2 / n.inertia
    half, end = 1.0 - 0.5 * damping, 1.0 - FOLLOWED**-2
    if half <= 0.0 or half**2 <= end:
        return math.inf
    x = half - math.sqrt(half**2 - end)
    return math.sqrt(x / (n.gain * n.inertia)) / (2.0 * math.pi)


def followed(joint: DesignJoint, motion: FloatArray, step: float) -> FloatArray:
    """Motion (4, T) of the joint under a periodic designed motion (4, T), by (following).

    Args:
        joint: With a position servo.
        motion: One period.
        step: Time between its samples [s].
    """
    n, size = joint.numbers, motion.shape[1]
    w = 2.0 * np.pi * np.fft.rfftfreq(size, step)
    response = 1.0 / (1.0 - n.gain * n.inertia * w**2 + 1j * n.gain * n.viscous * w)
    return np.asarray(np.fft.irfft(np.fft.rfft(motion, axis=1) * response, size, axis=1))


def tracking_warning(joint: DesignJoint, limits: JointLimits, motion: FloatArray, step: float) -> tuple[str, ...]:
    """One sentence where the servo's resonance takes the joint beyond its limits; none where it does not."""
    highest = followed_up_to(joint)
    if not highest < limits.bandwidth_hz:
        return ()
    made = followed(joint, motion, step)
    speed, acceleration = (float(np.abs(row).max()) for row in made[1:3])
    if speed <= FOLLOWED * limits.velocity and acceleration <= FOLLOWED * limits.acceleration:
        return ()
    text = (
        f"The position servo's stiffness and the inertia resonate: as its logs are fitted, the joint would reach "
        f"{speed:.3g} rad/s and {acceleration:.3g} rad/s² where the limits are {limits.velocity:.3g} rad/s and "
        f"{limits.acceleration:.3g} rad/s². Design the motion with --bandwidth {highest:.2g}, up to which the servo "
        "follows its command."
    )
    return (joint.context.units.text(text),)


TRIES = 8
"""Random motions within each set of limits."""


def what_limits(search: MotionSearch, seed: int) -> str:
    """One sentence: the limit whose doubling brings most, by the best of the same random motions and single waves.

    Args:
        search: For one motion that separates two effects.
        seed: Of the random motions.
    """
    limits, before = search.limits, _best(search, search.limits, seed)
    low, high = limits.position
    half = 0.5 * (high - low)
    faster = replace(limits, acceleration=2.0 * limits.acceleration)
    wider = {
        "the position limits": replace(limits, position=(low - half, high + half)),
        "the speed": replace(limits, velocity=2.0 * limits.velocity),
        "the acceleration": faster,
        "the bandwidth": replace(limits, bandwidth_hz=2.0 * limits.bandwidth_hz),
        "acceleration, torque and bandwidth together": replace(
            faster, torque=2.0 * limits.torque, bandwidth_hz=2.0 * limits.bandwidth_hz
        ),
    }
    gains = {name: _best(search, each, seed) - before for name, each in wider.items()}
    name, gain = max(gains.items(), key=lambda pair: pair[1])
    if not gain > 0.5 * math.log(1.2):
        return (
            "Twice as wide limits would not bring the two much further apart; the distance grows with the square root "
            "of the length of the experiment."
        )
    return (
        f"The limits, and not the search, keep the two close: of all limits, doubling {name} helps most and makes the "
        f"distance {math.exp(gain):.2g} times as large."
    )


def _best(search: MotionSearch, limits: JointLimits, seed: int) -> float:
    """The logarithm of the largest distance of rough motions within limits; minus infinity where none keeps them."""
    rng, old, (joint,) = np.random.default_rng(seed), search.basis, search.joints
    basis = scaled(
        motion_basis(old.kind, old.period, min(old.step, 0.02 / limits.bandwidth_hz), limits.bandwidth_hz), limits
    )
    wide, found = replace(search, basis=basis, limits=limits), -math.inf
    try:
        motions: Sequence[FloatArray] = [random_start(joint, basis, limits, rng) for _ in range(TRIES)]
        for x in (*motions, *single_waves(joint, basis, limits)):
            found = max(found, wide.worth([x], (1,)).scale)
    except ParamsError:
        pass
    return found
