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
from drake_tc.experiments.design.motions import JointLimits, motion_basis
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
KEPT = 8
"""Of these motions and the single waves, the best ones, which are tried within wider limits."""


def what_limits(search: MotionSearch, seed: int) -> str:
    """One sentence: the limit whose doubling brings most, by the best of the same random motions and single waves.

    Within the wider limits these are larger, and faster where the bandwidth is wider.

    Args:
        search: For one motion that separates two effects.
        seed: Of the random motions.
    """
    limits, before = search.limits, _scales(search, search.limits, seed)
    best = sorted(before, key=lambda number: -before[number])[:KEPT]
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
    found = {name: max(_scales(search, each, seed, best).values(), default=-math.inf) for name, each in wider.items()}
    name = max(found, key=lambda each: found[each])
    gain = found[name] - before[best[0]] if best else -math.inf
    if not gain > 0.5 * math.log(1.2):
        return (
            "Twice as wide limits would not bring the two much further apart; the distance grows with the square root "
            "of the length of the experiment."
        )
    return (
        f"The limits, and not the search, keep the two close: of all limits, doubling {name} helps most and makes the "
        f"distance {math.exp(gain):.2g} times as large."
    )


def _scales(
    search: MotionSearch, limits: JointLimits, seed: int, kept: Sequence[int] | None = None
) -> dict[int, float]:
    """Logarithm of the distance of each rough motion within limits, by its number; none where a limit allows none.

    Args:
        search: For one motion.
        limits: Of it.
        seed: Of the random motions.
        kept: Numbers of the motions; None for all.
    """
    rng, old, (joint,) = np.random.default_rng(seed), search.basis, search.joints
    basis = motion_basis(old.kind, old.period, min(old.step, 0.02 / limits.bandwidth_hz), limits)
    wide = replace(search, basis=basis, limits=limits)
    try:
        motions = [random_start(joint, basis, limits, rng) for _ in range(TRIES)]
        motions += single_waves(joint, basis, limits)
    except ParamsError:
        return {}
    numbers = range(len(motions)) if kept is None else [number for number in kept if number < len(motions)]
    return {number: wide.worth([motions[number]], (1,)).scale for number in numbers}
